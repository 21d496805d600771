"""The segments of a leg: one a day from the departure, and what is left at the arrival."""

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from feasibility.constants import DAY_S, MJD2000_MJD

_SHORTEST_DAYS: Final = 1e-6
"""A remainder shorter than this lengthens the last day."""


def file_epoch(t_mjd2000: ArrayLike) -> NDArray[np.float64]:
    """Return the nearest epochs that files which count in MJD can hold, within a microsecond.

    A leg that is flown between such epochs is in a file what it was in memory.
    """
    nearest: NDArray[np.float64] = (np.asarray(t_mjd2000) + MJD2000_MJD) - MJD2000_MJD
    return nearest


def daily_edges(t_dep_mjd2000: float, t_arr_mjd2000: float) -> NDArray[np.float64]:
    """Return the (n + 1,) epochs between which the thrust of a leg is constant.

    Parameters
    ----------
    t_dep_mjd2000, t_arr_mjd2000 : float
        Departure and arrival.
    """
    days = t_arr_mjd2000 - t_dep_mjd2000
    n = max(1, int(np.ceil(days - _SHORTEST_DAYS)))
    return file_epoch(np.append(t_dep_mjd2000 + np.arange(n), t_arr_mjd2000))


def on_grid(throttles: NDArray[np.float64], edges: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the throttles of equal segments as averages over the segments of a grid.

    Parameters
    ----------
    throttles : (s, 3) array
        Throttle vectors of s equal segments of the whole leg.
    edges : (n + 1,) array
        Epochs of the grid.

    Returns
    -------
    (n, 3) array
    """
    share = (edges - edges[0]) / (edges[-1] - edges[0]) * len(throttles)
    whole = np.concatenate([np.zeros((1, 3)), np.cumsum(throttles, axis=0)])
    places = np.arange(len(throttles) + 1.0)
    passed = np.column_stack([np.interp(share, places, whole[:, c]) for c in range(3)])
    averages: NDArray[np.float64] = np.diff(passed, axis=0) / np.diff(share)[:, None]
    return averages


def impulsive_path(
    departure: NDArray[np.float64],
    impulses_m_s: NDArray[np.float64],
    edges: NDArray[np.float64],
    mu: float,
) -> NDArray[np.float64]:
    """Return the (n + 1, 6) states at the epochs of a grid, flown with impulses.

    Parameters
    ----------
    departure : (6,) array
        State at the first epoch, m and m/s.
    impulses_m_s : (s, 3) array
        Changes of velocity at the centres of s equal segments.
    edges : (n + 1,) array
        Epochs, MJD2000.
    mu : float
        Gravitational parameter, m3/s2.
    """
    # Imported here: numba takes a while to load.
    from feasibility.orbits.kepler_kernels import propagate_batch

    times = (edges - edges[0]) * DAY_S
    centres = (np.arange(len(impulses_m_s)) + 0.5) / len(impulses_m_s) * times[-1]
    passed = np.searchsorted(centres, times)
    path = np.empty((len(times), 6))
    state, now = np.array(departure, dtype=np.float64), 0.0
    for k in range(len(centres) + 1):
        here = np.flatnonzero(passed == k)
        path[here] = propagate_batch(np.tile(state, (len(here), 1)), times[here] - now, mu)
        if k < len(centres):
            state = propagate_batch(state[None], np.array([centres[k] - now]), mu)[0]
            state[3:] += impulses_m_s[k]
            now = float(centres[k])
    return path
