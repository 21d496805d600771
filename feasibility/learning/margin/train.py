"""From datasets to a margin model: one program, to be read from top to bottom."""

from collections.abc import Sequence
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
from feasibility.classifier.margin.features import (
    FEATURE_SET,
    FEATURES,
    domain_quantities,
    log_acceleration,
    margin_features,
    quick_features,
)
from feasibility.classifier.margin.network import MarginNet
from feasibility.dataset import Dataset
from feasibility.dataset.splits import pairs_of_bodies, split_pairs
from feasibility.errors import InputError
from feasibility.learning.margin.fit import MarginEpoch, MarginRecipe, OnEpoch, fit_net
from feasibility.runtime.provenance import provenance

_Array = NDArray[np.float64]

__all__ = ["SHARES", "MarginEpoch", "MarginExamples", "MarginRecipe", "OnEpoch", "train_margin"]

SHARES: Final = (0.85, 0.05, 0.1)
"""Shares of training, validation and calibration, split by pairs of bodies."""

_RELEVANT: Final = 0.6
"""Legs whose own margin is beyond this are learned with `_FAR_WEIGHT`: their m* hardly matters."""

_FAR_WEIGHT: Final = 0.25
_QUICK_LAYERS: Final = (2, 64)
_QUICK_EPOCHS: Final = 24
_QUICK_UNIT: Final = 0.05
_SETTLED_TAIL: Final = 1e-3
_SETTLED_SAFETY: Final = 1.05
_DOMAIN_SLACK: Final = 0.03


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

        Raises
        ------
        InputError
            A dataset was not labelled by margin.
        """
        parts = []
        for dataset, pairs in zip(datasets, pairs_of_bodies(datasets), strict=True):
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
            parts.append(
                {
                    "X": X[known],
                    "hint": hint[known],
                    "X_quick": X_quick[known],
                    "quick_hint": quick_hint[known],
                    "target": target[known],
                    "weight": np.where(relevant, 1.0, _FAR_WEIGHT)[known],
                    "pairs": pairs[known],
                }
            )
        whole = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
        return cls(**whole)


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
    first_net, first_quick = (
        (None, None) if start is None else (start.section("model"), start.section("quick") or None)
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
    net = fit_net(
        examples.X, error, examples.weight, learned, validation, recipe,
        layers=recipe.layers, width=recipe.width, epochs=recipe.epochs,
        start=first_net, checkpoint=checkpoint, on_epoch=note,
    )  # fmt: skip
    quick_epochs = recipe.quick_epochs
    if quick_epochs is None:
        quick_epochs = _QUICK_EPOCHS if recipe.epochs else 0
    rough = np.isfinite(examples.quick_hint)
    quick_error = examples.target - examples.quick_hint
    quick = fit_net(
        examples.X_quick, quick_error, examples.weight, learned[rough[learned]],
        validation[rough[validation]], recipe,
        layers=_QUICK_LAYERS[0], width=_QUICK_LAYERS[1],
        epochs=quick_epochs, unit=_QUICK_UNIT, heed_outliers=True, start=first_quick,
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
    final_mass = {} if start is None else start.section("final_mass")
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
            **{f"final_mass/{name}": array for name, array in final_mass.items()},
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
