"""`MarginEstimator`: a trained margin model, asked about legs; needs no torch."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.artefact import Artefact
from feasibility.classifier.margin.calibration import CERTAIN, Calibration
from feasibility.classifier.margin.features import (
    FEATURE_SET,
    FEATURES,
    domain_quantities,
    log_acceleration,
    margin_features,
    quick_features,
)
from feasibility.classifier.margin.final_mass import AS_IT_SAYS, final_mass
from feasibility.classifier.margin.network import MarginNet
from feasibility.classifier.margin.prediction import LegPrediction
from feasibility.errors import InputError
from feasibility.legs import Legs

_Array = NDArray[np.float64]

_UNKNOWN: Final = 0.5
"""Probability where no features exist, so that nothing is known."""

_LEGS_AT_A_TIME: Final = 4096
"""Legs whose features are in the processor's cache at a time; the work of one thread."""


@final
class MarginEstimator:
    """Estimates log(m* / m0) of legs and how likely it is to be 0 or more.

    Two nets: the quick one settles legs far from the boundary, the other one looks at the
    rest. The settled ones get the probabilities at the ends of the scale, so that a heavier
    spacecraft is never more feasible.

    Parameters
    ----------
    artefact : Artefact
        A model of kind "margin".

    Raises
    ------
    InputError
        The artefact has other features than this version, or an array is missing.
    """

    def __init__(self, artefact: Artefact) -> None:
        if artefact.feature_set != FEATURE_SET or artefact.features != FEATURES:
            raise InputError(
                f"model with features {artefact.feature_set!r}: unknown, expected {FEATURE_SET!r}"
            )
        quick, domain = artefact.section("quick"), artefact.section("domain")
        try:
            self._net = MarginNet(artefact.section("model"))
            self._quick = MarginNet(quick)
            self._settled_low, self._settled_high = (float(v) for v in quick["settled"])
            self._calibration = Calibration(artefact.section("calibration"))
            self._low, self._high = domain["low"], domain["high"]
            mass = artefact.section("final_mass")
            self._final_mass = MarginNet(mass) if mass else None
            # Models of older versions were not calibrated.
            self._error_fit = np.asarray(mass.get("error_fit", AS_IT_SAYS), dtype=np.float64)
        except KeyError as error:
            raise InputError(f"model: array {error} is missing") from None

    def assess(self, legs: Legs, threads: int = 1) -> tuple[_Array, NDArray[np.bool_]]:
        """Return (n,) the probabilities of feasibility and whether the legs are in the domain.

        The answers are the same, bit by bit, for any number of threads.
        """
        n = len(legs)
        probability = np.full(n, _UNKNOWN)
        inside = np.zeros(n, dtype=np.bool_)
        known = np.zeros(n, dtype=np.bool_)
        open_ = np.zeros(n, dtype=np.bool_)

        def settle(rows: NDArray[np.intp]) -> None:
            probability[rows], inside[rows], known[rows], open_[rows] = self._settle(
                legs.take(rows)
            )

        def look(rows: NDArray[np.intp]) -> None:
            log_margin, doubt, near = self.estimate(legs.take(rows))
            estimated = np.isfinite(log_margin)
            p = np.full(len(rows), _UNKNOWN)
            p[estimated] = self._calibration.probability(log_margin[estimated], doubt[estimated])
            probability[rows] = p
            # By the quick features wherever they exist, as the mass must not decide which.
            inside[rows] = np.where(known[rows], inside[rows], near)

        _in_blocks(settle, np.arange(n), threads)
        _in_blocks(look, np.flatnonzero(open_), threads)
        return probability, inside

    def _settle(
        self, legs: Legs
    ) -> tuple[_Array, NDArray[np.bool_], NDArray[np.bool_], NDArray[np.bool_]]:
        """Return what the quick net knows.

        Probability (1 or 0, nearly, where settled), whether in the domain, whether there are
        quick features at all, and whether the other net has to look.
        """
        X, hint = quick_features(legs)
        known = np.isfinite(hint)
        if known.all():
            correction, error = self._quick(X)
            inside = self._inside(X)
        else:
            rows = np.flatnonzero(known)
            correction, error = np.zeros(len(legs)), np.full(len(legs), np.nan)
            inside = np.zeros(len(legs), dtype=np.bool_)
            correction[rows], error[rows] = self._quick(X[rows])
            inside[rows] = self._inside(X[rows])
        ratio = (log_acceleration(legs, legs.m0) - hint - correction) / error
        feasible = ratio > -self._settled_low
        infeasible = ratio < -self._settled_high
        probability = np.where(feasible, 1.0 - CERTAIN, CERTAIN)
        return probability, inside, known, ~(feasible | infeasible)

    def estimate(self, legs: Legs) -> tuple[_Array, _Array, NDArray[np.bool_]]:
        """Return (n,) log(m* / m0), its expected error, and whether the legs are in the domain.

        NaN where no features exist.
        """
        return self._estimate(legs, *margin_features(legs))

    def _estimate(
        self, legs: Legs, X: _Array, hint: _Array
    ) -> tuple[_Array, _Array, NDArray[np.bool_]]:
        log_margin = np.full(len(legs), np.nan)
        doubt = np.full(len(legs), np.nan)
        inside = np.zeros(len(legs), dtype=np.bool_)
        rows = np.flatnonzero(np.isfinite(hint))
        correction, doubt[rows] = self._net(X[rows])
        log_margin[rows] = log_acceleration(legs, legs.m0)[rows] - hint[rows] - correction
        inside[rows] = self._inside(X[rows])
        return log_margin, doubt, inside

    def quick_log_margin(self, legs: Legs) -> _Array:
        """Return (n,) log(m* / m0) by the quick net; NaN without features or out of the domain."""
        X, hint = quick_features(legs)
        log_margin = np.full(len(legs), np.nan)
        rows = np.flatnonzero(np.isfinite(hint))
        rows = rows[self._inside(X[rows])]
        correction, _ = self._quick(X[rows])
        log_margin[rows] = log_acceleration(legs, legs.m0)[rows] - hint[rows] - correction
        return log_margin

    def predict(self, legs: Legs) -> LegPrediction:
        """Return all answers for n legs from one computation of their features."""
        X, hint = margin_features(legs)
        log_margin, doubt, inside = self._estimate(legs, X, hint)
        rows = np.flatnonzero(np.isfinite(log_margin))
        probability = np.full(len(legs), _UNKNOWN)
        probability[rows] = self._calibration.probability(log_margin[rows], doubt[rows])
        mass, error = np.full(len(legs), np.nan), np.full(len(legs), np.nan)
        known = (legs, X, log_margin, doubt)
        if len(rows) < len(legs):
            known = (legs.take(rows), X[rows], log_margin[rows], doubt[rows])
        mass[rows], error[rows] = final_mass(*known, self._final_mass, self._error_fit)
        return LegPrediction(
            margin=np.exp(log_margin),
            margin_error=doubt,
            probability=probability,
            final_mass=mass,
            final_mass_error=error,
            in_domain=inside,
        )

    def _inside(self, X: _Array) -> NDArray[np.bool_]:
        quantities = domain_quantities(X)
        inside = (self._low <= quantities) & (quantities <= self._high)
        return np.asarray(inside.all(axis=1))


def _in_blocks(
    work: Callable[[NDArray[np.intp]], None], rows: NDArray[np.intp], threads: int
) -> None:
    """Do the work on blocks of rows; numpy and the kernels let other threads run meanwhile."""
    blocks = [
        rows[first : first + _LEGS_AT_A_TIME] for first in range(0, len(rows), _LEGS_AT_A_TIME)
    ]
    if threads == 1 or len(blocks) < 2:
        for block in blocks:
            work(block)
        return
    with ThreadPoolExecutor(min(threads, len(blocks))) as pool:
        for _ in pool.map(work, blocks):
            pass
