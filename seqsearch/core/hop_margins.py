"""What a predictor says of whole hops: the margin of a hop is that of its most difficult leg."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from feasibility import Legs
from feasibility.classifier.predictor import LegPredictor, QuickPredictor
from seqsearch.core.hops import Hops

Ask = Callable[[Legs], NDArray[np.float64]]
"""Tells m*/m0 of n legs, (n,); NaN where nothing is known."""


def quick_margin_of(predictor: LegPredictor) -> Ask:
    """Return the predictor's quick answers, or the others if it has none."""
    if isinstance(predictor, QuickPredictor):
        return predictor.quick_margin
    return predictor.margin


def least_margin(ask: Ask, hops: Hops) -> NDArray[np.float64]:
    """Return (n,) m*/m0 of hops: that of their most difficult leg; NaN for unknown."""
    least: NDArray[np.float64] = np.min([ask(legs) for legs in hops.legs], axis=0)
    return least


def log_margin(ask: Ask, hops: Hops) -> NDArray[np.float64]:
    """Return (n,) log(m*/m0) of hops: that of their most difficult leg; NaN for unknown."""
    return np.log(least_margin(ask, hops))
