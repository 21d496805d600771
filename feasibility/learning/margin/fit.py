"""The training of one net of a margin model: recipe, network, loss, and what an epoch is."""

import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.margin.network import INPUT_LIMIT
from feasibility.errors import InputError
from feasibility.learning.training_loop import (
    Checkpoint,
    Learner,
    LoopRule,
    train_network,
    training_identity,
)
from feasibility.runtime.extras import load_extra

_Array = NDArray[np.float64]
_Tensors = tuple[Any, Any, Any]
"""Inputs (n, k), targets (n,) and weights (n,), as torch has them."""

UNIT: Final = 0.02
"""Unit of the nets' corrections of logarithms: errors are of this order, and a fixed one keeps
the loss comparable between trainings."""

LARGEST_MISS: Final = 50.0
_WEIGHT_DECAY: Final = 1e-4
WARM_UP: Final = 0.08
SIZE_WEIGHT: Final = 0.1
LARGEST_GRADIENT: Final = 5.0


@final
@dataclass(frozen=True)
class MarginRecipe:
    """How to train.

    Parameters
    ----------
    layers, width : int
        Hidden layers of the net, and units of each; those of the model it starts from count.
    epochs : int
        Passes over the training part, 0 to keep the nets of the model that it starts from; the
        learning rate rises for a start and falls to zero along half a cosine.
    quick_epochs : int, optional
        Passes for the quick net; by default 24, or 0 where `epochs` is.
    batch : int
        Legs a step.
    learning_rate : float
        Largest one.
    patience : int, optional
        Stop when the validation loss has not fallen for this many epochs.
    seed : int
        Seed of split, weights and order.
    device : str
        "cpu", "cuda", or "auto" for a GPU where there is one.
    threads : int
        Threads of the processor.

    Raises
    ------
    InputError
        A number is out of range.
    """

    layers: int = 4
    width: int = 256
    epochs: int = 30
    quick_epochs: int | None = None
    batch: int = 1024
    learning_rate: float = 2.5e-3
    patience: int | None = None
    seed: int = 0
    device: str = "auto"
    threads: int = 2

    def __post_init__(self) -> None:
        if self.epochs < 0:
            raise InputError(f"margin epochs: {self.epochs}, expected 0 or more")
        if self.quick_epochs is not None and self.quick_epochs < 0:
            raise InputError(f"margin quick_epochs: {self.quick_epochs}, expected 0 or more")
        for name in ("layers", "width", "batch", "threads"):
            if getattr(self, name) < 1:
                raise InputError(f"margin {name}: {getattr(self, name)}, expected 1 or more")
        if self.device not in ("cpu", "cuda", "auto"):
            raise InputError(f"margin device: {self.device!r}, expected cpu, cuda or auto")


@final
@dataclass(frozen=True)
class MarginEpoch:
    """What happened in one epoch; losses are mean absolute errors of log m*, roughly."""

    number: int
    train_loss: float
    validation_loss: float


OnEpoch = Callable[[MarginEpoch], None]


def device_of(name: str) -> str:
    """Return "cpu" or "cuda"; of "auto", a GPU where there is one."""
    if name != "auto":
        return name
    return "cuda" if load_extra("torch").cuda.is_available() else "cpu"


def fit_net(
    X: _Array,
    error: _Array,
    weight: _Array,
    learned: NDArray[np.intp],
    validation: NDArray[np.intp],
    recipe: MarginRecipe,
    *,
    layers: int,
    width: int,
    epochs: int,
    unit: float = UNIT,
    heed_outliers: bool = False,
    start: Mapping[str, _Array] | None = None,
    checkpoint: Path | None = None,
    on_epoch: OnEpoch = lambda _: None,
) -> dict[str, _Array]:
    """Train one net to predict `error`, and return its arrays for `MarginNet`.

    Its second output is the mean absolute error to expect or, to `heed_outliers`, the root of
    the mean square error.

    Parameters
    ----------
    X : (n, k) float64
        Inputs.
    error, weight : (n,) float64
        What is to be predicted, and how much each row counts.
    learned, validation : (a,), (b,) intp
        Rows to learn from, and those that say which epoch's weights are kept.
    recipe : MarginRecipe
        How to train.
    layers, width, epochs : int
        In place of those of the recipe.
    unit : float
        Size of errors in which the net counts.
    heed_outliers : bool
        See above.
    start : mapping of str to array, optional
        Arrays of such a net: its weights and scales are where the training begins.
    checkpoint, on_epoch
        As for `train_margin`.

    Raises
    ------
    InputError
        As `train_network`.
    MissingDependencyError
        The extra ``train`` is not installed.
    """
    if start is not None and epochs == 0:
        return {name: array for name, array in start.items() if name != "settled"}
    torch = load_extra("torch")
    torch.set_num_threads(recipe.threads)
    torch.manual_seed(recipe.seed)
    device = device_of(recipe.device)
    mean, std = X[learned].mean(axis=0), X[learned].std(axis=0) + 1e-6
    sizes = [X.shape[1], *[width] * layers]
    if start is not None:
        mean, std, unit = start["mean"], start["std"], float(start["unit"])
        count = sum(name.startswith("weight_") for name in start)
        sizes = [start[f"weight_{i}"].shape[1] for i in range(count)]

    def tensors(rows: NDArray[np.intp]) -> _Tensors:
        scaled = np.clip((X[rows] - mean) / std, -INPUT_LIMIT, INPUT_LIMIT)
        values = (scaled, error[rows] / unit, weight[rows])
        x, target, importance = (torch.from_numpy(v.astype(np.float32)).to(device) for v in values)
        return x, target, importance

    network = _network(torch, sizes, start).to(device)
    optimiser = torch.optim.AdamW(
        network.parameters(), lr=recipe.learning_rate, weight_decay=_WEIGHT_DECAY
    )
    batches = max(len(learned) // recipe.batch, 1)
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimiser, recipe.learning_rate, total_steps=epochs * batches, pct_start=WARM_UP
    )
    work = _Epochs(
        recipe, network, optimiser, schedule, tensors(learned), tensors(validation), unit,
        heed_outliers,
    )  # fmt: skip
    # A training may go on with other threads or elsewhere, though not to the last digit the same.
    settings = {**asdict(recipe), "threads": None, "device": None, "sizes": sizes, "of": epochs}
    data = (error[learned],) if start is None else (error[learned], start["weight_0"])
    train_network(
        Learner(network, optimiser, work.train, MarginEpoch, schedule),
        LoopRule(
            epochs,
            recipe.patience,
            best_loss=math.inf if start is None else work.validation_loss(),
        ),
        checkpoint=Checkpoint.at(checkpoint, lambda: training_identity(settings, *data)),
        on_epoch=on_epoch,
        replay=True,
    )
    return {"mean": mean, "std": std, "unit": np.array(unit), **_weights(network)}


@final
@dataclass(frozen=True, eq=False)
class _Epochs:
    """What an epoch of a net is."""

    recipe: MarginRecipe
    network: Any
    optimiser: Any
    schedule: Any
    learned: _Tensors
    validation: _Tensors
    unit: float
    heed_outliers: bool

    def train(self, number: int) -> MarginEpoch:
        """Train for one epoch and return its record."""
        torch, recipe = load_extra("torch"), self.recipe
        count = len(self.learned[0])
        batches = max(count // recipe.batch, 1)
        # An own stream for each epoch, so that a resumed training sees the same order.
        shuffled = np.random.default_rng([recipe.seed, 2, number]).permutation(count)
        order = torch.from_numpy(shuffled).to(self.learned[0].device)
        total = 0.0
        for first in range(0, batches * recipe.batch, recipe.batch):
            rows = order[first : first + recipe.batch]
            loss, size_loss = self._losses(torch, *(column[rows] for column in self.learned))
            self.optimiser.zero_grad()
            (loss + SIZE_WEIGHT * size_loss).backward()
            torch.nn.utils.clip_grad_norm_(self.network.parameters(), LARGEST_GRADIENT)
            self.optimiser.step()
            self.schedule.step()
            total += loss.item()
        return MarginEpoch(number, self.unit * total / batches, self.validation_loss())

    def validation_loss(self) -> float:
        """Return the loss on the validation rows."""
        torch = load_extra("torch")
        with torch.no_grad():
            return self.unit * float(self._losses(torch, *self.validation)[0])

    def _losses(self, torch: Any, x: Any, target: Any, importance: Any) -> tuple[Any, Any]:
        mean_out, scale_out = self.network(x).unbind(dim=1)
        loss = torch.nn.functional.smooth_l1_loss(mean_out, target, beta=0.5, reduction="none")
        # The second output learns the size of the error that the first one makes: the
        # likelihood of a Laplace or a normal distribution.
        miss = (mean_out - target).abs().detach().clamp(max=LARGEST_MISS)
        if self.heed_outliers:
            size_loss = scale_out + 0.5 * miss * miss * torch.exp(-2.0 * scale_out)
        else:
            size_loss = scale_out + miss * torch.exp(-scale_out)
        return (importance * loss).mean(), (importance * size_loss).mean()


def _network(torch: Any, sizes: list[int], start: Mapping[str, _Array] | None) -> Any:
    """Return a net with layers of these sizes and two outputs; its weights are random or given."""
    modules: list[Any] = []
    for before, after in itertools.pairwise(sizes):
        modules += [torch.nn.Linear(before, after), torch.nn.SiLU()]
    head = torch.nn.Linear(sizes[-1], 2)
    torch.nn.init.zeros_(head.bias)
    with torch.no_grad():
        head.weight.mul_(0.1)
        network = torch.nn.Sequential(*modules, head)
        if start is not None:
            for i, part in enumerate(_linear(network)):
                part.weight.copy_(torch.tensor(start[f"weight_{i}"]))
                part.bias.copy_(torch.tensor(start[f"bias_{i}"]))
    return network


def _weights(network: Any) -> dict[str, _Array]:
    arrays = {}
    for i, part in enumerate(_linear(network)):
        arrays[f"weight_{i}"] = part.weight.detach().cpu().numpy().copy()
        arrays[f"bias_{i}"] = part.bias.detach().cpu().numpy().copy()
    return arrays


def _linear(network: Any) -> list[Any]:
    return [part for part in network if hasattr(part, "weight")]
