"""How the mother ship gets to a belt orbit: launch, an impulse on the way, and one on arrival.

A route is a Lambert arc from the Earth to the orbit. What the launch cannot give as excess
velocity is an impulse right after it. `scan_routes` looks over a grid of launches and flight
times; `refined_route` then moves the impulses until together they are least.
"""

from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.arrays import StructOfArrays
from feasibility.constants import DAY_S
from feasibility.orbits import Catalogue, earth
from feasibility.orbits.lambert import lambert

_Array = NDArray[np.float64]

_CHUNK: Final = 200_000
"""Arcs solved at once: bounds memory."""


@final
@dataclass(frozen=True, eq=False)
class Routes(StructOfArrays):
    """Two-impulse ways from the Earth to bodies, one row a way.

    With n the number of routes.

    Attributes
    ----------
    row : (n,) intp
        Catalogue row of the body whose orbit is reached.
    launch_mjd2000 : (n,) float64
        Epoch of the launch.
    tof_days : (n,) float64
        Days from the launch to the impulse on arrival.
    delta_v : (n,) float64, m/s
        Sum of both impulses: what the launch cannot give, and the arrival.
    """

    row: NDArray[np.intp]
    launch_mjd2000: _Array
    tof_days: _Array
    delta_v: _Array


def scan_routes(
    catalogue: Catalogue,
    rows: NDArray[np.intp],
    launches_mjd2000: _Array,
    tofs_days: _Array,
    *,
    v_inf: float,
    delta_v_max: float,
) -> Routes:
    """Return for each body and launch the cheapest flight time, where it is cheap enough.

    Parameters
    ----------
    catalogue : Catalogue
        The bodies.
    rows : (b,) intp
        Those to look at.
    launches_mjd2000 : (m,) float64
        Launch epochs.
    tofs_days : (k,) float64
        Flight times.
    v_inf : float, m/s
        Largest excess velocity of the launch.
    delta_v_max : float, m/s
        Largest sum of impulses.

    Returns
    -------
    Routes
        In order of launch, then of `rows`.
    """
    planet = earth()
    parts: list[Routes] = []
    n_bodies = len(rows)
    grid = np.repeat(tofs_days, n_bodies)
    arrivals = np.tile(rows, len(tofs_days))
    for launch in launches_mjd2000:
        home = planet.states(float(launch))[0]
        costs = np.empty(len(grid))
        for first in range(0, len(grid), _CHUNK):
            part = slice(first, first + _CHUNK)
            goal = catalogue.states_at(arrivals[part], launch + grid[part])
            costs[part] = arc_costs(home, goal, grid[part], v_inf)
        table = costs.reshape(len(tofs_days), n_bodies)
        best = np.nanargmin(np.where(np.isfinite(table), table, np.inf), axis=0)
        least = table[best, np.arange(n_bodies)]
        good = np.flatnonzero(least <= delta_v_max)
        parts.append(
            Routes(rows[good], np.full(len(good), launch), tofs_days[best[good]], least[good])
        )
    return Routes.concatenate(parts)


def arc_costs(home: _Array, goal: _Array, tof_days: _Array, v_inf: float) -> _Array:
    """Return (n,) m/s: impulses of direct arcs from one state to n states; inf for none."""
    start = np.broadcast_to(home[:3], (len(goal), 3))
    v1, v2 = lambert(start, goal[:, :3], tof_days * DAY_S)
    excess = np.linalg.norm(v1[:, 0] - home[3:], axis=1)
    arrival = np.linalg.norm(v2[:, 0] - goal[:, 3:], axis=1)
    cost = np.maximum(excess - v_inf, 0.0) + arrival
    return np.where(np.isfinite(cost), cost, np.inf)
