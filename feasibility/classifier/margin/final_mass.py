"""The mass at arrival with least propellant: what bounds it, and what the net adds.

At m* the engine burns all the time; a lighter spacecraft coasts, and the lighter it is the
nearer it comes to a few impulses. So the velocity change lies between that of
Lambert's impulses, roughly, and that at m*; the net says where.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.margin.features import FEATURES
from feasibility.classifier.margin.network import MarginNet
from feasibility.constants import MU_SUN
from feasibility.legs import Legs

_Array = NDArray[np.float64]

FINAL_MASS_INPUTS: Final = (
    *FEATURES,
    "inverse_margin",
    "log_margin",
    "log_lambert_to_full_thrust",
    "full_thrust_to_exhaust_velocity",
)
"""Names of the net's inputs, all without unit."""

_LAMBERT: Final = [FEATURES.index(f"log_lambert_dv_{revs}_rev") for revs in range(3)]
_LOG_IMPULSE: Final = FEATURES.index("log_impulse")
_LARGEST_SHARE: Final = 0.999
"""Share of m* that may be burnt at m*: a leg with more is beyond all use."""

_LARGEST: Final = 3.0


def full_thrust_velocity(legs: Legs, log_margin: _Array) -> _Array:
    """Return (n,) m/s, the velocity change at m* of legs with the given log(m*/m0) (n,)."""
    heaviest = legs.m0 * np.exp(log_margin)
    burnt = legs.thrust * legs.tof_s / (legs.exhaust_velocity * heaviest)
    change: _Array = -legs.exhaust_velocity * np.log1p(-np.minimum(burnt, _LARGEST_SHARE))
    return change


def lambert_velocity(legs: Legs, X: _Array) -> _Array:
    """Return (n,) m/s, Lambert's least sum of impulses up to 2 revolutions, by `FEATURES`."""
    states = legs.rv_dep
    radius = np.sqrt(np.einsum("ij,ij->i", states[:, :3], states[:, :3]))
    inverse = 2.0 / radius - np.einsum("ij,ij->i", states[:, 3:], states[:, 3:]) / MU_SUN
    total = np.exp(X[:, _LAMBERT].min(axis=1) + X[:, _LOG_IMPULSE])
    change: _Array = total * np.sqrt(MU_SUN * inverse)
    return change


def final_mass_inputs(legs: Legs, X: _Array, log_margin: _Array) -> _Array:
    """Return `FINAL_MASS_INPUTS` (n, 84) of n legs on elliptic orbits.

    Parameters
    ----------
    legs : Legs
        n legs.
    X : (n, 80) float64
        `FEATURES`.
    log_margin : (n,) float64
        Estimate of log(m*/m0); below 0 counts as 0.
    """
    margin = np.maximum(log_margin, 0.0)
    full = full_thrust_velocity(legs, margin)
    ratio = np.log(lambert_velocity(legs, X) / full)
    return np.column_stack(
        [
            X,
            np.exp(-margin),
            np.minimum(margin, _LARGEST),
            np.clip(ratio, -_LARGEST, _LARGEST),
            np.minimum(full / legs.exhaust_velocity, _LARGEST),
        ]
    )


def final_mass(legs: Legs, X: _Array, log_margin: _Array, net: MarginNet | None) -> _Array:
    """Return (n,) kg, the mass at arrival with least propellant.

    Parameters
    ----------
    legs, X, log_margin
        As for `final_mass_inputs`. Where the margin is negative the leg cannot be flown, and the
        answer is what full thrust all the time would leave.
    net : MarginNet, optional
        Estimates log(velocity change / that at m*); without it, the smaller bound is the answer.
    """
    change = full_thrust_velocity(legs, np.maximum(log_margin, 0.0))
    if net is None:
        change = np.minimum(change, lambert_velocity(legs, X))
    else:
        change = change * np.exp(net(final_mass_inputs(legs, X, log_margin))[0])
    all_the_time = np.maximum(legs.m0 - legs.thrust * legs.tof_s / legs.exhaust_velocity, 0.0)
    mass: _Array = np.where(
        log_margin < 0.0, all_the_time, legs.m0 * np.exp(-change / legs.exhaust_velocity)
    )
    return mass
