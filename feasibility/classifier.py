"""`FeasibilityClassifier`: a trained model, asked about legs.

Loading and asking need neither torch nor scikit-learn.
"""

import functools
from pathlib import Path
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.constants import MU_SUN
from feasibility.errors import InputError
from feasibility.learning.artefact import Artefact
from feasibility.learning.features import FEATURE_SET, FEATURES, paper_features
from feasibility.learning.inference import Predictor, make_predictor
from feasibility.learning.standardise import Standardiser
from feasibility.legs import Legs

_LEGS_AT_A_TIME: Final = 8192
"""Bounds the memory: 103 features and the widest layer of so many legs."""

_UNKNOWN: Final = 0.5
"""Probability where the features do not exist, so that nothing is known."""


@final
class FeasibilityClassifier:
    """Tells how likely it is that legs can be flown.

    With n the number of legs. The model was trained for one engine; as only
    thrust over mass enters the motion, a leg with another thrust is asked about
    with its mass in proportion. Another specific impulse is outside the domain.

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
        self.artefact = artefact
        self._columns = np.array([names.index(name) for name in artefact.features])
        scaler, domain = artefact.section("scaler"), artefact.section("domain")
        try:
            self._scaler = Standardiser(scaler["mean"], scaler["std"])
            self._low, self._high = domain["low"], domain["high"]
            self._isp, self._thrust = domain["isp"], float(domain["thrust"].mean())
            self._positive = artefact.section("calibration")["positive_scores"]
        except KeyError as error:
            raise InputError(f"model: array {error} is missing") from None

    def __reduce__(self) -> tuple[Any, ...]:
        """Travel to worker processes as the artefact alone."""
        return FeasibilityClassifier, (self.artefact,)

    @classmethod
    def load(cls, path: str | Path) -> "FeasibilityClassifier":
        """Read a model that ``feasibility train`` wrote.

        Raises
        ------
        InputError
            No such file, damaged or changed, or written by a newer version.
        """
        return cls(Artefact.load(Path(path)))

    def feasible_probability(self, legs: Legs) -> NDArray[np.float64]:
        """Return (n,) the probability that each leg can be flown; never NaN.

        0.5 for a leg from or to a body on an unbound orbit, which has no classical elements.
        """
        return self.assess(legs)[0]

    def in_domain(self, legs: Legs) -> NDArray[np.bool_]:
        """Return (n,) whether each leg lies within what the model was trained on.

        Each input within its range in training, and the specific impulse too.
        """
        return self.assess(legs)[1]

    def assess(self, legs: Legs) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return the answers of `feasible_probability` and `in_domain`, at the cost of one."""
        probability = np.full(len(legs), _UNKNOWN)
        inside = np.zeros(len(legs), dtype=np.bool_)
        bound = np.flatnonzero(_bound(legs.rv_dep) & _bound(legs.rv_arr))
        for first in range(0, len(bound), _LEGS_AT_A_TIME):
            rows = bound[first : first + _LEGS_AT_A_TIME]
            probability[rows], inside[rows] = self._assess_bound(legs.take(rows))
        return probability, inside

    def threshold(self, recall: float) -> float:
        """Return the largest probability that `recall` of the calibration's feasible legs reach.

        Raises
        ------
        InputError
            `recall` is not above 0 and at most 1.
        """
        if not 0.0 < recall <= 1.0:
            raise InputError(f"recall: {recall}, expected above 0 and at most 1")
        # The tolerance keeps 1 - 0.99 from being a little less than a hundredth.
        lost = int((1.0 - recall) * len(self._positive) + 1e-9)
        return float(self._positive[lost])

    @functools.cached_property
    def _predict(self) -> Predictor:
        try:
            return make_predictor(self.artefact.kind, self.artefact.section("model"))
        except KeyError as error:
            raise InputError(f"model of kind {self.artefact.kind!r}: {error} unknown") from None

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
            dt_imp_days=None if "dt_imp" in self.artefact.features else unused,
            lambert_dv=None if "lambert_dv" in self.artefact.features else unused,
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
