"""`LegPrediction`: all that a margin model says of legs, from one look at them."""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray


@final
@dataclass(frozen=True, eq=False)
class LegPrediction:
    """What a margin model says of n legs.

    Attributes
    ----------
    margin : (n,) float64
        Estimate of m*/m0; NaN where nothing is known.
    margin_error : (n,) float64
        Expected error of log(m*/m0); NaN where nothing is known.
    probability : (n,) float64
        Probability that the leg can be flown, never NaN.
    final_mass : (n,) float64, kg
        Estimate of the mass at arrival with least propellant, as
        `FeasibilityClassifier.final_mass` has it; NaN where nothing is known.
    final_mass_error : (n,) float64, kg
        How far from the least-propellant solution `final_mass` is at most on 68 % of legs like
        this one, as one standard deviation would say; NaN where nothing is known, where the leg
        is evidently too heavy, and with models that do not learn final masses.
    in_domain : (n,) bool
        Whether the leg lies within what the model was trained on.
    """

    margin: NDArray[np.float64]
    margin_error: NDArray[np.float64]
    probability: NDArray[np.float64]
    final_mass: NDArray[np.float64]
    final_mass_error: NDArray[np.float64]
    in_domain: NDArray[np.bool_]
