"""`MarginExamples`: solved legs as the nets of a margin model see them."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.margin.views import RENDEZVOUS, LegView
from feasibility.dataset import Dataset
from feasibility.dataset.splits import pairs_of_bodies
from feasibility.errors import InputError
from feasibility.legs import Legs

_Array = NDArray[np.float64]

RELEVANT: Final = 0.6
"""Legs whose own margin is beyond this are learned with `FAR_WEIGHT`: their m* hardly matters."""

FAR_WEIGHT: Final = 0.25


@final
@dataclass(frozen=True, eq=False)
class MarginExamples:
    """Solved legs as the nets see them; n of them.

    Attributes
    ----------
    X, hint : (n, k), (n,) float64
        Features of the view.
    X_quick, quick_hint : (n, q), (n,) float64
        Its quick features; the hint is NaN where there is none.
    target : (n,) float64
        Logarithm of the acceleration at m*, in the unit of the view; at least the least of all
        hints, as legs with free ends may need no thrust at all.
    weight : (n,) float64
        How much a leg counts.
    pairs : (n,) int64
        Number of the unordered pair of bodies.
    kinds : (n,) intp
        Number of the leg's kind of ends.
    """

    X: _Array
    hint: _Array
    X_quick: _Array
    quick_hint: _Array
    target: _Array
    weight: _Array
    pairs: NDArray[np.int64]
    kinds: NDArray[np.intp]

    @classmethod
    def of(cls, datasets: Sequence[Dataset], view: LegView = RENDEZVOUS) -> "MarginExamples":
        """Compute features and targets of all legs of a sort with a known m*.

        Raises
        ------
        InputError
            A dataset was not labelled by margin, or has no leg of the sort.
        """
        parts = []
        for dataset, pairs in zip(datasets, pairs_of_bodies(datasets), strict=True):
            label = dataset.metadata["protocol"]["label"]
            if label != "margin":
                raise InputError(f"margin model: a dataset is labelled by {label}, not by margin")
            parts.append(cls.of_legs(dataset.legs, dataset.columns["m_star_kg"], pairs, view))
        return cls.concatenate(parts)

    @classmethod
    def concatenate(cls, parts: Sequence["MarginExamples"]) -> "MarginExamples":
        """Return all examples of one or more parts in order."""
        names = [field.name for field in fields(cls)]
        return cls(**{n: np.concatenate([getattr(part, n) for part in parts]) for n in names})

    @classmethod
    def of_legs(
        cls,
        legs: Legs,
        m_star: _Array,
        pairs: NDArray[np.int64],
        view: LegView,
        *,
        quick: bool = True,
    ) -> "MarginExamples":
        """Compute features and targets of those of some legs whose m* (n,) in kg is known.

        Without the `quick` features there are none of these, and no quick hint.
        """
        X, hint = view.features(legs)
        X_quick, quick_hint = np.empty((len(legs), 0)), np.full(len(legs), np.nan)
        if quick:
            X_quick, quick_hint = view.quick_features(legs)
        with np.errstate(divide="ignore", invalid="ignore"):
            target = view.log_acceleration(legs, m_star)
            relevant = np.abs(np.log(m_star / legs.m0)) < RELEVANT
        target = np.maximum(target, view.least())
        known = np.isfinite(target) & np.isfinite(hint)
        return cls(
            X=X[known],
            hint=hint[known],
            X_quick=X_quick[known],
            quick_hint=quick_hint[known],
            target=target[known],
            weight=np.where(relevant, 1.0, FAR_WEIGHT)[known],
            pairs=pairs[known],
            kinds=view.kinds_of(legs)[known],
        )

    @property
    def error(self) -> _Array:
        """(n,) how much the target is above the hint."""
        return self.target - self.hint

    @property
    def quick_error(self) -> _Array:
        """(n,) how much the target is above the quick hint."""
        return self.target - self.quick_hint


def legs_of(datasets: Sequence[Dataset], view: LegView) -> list[Dataset]:
    """Return the legs of one sort, without datasets that have none."""
    parts = []
    for dataset in datasets:
        rows = view.rows_of(dataset.legs)
        if len(rows) == len(dataset):
            parts.append(dataset)
        elif len(rows):
            parts.append(dataset.take(rows))
    return parts
