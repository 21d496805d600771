"""`FeasibilityClassifier`: a trained model, asked about legs.

Loading and asking need neither torch nor scikit-learn.
"""

from importlib import resources
from pathlib import Path
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.artefact import Artefact
from feasibility.classifier.margin.estimator import MarginEstimator
from feasibility.classifier.margin.prediction import LegPrediction
from feasibility.classifier.margin.views import FREE_ENDS
from feasibility.classifier.model_check import check_model
from feasibility.classifier.paper import features as paper
from feasibility.classifier.paper.estimator import PaperEstimator
from feasibility.errors import InputError
from feasibility.legs import Legs

DEFAULT: Final = "default"
"""Name of the model that comes with the package."""


@final
class FeasibilityClassifier:
    """Tells how likely it is that legs can be flown.

    With n the number of legs. A margin model, such as the default, serves any
    spacecraft. A model with the paper's features was trained for one engine;
    as only thrust over mass enters the motion, a leg with another thrust is
    asked about with its mass in proportion, and another specific impulse is
    outside its domain. A margin model may have nets for legs with free ends (`Legs.free_ends`),
    as the default has. Such legs are outside the domain of any other model: their probability is
    0.5, their margin and final mass are NaN, and `ClassifierPruner` keeps them.

    Parameters
    ----------
    artefact : Artefact
        The trained model.

    Raises
    ------
    InputError
        The artefact has features or a kind of model that this version does not know, or arrays
        that do not fit together.

    Examples
    --------
    >>> from feasibility import Legs
    >>> leg = Legs([4e11, 0, 0, 0, 1.8e4, 0], [0, 4.1e11, 0, -1.8e4, 0, 0], 400.0,
    ...            m0=[1000.0, 2000.0], thrust=0.3, isp=3000.0, m_dry=800.0)
    >>> probability = FeasibilityClassifier.load("default").feasible_probability(leg)
    >>> bool(probability[0] >= probability[1])
    True
    """

    def __init__(self, artefact: Artefact) -> None:
        check_model(artefact)
        self.artefact = artefact
        self._estimator: MarginEstimator | PaperEstimator
        if artefact.feature_set == paper.FEATURE_SET:
            self._estimator = PaperEstimator(artefact)
        else:
            self._estimator = MarginEstimator(artefact)
        try:
            self._positive = artefact.section("calibration")["positive_scores"]
            self._free_positive = (
                artefact.section(FREE_ENDS.section("calibration"))["positive_scores"]
                if self.knows_free_ends
                else None
            )
        except KeyError as error:
            raise InputError(f"model: array {error} is missing") from None

    def __reduce__(self) -> tuple[Any, ...]:
        """Travel to worker processes as the artefact alone."""
        return FeasibilityClassifier, (self.artefact,)

    @classmethod
    def load(cls, path: str | Path = DEFAULT) -> "FeasibilityClassifier":
        """Read the model that comes with the package, or one that ``feasibility train`` wrote.

        Parameters
        ----------
        path : str or Path
            "default", or a file.

        Raises
        ------
        InputError
            No such file, damaged or changed, written by a newer version, or with arrays that do
            not fit together.
        """
        if path != DEFAULT:
            artefact = Artefact.load(Path(path))
            try:
                return cls(artefact)
            except InputError as error:
                raise InputError(f"{path}: {error}") from None
        with resources.as_file(
            resources.files("feasibility.classifier") / "default.seqmodel"
        ) as f:
            return cls(Artefact.load(f))

    @property
    def knows_margins(self) -> bool:
        """Whether `margin` and all that rests on it can be asked."""
        return isinstance(self._estimator, MarginEstimator)

    @property
    def knows_free_ends(self) -> bool:
        """Whether legs with free ends can be asked about."""
        estimator = self._estimator
        return isinstance(estimator, MarginEstimator) and estimator.knows_free_ends

    def feasible_probability(self, legs: Legs) -> NDArray[np.float64]:
        """Return (n,) the probability that each leg can be flown; never NaN.

        0.5 for a leg from or to a body on an unbound orbit, of which nothing is known.
        """
        return self.assess(legs)[0]

    def in_domain(self, legs: Legs) -> NDArray[np.bool_]:
        """Return (n,) whether each leg lies within what the model was trained on."""
        return self.assess(legs)[1]

    def assess(
        self, legs: Legs, threads: int = 1
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Return the answers of `feasible_probability` and `in_domain`, at the cost of one.

        Threads make a margin model's answers on a large batch faster, not different.
        """
        if isinstance(self._estimator, MarginEstimator):
            return self._estimator.assess(legs, threads)
        return self._estimator.assess(legs)

    def margin(self, legs: Legs) -> NDArray[np.float64]:
        """Return (n,) the estimate of m*/m0; NaN where nothing is known.

        Never inf: a leg with free ends that needs no thrust at all has about the acceleration of
        its spacecraft in units of 1e-9 m/s2, 10 000 or more.

        Raises
        ------
        InputError
            The model knows no margins: only those of kind "margin" do.
        """
        return np.exp(self._margin_estimator().estimate(legs)[0])

    def quick_margin(self, legs: Legs) -> NDArray[np.float64]:
        """Return (n,) an estimate of m*/m0 some percent off, ten times faster than `margin`.

        NaN where nothing is known and outside the domain.

        Raises
        ------
        InputError
            As for `margin`.
        """
        return np.exp(self._margin_estimator().quick_log_margin(legs))

    def final_mass(self, legs: Legs) -> NDArray[np.float64]:
        """Return (n,) kg, the estimate of the mass at arrival with least propellant.

        Where the margin is below 1 the leg cannot be flown at its initial mass, and the
        answer is what full thrust all the time would leave. The dry mass plays no part. NaN
        where nothing is known.

        Raises
        ------
        InputError
            As for `margin`.
        """
        return self.predict(legs).final_mass

    def final_mass_error(self, legs: Legs) -> NDArray[np.float64]:
        """Return (n,) kg, how far `final_mass` is at most from the truth on 68 % of such legs.

        As one standard deviation would say. The truth is the solution with least propellant.
        NaN where nothing is known, where the leg is evidently too heavy (margin below 0.95), and
        for models without final masses. `predict` gives both from one computation.

        Raises
        ------
        InputError
            As for `margin`.
        """
        return self.predict(legs).final_mass_error

    def predict(self, legs: Legs) -> LegPrediction:
        """Return margin, probability, final mass and more of n legs, at the cost of one of them.

        All are by the large net; `feasible_probability` lets the quick one settle clear cases.

        Raises
        ------
        InputError
            As for `margin`.
        """
        return self._margin_estimator().predict(legs)

    def max_initial_mass(self, legs: Legs) -> NDArray[np.float64]:
        """Return (n,) the estimate of m* in kg; otherwise as `margin`."""
        return self.margin(legs) * legs.m0

    def margin_error(self, legs: Legs) -> NDArray[np.float64]:
        """Return (n,) the expected error of log(m*/m0), which does not depend on m0.

        Raises
        ------
        InputError
            As for `margin`.
        """
        return self._margin_estimator().estimate(legs)[1]

    def threshold(self, recall: float) -> float:
        """Return the largest probability that `recall` of the calibration's feasible legs reach.

        Those of a margin model have initial masses near the boundary, as on good tours. Legs with
        free ends have `thresholds` of their own.

        Raises
        ------
        InputError
            `recall` is not above 0 and at most 1.
        """
        return float(self._positive[_below(recall, len(self._positive))])

    def thresholds(self, recall: float, legs: Legs) -> NDArray[np.float64]:
        """Return (n,) what `threshold` is for each leg: kinds of free ends have their own.

        Raises
        ------
        InputError
            As for `threshold`.
        """
        found = np.full(len(legs), self.threshold(recall))
        if self._free_positive is not None:
            rows = FREE_ENDS.rows_of(legs)
            of_kind = self._free_positive[:, _below(recall, self._free_positive.shape[1])]
            found[rows] = of_kind[FREE_ENDS.kinds_of(legs)[rows]]
        return found

    def _margin_estimator(self) -> MarginEstimator:
        if not isinstance(self._estimator, MarginEstimator):
            raise InputError(
                f"model of kind {self.artefact.kind!r}: knows no margins; expected kind 'margin'"
            )
        return self._estimator


def _below(recall: float, scores: int) -> int:
    """Return how many of a number of scores may be lost.

    Raises
    ------
    InputError
        `recall` is not above 0 and at most 1.
    """
    if not 0.0 < recall <= 1.0:
        raise InputError(f"recall: {recall}, expected above 0 and at most 1")
    # The tolerance keeps 1 - 0.99 from being a little less than a hundredth.
    return int((1.0 - recall) * scores + 1e-9)
