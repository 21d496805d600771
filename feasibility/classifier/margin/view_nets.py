"""`ViewNets`: the nets of a margin model for one sort of legs, asked about such legs."""

from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.artefact import Artefact
from feasibility.classifier.margin.calibration import CERTAIN, Calibration
from feasibility.classifier.margin.final_mass import AS_IT_SAYS, final_mass
from feasibility.classifier.margin.network import MarginNet
from feasibility.classifier.margin.prediction import LegPrediction
from feasibility.classifier.margin.views import LegView
from feasibility.errors import InputError
from feasibility.legs import Legs

_Array = NDArray[np.float64]

UNKNOWN: Final = 0.5
"""Probability where no features exist, so that nothing is known."""


@final
class ViewNets:
    """A large net, a quick one, their calibration and domain, and the net for the final mass.

    Some models have a middle one too, which sees what the quick one sees, knows more and is asked
    about what that one leaves open.

    Parameters
    ----------
    artefact : Artefact
        A model of kind "margin".
    view : LegView
        Which of its nets, and what they see.

    Raises
    ------
    InputError
        The nets were trained with other features than this version has.
    KeyError
        An array is missing.
    """

    def __init__(self, artefact: Artefact, view: LegView) -> None:
        self._view = view
        quick, domain, calibration, mass = (
            artefact.section(view.section(name))
            for name in ("quick", "domain", "calibration", "final_mass")
        )
        self._net = MarginNet(artefact.section(view.section("model")))
        self._quick = MarginNet(quick)
        self._low, self._high = domain["low"], domain["high"]
        self._final_mass = MarginNet(mass) if mass else None
        # Models of older versions were not calibrated.
        self._error_fit = np.asarray(mass.get("error_fit", AS_IT_SAYS), dtype=np.float64)
        if view.kinds:
            _check_feature_set(str(domain["feature_set"]), view)
        # The quick net and those after it, each with a row a kind, where there are kinds.
        middle = artefact.section(view.section("middle"))
        settled = np.asarray(quick["settled"], dtype=np.float64).reshape(-1, 2)
        self._settling = [(self._quick, settled)]
        if middle:
            bounds = np.asarray(middle["settled"], dtype=np.float64).reshape(-1, 2)
            self._settling.append((MarginNet(middle), bounds))
        self._known_kinds = np.asarray(domain.get("kinds", [True]), dtype=np.bool_)
        levels = calibration["levels"].reshape(len(settled), -1)
        quantiles = calibration["quantiles"].reshape(len(settled), -1)
        self._calibrations = [
            Calibration({"levels": one, "quantiles": other})
            for one, other in zip(levels, quantiles, strict=True)
        ]

    def settle(
        self, legs: Legs
    ) -> tuple[_Array, NDArray[np.bool_], NDArray[np.bool_], NDArray[np.bool_]]:
        """Return what the quick net knows, and the middle one.

        Probability (1 or 0, nearly, where settled), whether in the domain, whether there are
        quick features at all, and whether the other net has to look.
        """
        X, hint = self._view.quick_features(legs)
        kinds = self._kinds(legs)
        known = np.isfinite(hint)
        probability = np.full(len(legs), CERTAIN)
        inside = known & self._inside(X, kinds)
        excess = self._view.log_acceleration(legs, legs.m0) - hint
        rows = np.flatnonzero(known)
        for number, (net, settled) in enumerate(self._settling):
            if not len(rows):
                break
            # The first one is asked about all, as a copy of most costs more than a few in vain.
            correction, error = net(X if number == 0 else X[rows])
            if number == 0 and len(rows) < len(X):
                correction, error = correction[rows], error[rows]
            ratio = (excess[rows] - correction) / error
            low, high = settled[0 if kinds is None else kinds[rows]].T
            feasible = ratio > -low
            probability[rows[feasible]] = 1.0 - CERTAIN
            rows = rows[~(feasible | (ratio < -high))]
        open_ = ~known
        open_[rows] = True
        return probability, inside, known, open_

    def look(self, legs: Legs) -> tuple[_Array, NDArray[np.bool_]]:
        """Return (n,) probabilities by the large net, and whether in the domain."""
        log_margin, doubt, inside = self.estimate(legs)
        return self._probability(legs, log_margin, doubt), inside

    def estimate(self, legs: Legs) -> tuple[_Array, _Array, NDArray[np.bool_]]:
        """Return (n,) log(m* / m0), its expected error, and whether the legs are in the domain.

        NaN where no features exist.
        """
        return self._estimate(legs, *self._view.features(legs))

    def quick_log_margin(self, legs: Legs) -> _Array:
        """Return (n,) log(m* / m0) by the quick net; NaN without features or out of the domain."""
        X, hint = self._view.quick_features(legs)
        log_margin = np.full(len(legs), np.nan)
        rows = np.flatnonzero(np.isfinite(hint))
        rows = rows[self._inside(X[rows], _some(self._kinds(legs), rows))]
        correction, _ = self._quick(X[rows])
        acceleration = self._view.log_acceleration(legs, legs.m0)
        log_margin[rows] = acceleration[rows] - hint[rows] - correction
        return log_margin

    def predict(self, legs: Legs) -> LegPrediction:
        """Return all answers for n legs from one computation of their features."""
        X, hint, more = self._view.features_and_more(legs)
        log_margin, doubt, inside = self._estimate(legs, X, hint)
        rows = np.flatnonzero(np.isfinite(log_margin))
        mass, error = np.full(len(legs), np.nan), np.full(len(legs), np.nan)
        known = (legs, X, log_margin, doubt)
        if len(rows) < len(legs):
            known = (legs.take(rows), X[rows], log_margin[rows], doubt[rows])
            more = more[rows]
        mass[rows], error[rows] = final_mass(
            *known, self._final_mass, self._error_fit, self._view.mass_inputs,
            self._view.lambert_velocity, more,
        )  # fmt: skip
        return LegPrediction(
            margin=np.exp(log_margin),
            margin_error=doubt,
            probability=self._probability(legs, log_margin, doubt),
            final_mass=mass,
            final_mass_error=error,
            in_domain=inside,
        )

    def _estimate(
        self, legs: Legs, X: _Array, hint: _Array
    ) -> tuple[_Array, _Array, NDArray[np.bool_]]:
        log_margin = np.full(len(legs), np.nan)
        doubt = np.full(len(legs), np.nan)
        inside = np.zeros(len(legs), dtype=np.bool_)
        rows = np.flatnonzero(np.isfinite(hint))
        correction, doubt[rows] = self._net(X[rows])
        acceleration = self._view.log_acceleration(legs, legs.m0)
        log_margin[rows] = acceleration[rows] - hint[rows] - correction
        inside[rows] = self._inside(X[rows], _some(self._kinds(legs), rows))
        return log_margin, doubt, inside

    def _probability(self, legs: Legs, log_margin: _Array, doubt: _Array) -> _Array:
        probability = np.full(len(legs), UNKNOWN)
        kinds = self._kinds(legs)
        estimated = np.isfinite(log_margin)
        for number, calibration in enumerate(self._calibrations):
            rows = np.flatnonzero(estimated if kinds is None else estimated & (kinds == number))
            if len(rows):
                probability[rows] = calibration.probability(log_margin[rows], doubt[rows])
        return probability

    def _kinds(self, legs: Legs) -> NDArray[np.intp] | None:
        """Return (n,) the legs' kinds, None where there is but one."""
        return self._view.kinds_of(legs) if self._view.kinds else None

    def _inside(self, X: _Array, kinds: NDArray[np.intp] | None) -> NDArray[np.bool_]:
        inside = np.ones(len(X), dtype=np.bool_)
        # One after the other: three times as fast as all rows at once.
        for low, high, values in zip(
            self._low, self._high, self._view.domain_quantities(X).T, strict=True
        ):
            inside &= (low <= values) & (values <= high)
        return np.asarray(inside if kinds is None else inside & self._known_kinds[kinds])


def _check_feature_set(name: str, view: LegView) -> None:
    if name != view.feature_set:
        raise InputError(f"model with features {name!r}: unknown, expected {view.feature_set!r}")


def _some(kinds: NDArray[np.intp] | None, rows: NDArray[np.intp]) -> NDArray[np.intp] | None:
    return None if kinds is None else kinds[rows]
