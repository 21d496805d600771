"""From datasets to a margin model: one program, to be read from top to bottom."""

import hashlib
import itertools
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.atomic import atomic_path
from feasibility.dataset import Dataset
from feasibility.errors import InputError
from feasibility.learning.artefact import Artefact
from feasibility.learning.extra import load_extra
from feasibility.learning.folds import split_pairs
from feasibility.learning.margin.calibration import (
    Calibration,
    boundary_scores,
    fit_calibration,
)
from feasibility.learning.margin.features import (
    FEATURE_SET,
    FEATURES,
    domain_quantities,
    log_acceleration,
    margin_features,
    quick_features,
)
from feasibility.learning.margin.network import INPUT_LIMIT, MarginNet
from feasibility.provenance import provenance

_Array = NDArray[np.float64]

SHARES: Final = (0.85, 0.05, 0.1)
"""Shares of training, validation and calibration, split by pairs of bodies."""

_UNIT: Final = 0.02
"""Unit of the nets' corrections of log m*: errors are of this order, and a fixed one keeps the
loss comparable between trainings."""

_RELEVANT: Final = 0.6
"""Legs whose own margin is beyond this are learned with `_FAR_WEIGHT`: their m* hardly matters."""

_FAR_WEIGHT: Final = 0.25
_QUICK_LAYERS: Final = (2, 48)
_QUICK_EPOCHS: Final = 8
_QUICK_UNIT: Final = 0.05
_LARGEST_MISS: Final = 50.0
_SETTLED_TAIL: Final = 5e-4
_SETTLED_SAFETY: Final = 1.05
_DOMAIN_SLACK: Final = 0.03
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
    batch: int = 1024
    learning_rate: float = 2.5e-3
    patience: int | None = None
    seed: int = 0
    device: str = "auto"
    threads: int = 2

    def __post_init__(self) -> None:
        if self.epochs < 0:
            raise InputError(f"margin epochs: {self.epochs}, expected 0 or more")
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


@final
@dataclass(frozen=True, eq=False)
class MarginExamples:
    """Solved legs as the nets see them; n of them.

    Attributes
    ----------
    X, hint : (n, 80), (n,) float64
        `margin_features`.
    X_quick, quick_hint : (n, 40), (n,) float64
        `quick_features`; the hint is NaN where there is none.
    target : (n,) float64
        `log_acceleration` at m*.
    weight : (n,) float64
        How much a leg counts.
    pairs : (n,) int64
        Number of the unordered pair of bodies.
    """

    X: _Array
    hint: _Array
    X_quick: _Array
    quick_hint: _Array
    target: _Array
    weight: _Array
    pairs: NDArray[np.int64]

    @classmethod
    def of(cls, datasets: Sequence[Dataset]) -> "MarginExamples":
        """Compute features and targets of all legs with a known m*.

        A pair of bodies is told by its ids within a catalogue, so that datasets
        from one catalogue share pairs.

        Raises
        ------
        InputError
            A dataset was not labelled by margin.
        """
        parts = []
        catalogues: dict[str, int] = {}
        offset = 0
        for dataset in datasets:
            label = dataset.metadata["protocol"]["label"]
            if label != "margin":
                raise InputError(f"margin model: a dataset is labelled by {label}, not by margin")
            columns = dataset.columns
            legs = dataset.legs
            X, hint = margin_features(legs)
            X_quick, quick_hint = quick_features(legs)
            target = log_acceleration(legs, columns["m_star_kg"])
            known = np.isfinite(target) & np.isfinite(hint)
            relevant = np.abs(columns["log_margin"]) < _RELEVANT
            key = json.dumps(dataset.metadata["catalogue"], sort_keys=True)
            number = catalogues.setdefault(key, len(catalogues))
            dep_id, arr_id = columns["dep_id"], columns["arr_id"]
            # Drawn orbits (negative ids) are pairs of their own, known ones those of a catalogue.
            drawn = (dep_id < 0) | (arr_id < 0)
            ends = np.column_stack(
                [
                    np.where(drawn, -1, number),
                    np.where(drawn, offset + np.arange(len(legs)), np.minimum(dep_id, arr_id)),
                    np.where(drawn, 0, np.maximum(dep_id, arr_id)),
                ]
            )
            offset += len(legs)
            parts.append(
                {
                    "X": X[known],
                    "hint": hint[known],
                    "X_quick": X_quick[known],
                    "quick_hint": quick_hint[known],
                    "target": target[known],
                    "weight": np.where(relevant, 1.0, _FAR_WEIGHT)[known],
                    "ends": ends[known],
                }
            )
        whole = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
        _, pairs = np.unique(whole.pop("ends"), axis=0, return_inverse=True)
        return cls(**whole, pairs=pairs.reshape(-1).astype(np.int64))


def train_margin(
    datasets: Sequence[Dataset],
    recipe: MarginRecipe,
    *,
    start: Artefact | None = None,
    checkpoint: Path | None = None,
    on_epoch: OnEpoch | None = None,
) -> Artefact:
    """Train a margin model on the legs of one or more datasets.

    One that starts from another keeps the standardisation and the domain of that one, the latter
    widened by the new legs, and its weights where training does not improve them on the
    validation part. Calibration is always that of the new legs.

    Parameters
    ----------
    datasets : sequence of Dataset
        Legs with m*; their catalogues and spacecraft may differ.
    recipe : MarginRecipe
        How to train.
    start : Artefact, optional
        A margin model to go on from, instead of random weights.
    checkpoint : Path, optional
        File rewritten after each epoch, from which an interrupted training goes on.
    on_epoch : callable, optional
        Called after each epoch of the net, not of the quick one.

    Returns
    -------
    Artefact
        Its metrics are those of the calibration part.

    Raises
    ------
    InputError
        Too few legs, labels of another kind, a checkpoint of another training.
    MissingDependencyError
        The extra ``train`` is not installed.
    """
    if start is None and not recipe.epochs:
        raise InputError("margin epochs: 0, expected 1 or more without a model to start from")
    first_net, first_quick = (
        (None, None) if start is None else (start.section("model"), start.section("quick"))
    )
    examples = MarginExamples.of(datasets)
    rng = np.random.default_rng([recipe.seed, 0])
    part = split_pairs(examples.pairs, SHARES, rng)
    learned, validation, calibration = (np.flatnonzero(part == k) for k in range(3))
    if len(learned) < recipe.batch:
        raise InputError(
            f"margin model: {len(learned)} legs to learn from, expected at least one batch of "
            f"{recipe.batch}; generate more legs"
        )
    epochs: list[MarginEpoch] = []

    def note(epoch: MarginEpoch) -> None:
        epochs.append(epoch)
        if on_epoch is not None:
            on_epoch(epoch)

    error = examples.target - examples.hint
    net = _fit(
        examples.X, error, examples.weight, learned, validation, recipe,
        layers=recipe.layers, width=recipe.width, epochs=recipe.epochs,
        start=first_net, checkpoint=checkpoint, on_epoch=note,
    )  # fmt: skip
    rough = np.isfinite(examples.quick_hint)
    quick_error = examples.target - examples.quick_hint
    quick = _fit(
        examples.X_quick, quick_error, examples.weight, learned[rough[learned]],
        validation[rough[validation]], recipe,
        layers=_QUICK_LAYERS[0], width=_QUICK_LAYERS[1],
        epochs=_QUICK_EPOCHS if recipe.epochs else 0,
        unit=_QUICK_UNIT, heed_outliers=True, start=first_quick,
    )  # fmt: skip

    # Estimates of log m* and what is wrong with them: a larger acceleration is a smaller m*.
    correction, expected = MarginNet(net)(examples.X[calibration])
    residual = correction - error[calibration]
    table = fit_calibration(residual, expected)
    rows = calibration[rough[calibration]]
    quick_correction, quick_expected = MarginNet(quick)(examples.X_quick[rows])
    quick_residual = (quick_correction - quick_error[rows]) / quick_expected
    settled = _SETTLED_SAFETY * np.quantile(quick_residual, [_SETTLED_TAIL, 1.0 - _SETTLED_TAIL])
    quantities = np.concatenate(
        [
            domain_quantities(examples.X[learned]),
            domain_quantities(examples.X_quick[learned[rough[learned]]]),
        ]
    )
    low, high = quantities.min(axis=0), quantities.max(axis=0)
    slack = _DOMAIN_SLACK * (high - low) + 1e-9
    low, high = low - slack, high + slack
    if start is not None and first_quick is not None:
        domain = start.section("domain")
        low, high = np.minimum(low, domain["low"]), np.maximum(high, domain["high"])
        # Few calibration legs see few outliers: what was needed before is needed still.
        known = first_quick["settled"]
        settled = np.array([min(settled[0], known[0]), max(settled[1], known[1])])
    return Artefact(
        kind="margin",
        feature_set=FEATURE_SET,
        features=FEATURES,
        units=("",) * len(FEATURES),
        arrays={
            **{f"model/{name}": array for name, array in net.items()},
            **{f"quick/{name}": array for name, array in quick.items()},
            "quick/settled": settled,
            "domain/low": low,
            "domain/high": high,
            **{f"calibration/{name}": array for name, array in table.items()},
            "calibration/positive_scores": boundary_scores(
                Calibration(table), residual, expected, np.random.default_rng([recipe.seed, 1])
            ),
        },
        config={
            "recipe": asdict(recipe),
            "legs": {
                "training": len(learned),
                "validation": len(validation),
                "calibration": len(calibration),
            },
            "epochs": [asdict(epoch) for epoch in epochs],
        },
        metrics={
            "calibration": {
                "median_absolute_log_error": float(np.median(np.abs(residual))),
                "mean_absolute_log_error": float(np.mean(np.abs(residual))),
                "hint_median_absolute_log_error": float(np.median(np.abs(error[calibration]))),
            }
        },
        provenance={
            **provenance(),
            "datasets": [_record(dataset) for dataset in datasets],
            **({} if start is None else {"start": dict(start.provenance)}),
        },
    )


def _record(dataset: Dataset) -> dict[str, Any]:
    """Return what a dataset is, without the folders of the machine that made it."""
    protocol, catalogue = dict(dataset.metadata["protocol"]), dict(dataset.metadata["catalogue"])
    table = dict(protocol.get("catalogue", {}))
    if table.get("file") is not None:
        table["file"] = catalogue["source"] = Path(table["file"]).name
    return {
        "protocol": protocol | {"catalogue": table},
        "catalogue": catalogue,
        "seed": dataset.metadata["seed"],
        "legs": len(dataset),
    }


def _fit(
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
    unit: float = _UNIT,
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
