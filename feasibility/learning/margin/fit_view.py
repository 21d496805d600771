"""The nets of a margin model for one sort of legs, with calibration and domain."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
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
from feasibility.classifier.margin.network import MarginNet
from feasibility.classifier.margin.views import LegView
from feasibility.dataset.splits import split_pairs
from feasibility.errors import InputError
from feasibility.learning.margin.examples import MarginExamples
from feasibility.learning.margin.fit import MarginRecipe, OnEpoch, fit_net

_Array = NDArray[np.float64]

SHARES: Final = (0.85, 0.05, 0.1)
"""Shares of training, validation and calibration, split by pairs of bodies."""

_QUICK_LAYERS: Final = (2, 64)
_QUICK_EPOCHS: Final = 24
_QUICK_UNIT: Final = 0.05
_MIDDLE_LAYERS: Final = (3, 128)
_MIDDLE_EPOCHS: Final = 30
_SETTLED_TAIL: Final = 1e-3
_SETTLED_SAFETY: Final = 1.05
_DOMAIN_SLACK: Final = 0.03

_LEAST_CALIBRATION: Final = 400
"""Kinds of ends with fewer calibration legs take the calibration of all."""

_LEAST_KNOWN: Final = 100
"""Kinds of ends with fewer legs to learn from are outside the domain."""

_KIND_SCORES: Final = 4000
"""Scores of a kind, so that a model's file stays small."""


@final
@dataclass(frozen=True, eq=False)
class FittedView:
    """What training gives for one sort of legs.

    Attributes
    ----------
    sections : mapping of str to mapping
        Arrays by section, without the view's prefix; none for the final mass.
    legs : mapping of str to int
        Sizes of the parts.
    metrics : mapping of str to float
        Of the calibration part.
    """

    sections: Mapping[str, Mapping[str, NDArray[Any]]]
    legs: Mapping[str, int]
    metrics: Mapping[str, float]

    def arrays(self, view: LegView) -> dict[str, NDArray[Any]]:
        """Return the arrays as a model's file names them."""
        return {
            f"{view.section(section)}/{name}": array
            for section, arrays in self.sections.items()
            for name, array in arrays.items()
        }


@final
@dataclass(frozen=True, eq=False)
class Parts:
    """Rows of the three parts, all of them or those with a rough hint."""

    learned: NDArray[np.intp]
    validation: NDArray[np.intp]
    calibration: NDArray[np.intp]

    @classmethod
    def of(cls, examples: MarginExamples, recipe: MarginRecipe) -> "Parts":
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

    def rough(self, examples: MarginExamples) -> "Parts":
        """Return the rows with a rough hint."""
        has_hint = np.isfinite(examples.quick_hint)
        return Parts(
            *(rows[has_hint[rows]] for rows in (self.learned, self.validation, self.calibration))
        )


def fit_view(
    examples: MarginExamples,
    view: LegView,
    recipe: MarginRecipe,
    start: Artefact | None,
    checkpoint: Path | None,
    on_epoch: OnEpoch,
) -> FittedView:
    """Train a large and a quick net, and find calibration, thresholds and domain.

    Parameters
    ----------
    examples : MarginExamples
        Legs as the view sees them.
    view : LegView
        Which nets.
    recipe : MarginRecipe
        How to train.
    start : Artefact, optional
        A model whose nets for this sort of legs are begun with.
    checkpoint, on_epoch
        As for `train_margin`.

    Raises
    ------
    InputError
        As for `train_margin`.
    MissingDependencyError
        The extra ``train`` is not installed.
    """
    parts = Parts.of(examples, recipe)
    known = {} if start is None else _sections_of(start, view)
    net, quick = _fit_nets(examples, parts, recipe, known, checkpoint, on_epoch)
    # Estimates of log m* and what is wrong with them: a larger acceleration is a smaller m*.
    rows = parts.calibration
    error = examples.error[rows]
    correction, expected = MarginNet(net)(examples.X[rows])
    residual = correction - error
    domain = _domain(examples, parts, view, known)
    sections = {
        "model": net,
        "quick": _with_settled(quick, examples, parts, view, known.get("quick")),
        "domain": domain,
        "calibration": calibration_of(examples.kinds[rows], view, residual, expected, recipe.seed),
    }
    middle = _fit_middle(examples, parts, view, recipe, known.get("middle"))
    if middle:
        sections["middle"] = middle
    legs = {
        "training": len(parts.learned),
        "validation": len(parts.validation),
        "calibration": len(parts.calibration),
    }
    metrics = {
        "median_absolute_log_error": float(np.median(np.abs(residual))),
        "mean_absolute_log_error": float(np.mean(np.abs(residual))),
        "hint_median_absolute_log_error": float(np.median(np.abs(error))),
    }
    return FittedView(sections, legs, metrics)


_Sections = Mapping[str, Mapping[str, NDArray[Any]]]


def _sections_of(start: Artefact, view: LegView) -> _Sections:
    names = ("model", "quick", "middle", "domain")
    sections = {name: start.section(view.section(name)) for name in names}
    return {name: arrays for name, arrays in sections.items() if arrays}


def _fit_nets(
    examples: MarginExamples,
    parts: Parts,
    recipe: MarginRecipe,
    known: _Sections,
    checkpoint: Path | None,
    on_epoch: OnEpoch,
) -> tuple[dict[str, _Array], dict[str, _Array]]:
    """Return the arrays of the net and of the quick one."""
    net = fit_net(
        examples.X, examples.error, examples.weight, parts.learned, parts.validation, recipe,
        layers=recipe.layers, width=recipe.width, epochs=recipe.epochs,
        start=known.get("model"), checkpoint=checkpoint, on_epoch=on_epoch,
    )  # fmt: skip
    epochs = recipe.quick_epochs
    if epochs is None:
        epochs = _QUICK_EPOCHS if recipe.epochs else 0
    rough = parts.rough(examples)
    quick = fit_net(
        examples.X_quick, examples.quick_error, examples.weight, rough.learned, rough.validation,
        recipe,
        layers=_QUICK_LAYERS[0], width=_QUICK_LAYERS[1], epochs=epochs, unit=_QUICK_UNIT,
        heed_outliers=True, start=known.get("quick"),
    )  # fmt: skip
    return net, quick


def _fit_middle(
    examples: MarginExamples,
    parts: Parts,
    view: LegView,
    recipe: MarginRecipe,
    known: Mapping[str, NDArray[Any]] | None,
) -> dict[str, NDArray[Any]]:
    """Return the arrays of the net between the quick one and the large one; none where not worth.

    A model that is to keep its nets gets none that it has not.
    """
    if not view.has_middle or not (recipe.epochs or known):
        return {}
    rough = parts.rough(examples)
    layers, width = _MIDDLE_LAYERS
    net = fit_net(
        examples.X_quick, examples.quick_error, examples.weight, rough.learned, rough.validation,
        recipe,
        layers=layers, width=width, epochs=_MIDDLE_EPOCHS if recipe.epochs else 0,
        unit=_QUICK_UNIT, heed_outliers=True, start=known,
    )  # fmt: skip
    return _with_settled(net, examples, parts, view, known)


def add_middle(
    artefact: Artefact, examples: MarginExamples, view: LegView, recipe: MarginRecipe
) -> Artefact:
    """Return a model with a new middle net for one sort of legs; all else stays.

    Raises
    ------
    InputError
        As for `fit_view`.
    MissingDependencyError
        The extra ``train`` is not installed.
    """
    found = _fit_middle(examples, Parts.of(examples, recipe), view, recipe, None)
    prefix = f"{view.section('middle')}/"
    kept = {name: array for name, array in artefact.arrays.items() if not name.startswith(prefix)}
    arrays = {**kept, **{f"{prefix}{name}": array for name, array in found.items()}}
    return replace(artefact, arrays=arrays)


def _with_settled(
    net: Mapping[str, NDArray[Any]],
    examples: MarginExamples,
    parts: Parts,
    view: LegView,
    known: Mapping[str, NDArray[Any]] | None,
) -> dict[str, NDArray[Any]]:
    """Return a net for the quick features with the errors beyond which a leg is settled."""
    rows = parts.rough(examples).calibration
    correction, expected = MarginNet(net)(examples.X_quick[rows])
    residual = correction - examples.quick_error[rows]
    settled = _by_kind(view, examples.kinds[rows], residual / expected, _settled)
    return {**net, "settled": _no_narrower(settled, known)}


def _by_kind(
    view: LegView,
    kinds: NDArray[np.intp],
    values: _Array,
    measure: Callable[[_Array], _Array],
) -> _Array:
    """Return a measure of the values, one row a kind where there are kinds."""
    if not view.kinds:
        return measure(values)
    rows = [_rows_of_kind(kinds, number) for number in range(len(view.kinds))]
    return np.array([measure(values[some]) for some in rows])


def _rows_of_kind(kinds: NDArray[np.intp], number: int) -> NDArray[np.intp]:
    rows = np.flatnonzero(kinds == number)
    return rows if len(rows) >= _LEAST_CALIBRATION else np.arange(len(kinds))


def _settled(residual: _Array) -> _Array:
    """Return (2,) errors of the quick net, in its own expectation, that are hardly exceeded."""
    return _SETTLED_SAFETY * np.quantile(residual, [_SETTLED_TAIL, 1.0 - _SETTLED_TAIL])


def _no_narrower(settled: _Array, known: Mapping[str, NDArray[Any]] | None) -> _Array:
    """Return the thresholds, or those of the model begun with where these are wider.

    Few calibration legs see few outliers: what was needed before is needed still.
    """
    if known is None:
        return settled
    before = known["settled"]
    return np.stack(
        [
            np.minimum(settled[..., 0], before[..., 0]),
            np.maximum(settled[..., 1], before[..., 1]),
        ],
        axis=-1,
    )


def calibration_of(
    kinds: NDArray[np.intp], view: LegView, residual: _Array, expected: _Array, seed: int
) -> dict[str, _Array]:
    """Return the arrays of the calibration, with one row a kind where there are kinds."""
    if not view.kinds:
        table = fit_calibration(residual, expected)
        scores = boundary_scores(
            Calibration(table), residual, expected, np.random.default_rng([seed, 1])
        )
        return {**table, "positive_scores": scores}
    found = []
    for number in range(len(view.kinds)):
        rows = _rows_of_kind(kinds, number)
        table = fit_calibration(residual[rows], expected[rows])
        rng = np.random.default_rng([seed, 1, number])
        scores = boundary_scores(Calibration(table), residual[rows], expected[rows], rng)
        picked = np.linspace(0, len(scores) - 1, _KIND_SCORES).astype(np.int64)
        found.append({**table, "positive_scores": scores[picked]})
    return {name: np.array([one[name] for one in found]) for name in found[0]}


def _domain(
    examples: MarginExamples, parts: Parts, view: LegView, known: _Sections
) -> dict[str, NDArray[Any]]:
    """Return the ranges of the legs learned from, and of those of the model begun with."""
    quantities = np.concatenate(
        [
            view.domain_quantities(examples.X[parts.learned]),
            view.domain_quantities(examples.X_quick[parts.rough(examples).learned]),
        ]
    )
    low, high = quantities.min(axis=0), quantities.max(axis=0)
    slack = _DOMAIN_SLACK * (high - low) + 1e-9
    low, high = low - slack, high + slack
    before = known.get("domain") if "quick" in known else None
    if before is not None:
        low, high = np.minimum(low, before["low"]), np.maximum(high, before["high"])
    found: dict[str, NDArray[Any]] = {"low": low, "high": high}
    if view.kinds:
        count = np.bincount(examples.kinds[parts.learned], minlength=len(view.kinds))
        seen = count >= _LEAST_KNOWN
        found["kinds"] = seen if before is None else seen | before["kinds"]
        found["feature_set"] = np.array(view.feature_set)
    return found
