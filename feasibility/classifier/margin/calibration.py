"""From an estimated margin to a probability: what the errors on other legs were."""

from collections.abc import Mapping
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

_Array = NDArray[np.float64]

CERTAIN: Final = 1e-6
"""Probabilities stay this far from 0 and 1."""

_N_QUANTILES: Final = 1001
_NEAR: Final = 0.05
_DRAWS: Final = 4
_MAX_SCORES: Final = 20_000


@final
class Calibration:
    """Distribution of r = (true log margin - estimate) / expected error on calibration legs.

    The leg is feasible where the true log margin is at least 0, so the
    probability is the share of r at or above -estimate / expected error. That is
    monotone in the estimate, whatever the legs.

    Parameters
    ----------
    arrays : mapping of str to array
        ``levels`` and ``quantiles`` (q,): shares, rising, and the r below which they lie.
    """

    def __init__(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        self._levels = np.asarray(arrays["levels"], dtype=np.float64)
        self._quantiles = np.asarray(arrays["quantiles"], dtype=np.float64)

    def probability(self, log_margin: _Array, error: _Array) -> _Array:
        """Return (n,) the probability of feasibility, strictly between 0 and 1."""
        ratio = -log_margin / error
        below = np.interp(ratio, self._quantiles, self._levels)
        # Beyond the quantiles the tails fall exponentially, as slowly as from their last tenth.
        first, last = self._quantiles[0], self._quantiles[-1]
        low, high = self._levels[0], 1.0 - self._levels[-1]
        spread = 0.25 * (last - first)
        with np.errstate(over="ignore"):
            below = np.where(ratio < first, low * np.exp((ratio - first) / spread), below)
            above = np.where(ratio > last, high * np.exp((last - ratio) / spread), 1.0 - below)
        return np.clip(above, CERTAIN, 1.0 - CERTAIN)


def fit_calibration(residual: _Array, error: _Array) -> dict[str, _Array]:
    """Return the arrays of `Calibration`.

    Parameters
    ----------
    residual, error : (n,) float64
        True minus estimated log margin, and the expected error, of legs not trained on.
    """
    ratio = residual / error
    outermost = 0.5 / len(ratio)
    tails = np.geomspace(outermost, 0.01, 40)
    middle = np.linspace(0.01, 0.99, _N_QUANTILES)
    levels = np.unique(np.concatenate([tails, middle, 1.0 - tails]))
    return {"levels": levels, "quantiles": np.quantile(ratio, levels)}


def boundary_scores(
    calibration: Calibration, residual: _Array, error: _Array, rng: np.random.Generator
) -> _Array:
    """Return rising probabilities of feasible legs near the boundary, as on good tours.

    Each calibration leg gets initial masses with log(m* / m0) half normal of
    standard deviation 0.05: a threshold for a recall among such legs keeps
    more of legs with ampler margins.

    Parameters
    ----------
    residual, error : (n,) float64
        As for `fit_calibration`.
    """
    true = np.abs(_NEAR * rng.standard_normal((_DRAWS, len(residual))))
    scores = calibration.probability((true - residual).reshape(-1), np.tile(error, _DRAWS))
    scores = np.sort(scores)
    if len(scores) > _MAX_SCORES:
        scores = scores[np.linspace(0, len(scores) - 1, _MAX_SCORES).astype(np.int64)]
    return scores
