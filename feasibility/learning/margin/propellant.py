"""The mass at arrival with least propellant: what bounds it.

At m* the engine burns all the time; a lighter spacecraft coasts, and the lighter it is the
nearer it comes to a few impulses. So the velocity change lies between that of
Lambert's impulses, roughly, and that at m*.
"""

import numpy as np
from numpy.typing import NDArray

from feasibility.constants import MU_SUN
from feasibility.learning.margin.features import FEATURES
from feasibility.legs import Legs

_Array = NDArray[np.float64]

_LAMBERT = [FEATURES.index(f"log_lambert_dv_{revs}_rev") for revs in range(3)]
_LOG_IMPULSE = FEATURES.index("log_impulse")
_LARGEST_SHARE = 0.999
"""Share of m* that may be burnt at m*: a leg with more is beyond all use."""


def full_thrust_velocity(legs: Legs, log_margin: _Array) -> _Array:
    """Return (n,) m/s, the velocity change at m* of legs with the given log(m*/m0) (n,)."""
    heaviest = legs.m0 * np.exp(log_margin)
    burnt = legs.thrust * legs.tof_s / (legs.exhaust_velocity * heaviest)
    change: _Array = -legs.exhaust_velocity * np.log1p(-np.minimum(burnt, _LARGEST_SHARE))
    return change


def lambert_velocity(legs: Legs, X: _Array) -> _Array:
    """Return (n,) m/s, Lambert's least sum of impulses up to 2 revolutions, by `FEATURES`."""
    radius = np.linalg.norm(legs.rv_dep[:, :3], axis=1)
    inverse = 2.0 / radius - np.einsum("ij,ij->i", legs.rv_dep[:, 3:], legs.rv_dep[:, 3:]) / MU_SUN
    change: _Array = np.exp(X[:, _LAMBERT].min(axis=1) + X[:, _LOG_IMPULSE]) * np.sqrt(
        MU_SUN * inverse
    )
    return change


def final_mass(legs: Legs, X: _Array, log_margin: _Array) -> _Array:
    """Return (n,) kg, the mass at arrival with least propellant.

    Parameters
    ----------
    legs : Legs
        n legs on elliptic orbits.
    X : (n, k) float64
        `FEATURES`.
    log_margin : (n,) float64
        Estimate of log(m*/m0). Where it is negative the leg cannot be flown, and the answer is
        what full thrust all the time would leave.
    """
    change = np.minimum(full_thrust_velocity(legs, log_margin), lambert_velocity(legs, X))
    all_the_time = np.maximum(legs.m0 - legs.thrust * legs.tof_s / legs.exhaust_velocity, 0.0)
    mass: _Array = np.where(
        log_margin < 0.0, all_the_time, legs.m0 * np.exp(-change / legs.exhaust_velocity)
    )
    return mass
