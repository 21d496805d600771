"""`MimaPredictor`: margins in closed form, for searches without a trained model."""

from typing import final

import numpy as np
from numpy.typing import NDArray

from feasibility import Legs
from feasibility.classifier.predictor import bounded_final_mass
from feasibility.orbits.mima import mima


@final
class MimaPredictor:
    """The estimate of Hennes, Izzo and Landau; a `LegPredictor`."""

    def margin(self, legs: Legs, /) -> NDArray[np.float64]:
        """Return (n,) the estimate of m*/m0; NaN where no Lambert arc exists."""
        mass = mima(legs.rv_dep, legs.rv_arr, legs.tof_s, legs.thrust, legs.exhaust_velocity)
        margin: NDArray[np.float64] = np.where(mass > 0.0, mass / legs.m0, np.nan)
        return margin

    def final_mass(self, legs: Legs, /) -> NDArray[np.float64]:
        """Return (n,) kg, the mass at arrival by the margin."""
        return bounded_final_mass(legs, self.margin(legs))
