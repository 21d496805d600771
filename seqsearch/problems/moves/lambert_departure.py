"""Departure velocities along Lambert arcs, where some of the velocity is given for free."""

import numpy as np
from numpy.typing import NDArray

from feasibility.constants import DAY_S
from feasibility.orbits import Catalogue
from feasibility.orbits.lambert import lambert

_Array = NDArray[np.float64]


def lambert_departure(
    catalogue: Catalogue,
    row: NDArray[np.intp],
    t_mjd2000: _Array,
    target: NDArray[np.intp],
    tof_days: _Array,
    *,
    least_m_s: float,
    most_m_s: float,
) -> _Array:
    """Return (n, 3) m/s, relative to the body left, along the best of Lambert's arcs.

    Of the arcs with up to one revolution, the best leaves the least velocity
    change to the engine when the departure is for free at speeds from
    `least_m_s` to `most_m_s`. Zero where there is no arc.

    Parameters
    ----------
    catalogue : Catalogue
        The bodies.
    row, target : (n,) intp
        Catalogue rows of the bodies left and reached.
    t_mjd2000, tof_days : (n,) float64
        Departure epochs and flight times.
    least_m_s, most_m_s : float
        Range of the speed.
    """
    left = catalogue.states_at(row, t_mjd2000)
    reached = catalogue.states_at(target, t_mjd2000 + tof_days)
    v_dep, v_arr = lambert(left[:, :3], reached[:, :3], tof_days * DAY_S, max_revs=1)
    excess = v_dep - left[:, None, 3:]
    speed = np.linalg.norm(excess, axis=2)
    free = np.clip(speed, least_m_s, most_m_s)
    rest = np.abs(speed - free) + np.linalg.norm(v_arr - reached[:, None, 3:], axis=2)
    best = np.where(np.isnan(rest), np.inf, rest).argmin(axis=1)
    n = np.arange(len(target))
    with np.errstate(invalid="ignore", divide="ignore"):
        velocity: _Array = excess[n, best] * (free[n, best] / speed[n, best])[:, None]
    return np.nan_to_num(velocity, nan=0.0)
