"""Legs from bodies to rendezvous with others."""

import numpy as np
from numpy.typing import NDArray

from feasibility import Legs, Spacecraft
from feasibility.orbits import Catalogue

_Array = NDArray[np.float64]
_Rows = NDArray[np.intp]


def transfer_legs(
    catalogue: Catalogue,
    spacecraft: Spacecraft,
    row: _Rows,
    t_mjd2000: _Array,
    velocity: _Array | None,
    target: _Rows,
    tof_days: _Array,
    mass: _Array,
    least_mass: float,
) -> Legs:
    """Return n legs that end at rest at their targets.

    Parameters
    ----------
    catalogue : Catalogue
        The bodies.
    spacecraft : Spacecraft
        Thrust and specific impulse.
    row, target : (n,) intp
        Catalogue rows of the bodies left and reached.
    t_mjd2000, tof_days : (n,) float64
        Departure epochs and flight times.
    velocity : (n, 3) float64, m/s, or None
        At departure, relative to the body left; None for rest.
    mass : (n,) float64, kg
        At departure; raised to `least_mass` where it is below.
    least_mass : float, kg
        Of the legs' dry mass: what has to be left at arrival.
    """
    left = catalogue.states_at(row, t_mjd2000)
    if velocity is not None:
        left[:, 3:] += velocity
    return Legs(
        rv_dep=left,
        rv_arr=catalogue.states_at(target, t_mjd2000 + tof_days),
        tof_days=tof_days,
        m0=np.maximum(mass, least_mass),
        thrust=spacecraft.thrust,
        isp=spacecraft.isp,
        m_dry=least_mass,
        t_dep_mjd2000=t_mjd2000,
        dep_id=catalogue.ids[row],
        arr_id=catalogue.ids[target],
    )
