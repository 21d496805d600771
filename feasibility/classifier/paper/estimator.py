"""`PaperEstimator`: a model with the paper's features, asked about legs."""

import functools
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.artefact import Artefact
from feasibility.classifier.paper.features import FEATURE_SET, FEATURES, paper_features
from feasibility.classifier.paper.predictors import Predictor, make_predictor
from feasibility.classifier.paper.standardise import Standardiser
from feasibility.constants import MU_SUN
from feasibility.errors import InputError
from feasibility.legs import Legs

_LEGS_AT_A_TIME: Final = 8192
"""Bounds the memory: 103 features and the widest layer of this many legs."""

_UNKNOWN: Final = 0.5
"""Probability where the features do not exist, so that nothing is known."""


@final
class PaperEstimator:
    """Asks one of the five models of the paper; it was trained for one engine.

    Parameters
    ----------
    artefact : Artefact
        The trained model.

    Raises
    ------
    InputError
        The artefact has features or a kind of model that this version does not know.
    """

    def __init__(self, artefact: Artefact) -> None:
        if artefact.feature_set != FEATURE_SET:
            raise InputError(
                f"model with features {artefact.feature_set!r}: unknown, expected {FEATURE_SET!r}"
            )
        names = [feature.name for feature in FEATURES]
        unknown = [name for name in artefact.features if name not in names]
        if unknown:
            raise InputError(f"model with feature {unknown[0]!r}: not in {FEATURE_SET!r}")
        self._artefact = artefact
        self._columns = np.array([names.index(name) for name in artefact.features])
        scaler, domain = artefact.section("scaler"), artefact.section("domain")
        try:
            self._scaler = Standardiser(scaler["mean"], scaler["std"])
            self._low, self._high = domain["low"], domain["high"]
            self._isp, self._thrust = domain["isp"], float(domain["thrust"].mean())
        except KeyError as error:
            raise InputError(f"model: array {error} is missing") from None

    def assess(self, legs: Legs) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return (n,) the probabilities of feasibility and whether the legs are in the domain."""
        probability = np.full(len(legs), _UNKNOWN)
        inside = np.zeros(len(legs), dtype=np.bool_)
        # The paper's features know nothing of free ends.
        bound = np.flatnonzero(_bound(legs.rv_dep) & _bound(legs.rv_arr) & ~legs.free_ends)
        for first in range(0, len(bound), _LEGS_AT_A_TIME):
            rows = bound[first : first + _LEGS_AT_A_TIME]
            probability[rows], inside[rows] = self._assess_bound(legs.take(rows))
        return probability, inside

    @functools.cached_property
    def _predict(self) -> Predictor:
        try:
            return make_predictor(self._artefact.kind, self._artefact.section("model"))
        except KeyError as error:
            raise InputError(f"model of kind {self._artefact.kind!r}: {error} unknown") from None

    def _assess_bound(self, legs: Legs) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        X = self._features(legs)
        inside = ((self._low <= X) & (self._high >= X)).all(axis=1)
        inside &= (self._isp[0] <= legs.isp) & (legs.isp <= self._isp[1])
        return self._predict(self._scaler.transform(X)), inside

    def _features(self, legs: Legs) -> NDArray[np.float64]:
        """Return the model's inputs (n, k); the costly ones only where they are among them."""
        unused = np.zeros(len(legs))
        features = paper_features(
            legs,
            dt_imp_days=None if "dt_imp" in self._artefact.features else unused,
            lambert_dv=None if "lambert_dv" in self._artefact.features else unused,
        )
        features[:, 0] *= self._thrust / legs.thrust
        return features[:, self._columns]


def _bound(states: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return (n,) whether a state has classical and equinoctial elements."""
    radius = np.linalg.norm(states[:, :3], axis=1)
    momentum = np.cross(states[:, :3], states[:, 3:])
    size = np.linalg.norm(momentum, axis=1)
    energy = 0.5 * np.einsum("ij,ij->i", states[:, 3:], states[:, 3:]) - MU_SUN / radius
    e2 = 1.0 + 2.0 * energy * (size / MU_SUN) ** 2
    bound: NDArray[np.bool_] = (
        (energy < 0.0) & (size > 0.0) & (e2 < 1.0 - 1e-12) & (momentum[:, 2] > -size * (1 - 1e-12))
    )
    return bound
