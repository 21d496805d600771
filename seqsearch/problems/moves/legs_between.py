"""Legs from bodies to bodies, with velocities relative to them at either end."""

import numpy as np
from numpy.typing import NDArray

from feasibility import Legs, Spacecraft
from feasibility.orbits import Catalogue

_Array = NDArray[np.float64]
_Rows = NDArray[np.intp]


def legs_between(
    catalogue: Catalogue,
    spacecraft: Spacecraft,
    row: _Rows,
    target: _Rows,
    t_mjd2000: _Array,
    tof_days: _Array,
    mass: _Array,
    *,
    least_mass: float,
    departure_velocity: _Array | None = None,
    arrival_velocity: _Array | None = None,
    vinf_dep: _Array | float = 0.0,
    vinf_arr: _Array | float = 0.0,
) -> Legs:
    """Return n legs.

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
    mass : (n,) float64, kg
        At departure; raised to `least_mass` where it is below.
    least_mass : float, kg
        What has to be left at arrival: the legs' dry mass.
    departure_velocity, arrival_velocity : (n, 3) float64, m/s, optional
        Relative to the bodies left and reached; default: rest.
    vinf_dep, vinf_arr : (n,) float64, m/s, or one for all
        Largest excess velocities beyond these.
    """
    left = catalogue.states_at(row, t_mjd2000)
    reached = catalogue.states_at(target, t_mjd2000 + tof_days)
    if departure_velocity is not None:
        left[:, 3:] += departure_velocity
    if arrival_velocity is not None:
        reached[:, 3:] += arrival_velocity
    return Legs(
        rv_dep=left,
        rv_arr=reached,
        tof_days=tof_days,
        m0=np.maximum(mass, least_mass),
        thrust=spacecraft.thrust,
        isp=spacecraft.isp,
        m_dry=least_mass,
        t_dep_mjd2000=t_mjd2000,
        dep_id=catalogue.ids[row],
        arr_id=catalogue.ids[target],
        vinf_dep=vinf_dep,
        vinf_arr=vinf_arr,
    )
