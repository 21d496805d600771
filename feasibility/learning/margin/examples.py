"""`MarginExamples`: solved legs as the nets of a margin model see them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.margin.features import (
    log_acceleration,
    margin_features,
    quick_features,
)
from feasibility.dataset import Dataset
from feasibility.dataset.splits import pairs_of_bodies
from feasibility.errors import InputError

_Array = NDArray[np.float64]

_RELEVANT: Final = 0.6
"""Legs whose own margin is beyond this are learned with `_FAR_WEIGHT`: their m* hardly matters."""

_FAR_WEIGHT: Final = 0.25


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
            A dataset was not labelled by margin, or has legs with free ends.
        """
        parts = []
        for dataset, pairs in zip(datasets, pairs_of_bodies(datasets), strict=True):
            label = dataset.metadata["protocol"]["label"]
            if label != "margin":
                raise InputError(f"margin model: a dataset is labelled by {label}, not by margin")
            dataset.check_rendezvous("margin model")
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

    @property
    def error(self) -> _Array:
        """(n,) how much the target is above the hint."""
        return self.target - self.hint

    @property
    def quick_error(self) -> _Array:
        """(n,) how much the target is above the quick hint."""
        return self.target - self.quick_hint
