"""The training loop on a net of one weight, whose losses a test dictates."""

from dataclasses import dataclass

import numpy as np
import pytest

from feasibility import InputError
from feasibility.learning.training_loop import (
    Checkpoint,
    Learner,
    LoopRule,
    StopTraining,
    train_network,
    training_identity,
)

torch = pytest.importorskip("torch")


@dataclass(frozen=True)
class Record:
    number: int
    validation_loss: float


def learner(losses):
    """Return a learner whose weight is the number of its last epoch."""
    network = torch.nn.Linear(1, 1, bias=False)
    with torch.no_grad():
        network.weight.zero_()

    def train_epoch(number):
        with torch.no_grad():
            network.weight.add_(1.0)
        return Record(number, losses[number - 1])

    return Learner(network, torch.optim.SGD(network.parameters(), lr=0.1), train_epoch, Record)


def trained(losses, rule=None, **options):
    """Return the weight that is kept, and the numbers of the epochs."""
    made = learner(losses)
    history = train_network(made, rule or LoopRule(len(losses)), **options)
    return made.network.weight.item(), [record.number for record in history]


def test_the_weights_of_the_lowest_loss_are_kept_or_the_last_ones():
    losses = [3.0, 1.0, 2.0, 1.0]
    assert trained(losses) == (2.0, [1, 2, 3, 4])
    assert trained(losses, LoopRule(4, keep_best=False)) == (4.0, [1, 2, 3, 4])


def test_initial_weights_are_kept_where_no_epoch_is_better():
    assert trained([3.0, 2.0], LoopRule(2, best_loss=1.0)) == (0.0, [1, 2])
    assert trained([float("nan")] * 2) == (0.0, [1, 2])


def test_patience_counts_epochs_since_the_best_one():
    losses = [3.0, 1.0, 2.0, 2.0, 0.0]
    assert trained(losses, LoopRule(5, patience=2)) == (2.0, [1, 2, 3, 4])
    assert trained(losses, LoopRule(5, patience=3)) == (5.0, [1, 2, 3, 4, 5])


def test_a_request_to_stop_ends_the_training_after_its_checkpoint(tmp_path):
    checkpoint = Checkpoint(tmp_path / "c", "mine")
    seen = []

    def stop(record):
        seen.append(record.number)
        raise StopTraining

    losses = [3.0, 2.0, 1.0]
    assert trained(losses, checkpoint=checkpoint, on_epoch=stop) == (1.0, [1])
    assert trained(losses, checkpoint=checkpoint, on_epoch=stop) == (2.0, [1, 2])
    assert seen == [1, 2]
    seen.clear()
    replayed = {"on_epoch": lambda record: seen.append(record.number), "replay": True}
    assert trained(losses, checkpoint=checkpoint, **replayed) == (3.0, [1, 2, 3])
    assert seen == [1, 2, 3]


def test_a_checkpoint_of_another_version_or_training_or_damaged_is_refused(tmp_path):
    checkpoint = Checkpoint(tmp_path / "c", "mine")
    trained([1.0], checkpoint=checkpoint)
    with pytest.raises(InputError, match="another training"):
        trained([1.0], checkpoint=Checkpoint(checkpoint.path, "yours"))
    content = torch.load(checkpoint.path, weights_only=True)
    # The checkpoints of earlier versions had no number of their format.
    del content["format"]
    torch.save(content, checkpoint.path)
    with pytest.raises(InputError, match="another version") as caught:
        trained([1.0], checkpoint=checkpoint)
    assert str(checkpoint.path) in str(caught.value)
    assert "\n" not in str(caught.value)
    checkpoint.path.write_bytes(b"PK")
    with pytest.raises(InputError, match="damaged"):
        trained([1.0], checkpoint=checkpoint)


def test_no_path_means_no_checkpoint_and_no_digest():
    assert Checkpoint.at(None, lambda: pytest.fail("digested in vain")) is None


def test_the_identity_is_that_of_settings_and_data():
    rows = np.arange(6.0)
    one = training_identity({"a": 1, "b": 2}, rows)
    assert training_identity({"b": 2, "a": 1}, rows) == one
    assert training_identity({"a": 1, "b": 3}, rows) != one
    assert training_identity({"a": 1, "b": 2}, rows + 1.0) != one
