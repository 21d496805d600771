"""From datasets to a margin model: one program, to be read from top to bottom."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.artefact import Artefact
from feasibility.classifier.margin.calibration import (
    Calibration,
    boundary_scores,
    fit_calibration,
)
from feasibility.classifier.margin.features import FEATURE_SET, FEATURES, domain_quantities
from feasibility.classifier.margin.network import MarginNet
from feasibility.dataset import Dataset
from feasibility.dataset.splits import split_pairs
from feasibility.errors import InputError
from feasibility.learning.margin.examples import MarginExamples
from feasibility.learning.margin.fit import MarginEpoch, MarginRecipe, OnEpoch, fit_net
from feasibility.runtime.provenance import provenance

_Array = NDArray[np.float64]

__all__ = ["SHARES", "MarginEpoch", "MarginRecipe", "OnEpoch", "train_margin"]

SHARES: Final = (0.85, 0.05, 0.1)
"""Shares of training, validation and calibration, split by pairs of bodies."""

_QUICK_LAYERS: Final = (2, 64)
_QUICK_EPOCHS: Final = 24
_QUICK_UNIT: Final = 0.05
_SETTLED_TAIL: Final = 1e-3
_SETTLED_SAFETY: Final = 1.05
_DOMAIN_SLACK: Final = 0.03


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
    validation part; its net for the final mass stays as it is. Calibration is always that of the
    new legs.

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
    examples = MarginExamples.of(datasets)
    parts = _Parts.of(examples, recipe)
    epochs: list[MarginEpoch] = []

    def note(epoch: MarginEpoch) -> None:
        epochs.append(epoch)
        if on_epoch is not None:
            on_epoch(epoch)

    net, quick = _fit_nets(examples, parts, recipe, start, checkpoint, note)
    # Estimates of log m* and what is wrong with them: a larger acceleration is a smaller m*.
    error = examples.error[parts.calibration]
    correction, expected = MarginNet(net)(examples.X[parts.calibration])
    residual = correction - error
    table = fit_calibration(residual, expected)
    scores = boundary_scores(
        Calibration(table), residual, expected, np.random.default_rng([recipe.seed, 1])
    )
    sections: dict[str, Mapping[str, _Array]] = {
        "model": net,
        "quick": {**quick, "settled": _settled(examples, parts, quick, start)},
        "domain": _domain(examples, parts, start),
        "calibration": {**table, "positive_scores": scores},
        "final_mass": {} if start is None else start.section("final_mass"),
    }
    return Artefact(
        kind="margin",
        feature_set=FEATURE_SET,
        features=FEATURES,
        units=("",) * len(FEATURES),
        arrays={
            f"{section}/{name}": array
            for section, arrays in sections.items()
            for name, array in arrays.items()
        },
        config={
            "recipe": asdict(recipe),
            "legs": {
                "training": len(parts.learned),
                "validation": len(parts.validation),
                "calibration": len(parts.calibration),
            },
            "epochs": [asdict(epoch) for epoch in epochs],
        },
        metrics={
            "calibration": {
                "median_absolute_log_error": float(np.median(np.abs(residual))),
                "mean_absolute_log_error": float(np.mean(np.abs(residual))),
                "hint_median_absolute_log_error": float(np.median(np.abs(error))),
            }
        },
        provenance={
            **provenance(),
            "datasets": [_record(dataset) for dataset in datasets],
            **({} if start is None else {"start": dict(start.provenance)}),
        },
    )


@final
@dataclass(frozen=True, eq=False)
class _Parts:
    """Rows of the three parts, all of them or those with a rough hint."""

    learned: NDArray[np.intp]
    validation: NDArray[np.intp]
    calibration: NDArray[np.intp]

    @classmethod
    def of(cls, examples: MarginExamples, recipe: MarginRecipe) -> "_Parts":
        """Split by pairs of bodies.

        Raises
        ------
        InputError
            The legs to learn from do not fill a batch.
        """
        part = split_pairs(examples.pairs, SHARES, np.random.default_rng([recipe.seed, 0]))
        parts = cls(*(np.flatnonzero(part == k) for k in range(3)))
        if len(parts.learned) < recipe.batch:
            raise InputError(
                f"margin model: {len(parts.learned)} legs to learn from, expected at least one "
                f"batch of {recipe.batch}; generate more legs"
            )
        return parts

    def rough(self, examples: MarginExamples) -> "_Parts":
        """Return the rows with a rough hint."""
        has_hint = np.isfinite(examples.quick_hint)
        return _Parts(
            *(rows[has_hint[rows]] for rows in (self.learned, self.validation, self.calibration))
        )


def _fit_nets(
    examples: MarginExamples,
    parts: _Parts,
    recipe: MarginRecipe,
    start: Artefact | None,
    checkpoint: Path | None,
    on_epoch: OnEpoch,
) -> tuple[dict[str, _Array], dict[str, _Array]]:
    """Return the arrays of the net and of the quick one."""
    net = fit_net(
        examples.X, examples.error, examples.weight, parts.learned, parts.validation, recipe,
        layers=recipe.layers, width=recipe.width, epochs=recipe.epochs,
        start=None if start is None else start.section("model"),
        checkpoint=checkpoint, on_epoch=on_epoch,
    )  # fmt: skip
    epochs = recipe.quick_epochs
    if epochs is None:
        epochs = _QUICK_EPOCHS if recipe.epochs else 0
    rough = parts.rough(examples)
    quick = fit_net(
        examples.X_quick, examples.quick_error, examples.weight, rough.learned, rough.validation,
        recipe,
        layers=_QUICK_LAYERS[0], width=_QUICK_LAYERS[1], epochs=epochs, unit=_QUICK_UNIT,
        heed_outliers=True, start=None if start is None else start.section("quick") or None,
    )  # fmt: skip
    return net, quick


def _settled(
    examples: MarginExamples, parts: _Parts, quick: dict[str, _Array], start: Artefact | None
) -> _Array:
    """Return (2,) errors of the quick net, in its own expectation, that are hardly exceeded."""
    rows = parts.rough(examples).calibration
    correction, expected = MarginNet(quick)(examples.X_quick[rows])
    residual = (correction - examples.quick_error[rows]) / expected
    settled = _SETTLED_SAFETY * np.quantile(residual, [_SETTLED_TAIL, 1.0 - _SETTLED_TAIL])
    known = {} if start is None else start.section("quick")
    if not known:
        return settled
    # Few calibration legs see few outliers: what was needed before is needed still.
    low, high = known["settled"]
    return np.array([min(settled[0], low), max(settled[1], high)])


def _domain(examples: MarginExamples, parts: _Parts, start: Artefact | None) -> dict[str, _Array]:
    """Return the ranges of the legs learned from, and of those of the model begun with."""
    quantities = np.concatenate(
        [
            domain_quantities(examples.X[parts.learned]),
            domain_quantities(examples.X_quick[parts.rough(examples).learned]),
        ]
    )
    low, high = quantities.min(axis=0), quantities.max(axis=0)
    slack = _DOMAIN_SLACK * (high - low) + 1e-9
    low, high = low - slack, high + slack
    if start is not None and start.section("quick"):
        domain = start.section("domain")
        low, high = np.minimum(low, domain["low"]), np.maximum(high, domain["high"])
    return {"low": low, "high": high}


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
