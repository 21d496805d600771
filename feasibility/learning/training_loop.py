"""The loop in which every network here learns: epochs, patience, best weights, checkpoint.

What an epoch is, with its batches, its learning rate and its loss, is the caller's affair: a
function that trains for one epoch and returns a record of it.
"""

import hashlib
import json
import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Final, Generic, Protocol, TypeVar, final

import numpy as np
from numpy.typing import NDArray

from feasibility.errors import InputError
from feasibility.runtime.atomic import atomic_path
from feasibility.runtime.extras import load_extra

_FORMAT: Final = 2
"""Version of the checkpoints; earlier ones had none."""


@final
class StopTraining(Exception):  # noqa: N818 (a request, not an error)
    """Raised by `on_epoch` to end training; the network keeps what it has learned."""


class EpochRecord(Protocol):
    """What the loop asks of the record of an epoch: a dataclass with these two fields."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def number(self) -> int:
        """Number of the epoch, from 1."""
        ...

    @property
    def validation_loss(self) -> float:
        """Loss on rows that are not learned from; NaN where there are none."""
        ...


R = TypeVar("R", bound=EpochRecord)


@final
@dataclass(frozen=True, eq=False)
class Learner(Generic[R]):
    """A network and how it learns.

    Attributes
    ----------
    network, optimiser : torch.nn.Module, torch.optim.Optimizer
        What is trained, and what changes its weights.
    train_epoch : callable
        Trains the network for the epoch of the given number and returns its record. An epoch
        must draw its random numbers from a stream of its own, or a resumed training would
        differ from an uninterrupted one.
    record_type : type
        The record's dataclass, with fields that JSON knows.
    schedule : torch.optim.lr_scheduler.LRScheduler, optional
        What changes the learning rate, if it has a state.
    """

    network: Any
    optimiser: Any
    train_epoch: Callable[[int], R]
    record_type: Callable[..., R]
    schedule: Any = None


@final
@dataclass(frozen=True)
class LoopRule:
    """How long a training lasts and which weights are kept.

    Attributes
    ----------
    epochs : int
        How many at most.
    patience : int, optional
        Stop when the validation loss has not fallen for this many epochs.
    keep_best : bool
        Keep the weights of the lowest validation loss instead of the last ones.
    best_loss : float
        Validation loss of the initial weights, which are kept where no epoch has a lower one.
    """

    epochs: int
    patience: int | None = None
    keep_best: bool = True
    best_loss: float = math.inf


@final
@dataclass(frozen=True)
class Checkpoint:
    """A file that is rewritten after each epoch, from which an interrupted training goes on.

    Attributes
    ----------
    path : Path
        The file.
    identity : str
        `training_identity`: only the same training goes on.
    """

    path: Path
    identity: str

    @classmethod
    def at(cls, path: Path | None, identity: Callable[[], str]) -> "Checkpoint | None":
        """Return the checkpoint at a path, or None without one; much data takes long to digest."""
        return None if path is None else cls(path, identity())


@final
@dataclass
class _Progress:
    """Where a training stands between two epochs."""

    best_weights: dict[str, Any]
    best_loss: float
    best_epoch: int = 0
    epoch: int = 0
    history: list[Any] = field(default_factory=list)


def train_network(
    learner: Learner[R],
    rule: LoopRule,
    *,
    checkpoint: Checkpoint | None = None,
    on_epoch: Callable[[R], None] = lambda _: None,
    replay: bool = False,
) -> tuple[R, ...]:
    """Train a network; at the end it has the weights to be kept.

    Parameters
    ----------
    learner : Learner
        The network and how it learns.
    rule : LoopRule
        How long.
    checkpoint : Checkpoint, optional
        Where it exists, the training goes on from it, and ends as an uninterrupted one.
    on_epoch : callable
        Called after each epoch; it may raise `StopTraining`.
    replay : bool
        Whether `on_epoch` is called for the epochs of the checkpoint too.

    Returns
    -------
    tuple of records
        All epochs, those before an interruption too.

    Raises
    ------
    InputError
        The checkpoint cannot be written, is damaged, of an earlier version, or of another
        training.
    """
    progress = _Progress(_copy(learner.network), rule.best_loss)
    if checkpoint is not None and checkpoint.path.exists():
        progress = _load(checkpoint, learner)
        for record in progress.history if replay else ():
            on_epoch(record)
    while progress.epoch < rule.epochs:
        if rule.patience is not None and progress.epoch - progress.best_epoch >= rule.patience:
            break
        record = learner.train_epoch(progress.epoch + 1)
        progress.epoch = record.number
        progress.history.append(record)
        better = record.validation_loss < progress.best_loss
        if better:
            progress.best_epoch, progress.best_loss = record.number, record.validation_loss
        if better or not rule.keep_best:
            progress.best_weights = _copy(learner.network)
        if checkpoint is not None:
            _save(checkpoint, learner, progress)
        try:
            on_epoch(record)
        except StopTraining:
            break
    learner.network.load_state_dict(progress.best_weights)
    return tuple(progress.history)


def training_identity(settings: Mapping[str, Any], *arrays: NDArray[Any]) -> str:
    """Return a digest of all that decides what a training gives: settings and data."""
    digest = hashlib.sha256(json.dumps(settings, sort_keys=True).encode())
    for array in arrays:
        digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()


def _copy(network: Any) -> dict[str, Any]:
    return {name: value.detach().clone() for name, value in network.state_dict().items()}


def _save(checkpoint: Checkpoint, learner: Learner[Any], progress: _Progress) -> None:
    content = {
        "format": _FORMAT,
        "identity": checkpoint.identity,
        "network": learner.network.state_dict(),
        "optimiser": learner.optimiser.state_dict(),
        "schedule": None if learner.schedule is None else learner.schedule.state_dict(),
        "progress": {**vars(progress), "history": [asdict(done) for done in progress.history]},
    }
    with atomic_path(checkpoint.path) as temporary:
        load_extra("torch").save(content, temporary)


def _load(checkpoint: Checkpoint, learner: Learner[Any]) -> _Progress:
    """Put network, optimiser and schedule where the checkpoint left them; return the rest."""
    path = checkpoint.path
    try:
        content = load_extra("torch").load(path, weights_only=True, map_location="cpu")
        version, identity = content.get("format"), content["identity"]
    except Exception as error:  # torch raises whatever its readers do
        raise InputError(
            f"{path}: not a checkpoint of this program, or damaged "
            f"({type(error).__name__}); delete it to start again"
        ) from None
    if version != _FORMAT:
        raise InputError(
            f"{path}: checkpoint of another version of this program; delete it to start again"
        )
    if identity != checkpoint.identity:
        raise InputError(
            f"{path}: checkpoint of another training (data, seed or hyperparameters differ); "
            "expected the same, or another file"
        )
    learner.network.load_state_dict(content["network"])
    learner.optimiser.load_state_dict(content["optimiser"])
    if learner.schedule is not None:
        learner.schedule.load_state_dict(content["schedule"])
    progress = _Progress(**content["progress"])
    progress.history = [learner.record_type(**done) for done in progress.history]
    return progress
