"""The training of one net of a margin model: a loop to be read from top to bottom."""

import hashlib
import itertools
import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.margin.network import INPUT_LIMIT
from feasibility.errors import InputError
from feasibility.runtime.atomic import atomic_path
from feasibility.runtime.extras import load_extra

_Array = NDArray[np.float64]

UNIT: Final = 0.02
"""Unit of the nets' corrections of logarithms: errors are of this order, and a fixed one keeps
the loss comparable between trainings."""

_LARGEST_MISS: Final = 50.0
_WEIGHT_DECAY: Final = 1e-4
_WARM_UP: Final = 0.08
_SIZE_WEIGHT: Final = 0.1
_LARGEST_GRADIENT: Final = 5.0


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
        Stop when the validation loss has not fallen for so many epochs.
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
    the mean square error. With `start`, the arrays of such a net, its weights and scales are
    where the training begins.
    """
    if start is not None and epochs == 0:
        return {name: array for name, array in start.items() if name != "settled"}
    torch = load_extra("torch")
    torch.set_num_threads(recipe.threads)
    torch.manual_seed(recipe.seed)
    device = recipe.device
    if device == "auto":
        device = "cuda" if torch.cuda.is_available() else "cpu"
    mean, std = X[learned].mean(axis=0), X[learned].std(axis=0) + 1e-6
    if start is not None:
        mean, std, unit = start["mean"], start["std"], float(start["unit"])

    def on_device(rows: NDArray[np.intp]) -> tuple[Any, Any, Any]:
        scaled = np.clip((X[rows] - mean) / std, -INPUT_LIMIT, INPUT_LIMIT)
        values = (scaled, error[rows] / unit, weight[rows])
        x, target, importance = (torch.from_numpy(v.astype(np.float32)) for v in values)
        return x.to(device), target.to(device), importance.to(device)

    inputs, targets, weights = on_device(learned)
    held_out = on_device(validation)
    sizes = [X.shape[1], *[width] * layers]
    if start is not None:
        count = sum(name.startswith("weight_") for name in start)
        sizes = [start[f"weight_{i}"].shape[1] for i in range(count)]
    modules: list[Any] = []
    for before, after in itertools.pairwise(sizes):
        modules += [torch.nn.Linear(before, after), torch.nn.SiLU()]
    head = torch.nn.Linear(sizes[-1], 2)
    torch.nn.init.zeros_(head.bias)
    with torch.no_grad():
        head.weight.mul_(0.1)
    network = torch.nn.Sequential(*modules, head)
    linear = [part for part in network if hasattr(part, "weight")]
    if start is not None:
        with torch.no_grad():
            for i, part in enumerate(linear):
                part.weight.copy_(torch.tensor(start[f"weight_{i}"]))
                part.bias.copy_(torch.tensor(start[f"bias_{i}"]))
    network = network.to(device)
    optimiser = torch.optim.AdamW(
        network.parameters(), lr=recipe.learning_rate, weight_decay=_WEIGHT_DECAY
    )
    batches = max(len(learned) // recipe.batch, 1)
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimiser, recipe.learning_rate, total_steps=epochs * batches, pct_start=_WARM_UP
    )

    def losses_of(batch: tuple[Any, Any, Any]) -> tuple[Any, Any]:
        x, target, importance = batch
        mean_out, scale_out = network(x).unbind(dim=1)
        loss = torch.nn.functional.smooth_l1_loss(mean_out, target, beta=0.5, reduction="none")
        # The second output learns the size of the error that the first one makes: the
        # likelihood of a Laplace or a normal distribution.
        miss = (mean_out - target).abs().detach().clamp(max=_LARGEST_MISS)
        if heed_outliers:
            size_loss = scale_out + 0.5 * miss * miss * torch.exp(-2.0 * scale_out)
        else:
            size_loss = scale_out + miss * torch.exp(-scale_out)
        return (importance * loss).mean(), (importance * size_loss).mean()

    # A training may go on with other threads or elsewhere, though not to the last digit the same.
    settings = asdict(recipe) | {"threads": None, "device": None}
    identity = hashlib.sha256(
        json.dumps([settings, sizes, epochs]).encode()
        + error[learned].tobytes()
        + (b"" if start is None else start["weight_0"].tobytes())
    ).hexdigest()
    state: dict[str, Any] = {"epoch": 0, "best_epoch": 0, "best_loss": np.inf, "history": []}
    best = {name: value.clone() for name, value in network.state_dict().items()}
    if start is not None:
        with torch.no_grad():
            state["best_loss"] = float(losses_of(held_out)[0])
    if checkpoint is not None and checkpoint.exists():
        saved = torch.load(checkpoint, weights_only=True, map_location=device)
        if saved["identity"] != identity:
            raise InputError(f"{checkpoint}: of another training; remove it to begin anew")
        network.load_state_dict(saved["network"])
        optimiser.load_state_dict(saved["optimiser"])
        schedule.load_state_dict(saved["schedule"])
        best, state = saved["best"], saved["state"]
        for epoch in state["history"]:
            on_epoch(MarginEpoch(**epoch))
    while state["epoch"] < epochs:
        number = state["epoch"] + 1
        if recipe.patience is not None and number - 1 - state["best_epoch"] >= recipe.patience:
            break
        # An own stream for each epoch, so that a resumed training sees the same order.
        order = np.random.default_rng([recipe.seed, 2, number]).permutation(len(learned))
        order = torch.from_numpy(order).to(device)
        total = 0.0
        for first in range(0, batches * recipe.batch, recipe.batch):
            rows = order[first : first + recipe.batch]
            loss, size_loss = losses_of((inputs[rows], targets[rows], weights[rows]))
            optimiser.zero_grad()
            (loss + _SIZE_WEIGHT * size_loss).backward()
            torch.nn.utils.clip_grad_norm_(network.parameters(), _LARGEST_GRADIENT)
            optimiser.step()
            schedule.step()
            total += loss.item()
        with torch.no_grad():
            held = float(losses_of(held_out)[0])
        if held < state["best_loss"]:
            state["best_loss"], state["best_epoch"] = held, number
            best = {name: value.clone() for name, value in network.state_dict().items()}
        state["epoch"] = number
        done = MarginEpoch(number, unit * total / batches, unit * held)
        state["history"].append(asdict(done))
        on_epoch(done)
        if checkpoint is not None:
            content = {
                "identity": identity,
                "network": network.state_dict(),
                "optimiser": optimiser.state_dict(),
                "schedule": schedule.state_dict(),
                "best": best,
                "state": state,
            }
            with atomic_path(checkpoint) as temporary:
                torch.save(content, temporary)
    network.load_state_dict(best)
    arrays = {"mean": mean, "std": std, "unit": np.array(unit)}
    for i, part in enumerate(linear):
        arrays[f"weight_{i}"] = part.weight.detach().cpu().numpy().copy()
        arrays[f"bias_{i}"] = part.bias.detach().cpu().numpy().copy()
    return arrays
