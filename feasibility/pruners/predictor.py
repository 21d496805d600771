"""The `LegPredictor` protocol: what a search asks to order candidate legs before it solves any."""

from dataclasses import dataclass
from typing import Protocol, final, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from feasibility.legs import Legs
from feasibility.orbits.lambert import lambert


@runtime_checkable
class LegPredictor(Protocol):
    """Predicts how far legs are from the boundary of what can be flown, and what they cost.

    The contract: row-wise and pure, as for `Pruner`; a NaN says that nothing is known
    about a leg. `FeasibilityClassifier` fulfils it with a margin model.
    """

    def margin(self, legs: Legs, /) -> NDArray[np.float64]:
        """Return (n,) the estimate of m*/m0: a leg is flyable where it is 1 or more."""
        ...

    def final_mass(self, legs: Legs, /) -> NDArray[np.float64]:
        """Return (n,) kg, the estimate of the mass at arrival with least propellant."""
        ...


class _MarginModel(Protocol):
    def margin(self, legs: Legs, /) -> NDArray[np.float64]: ...


@final
@dataclass(frozen=True)
class LambertPropellant:
    """Makes a predictor of anything that knows margins, with Lambert's estimate of final masses.

    Parameters
    ----------
    model : object
        Has a method `margin(legs) -> (n,)`.
    """

    model: _MarginModel

    def margin(self, legs: Legs, /) -> NDArray[np.float64]:
        """Return (n,) what the model says."""
        return self.model.margin(legs)

    def final_mass(self, legs: Legs, /) -> NDArray[np.float64]:
        """Return (n,) kg, `lambert_final_mass`."""
        return lambert_final_mass(legs)


def lambert_final_mass(legs: Legs) -> NDArray[np.float64]:
    """Estimate the masses at arrival from two-impulse transfers.

    The propellant is that of the zero-revolution Lambert arc by the rocket equation, no
    more than what the engine can burn in the time of flight.

    Parameters
    ----------
    legs : Legs
        n legs.

    Returns
    -------
    (n,) float64, kg
        At least the dry mass.
    """
    v_dep, v_arr = lambert(legs.rv_dep[:, :3], legs.rv_arr[:, :3], legs.tof_s, max_revs=0)
    delta_v = np.linalg.norm(v_dep[:, 0] - legs.rv_dep[:, 3:], axis=1) + np.linalg.norm(
        v_arr[:, 0] - legs.rv_arr[:, 3:], axis=1
    )
    burnt = legs.m0 * -np.expm1(-np.nan_to_num(delta_v, nan=np.inf) / legs.exhaust_velocity)
    most = legs.thrust / legs.exhaust_velocity * legs.tof_s
    estimate: NDArray[np.float64] = np.maximum(legs.m0 - np.minimum(burnt, most), legs.m_dry)
    return estimate
