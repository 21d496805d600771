"""How the mother ship gets to a belt orbit: launch, an impulse on the way, and one on arrival.

A route is a Lambert arc from the Earth to the orbit. What the launch cannot give as excess
velocity is an impulse right after it. `scan_routes` looks over a grid of launches and flight
times; `refined_route` then moves the impulses until together they are least.
"""

from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from feasibility.arrays import StructOfArrays
from feasibility.constants import DAY_S, MU_SUN
from feasibility.orbits import Catalogue, earth
from feasibility.orbits.kepler_kernels import propagate_batch
from feasibility.orbits.lambert import lambert
from seqsearch.tours.records import Vector

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


@final
@dataclass(frozen=True)
class Route:
    """A launch and two impulses that put a mother ship on the orbit of a body.

    Attributes
    ----------
    launch_mjd2000 : float
        Epoch of the launch.
    v_inf_m_s, first_m_s, second_m_s : (3,) tuple of float
        Velocity relative to the Earth, and both impulses.
    first_mjd2000, second_mjd2000 : float
        Epochs of the impulses; after the second she is at the body, at rest.
    """

    launch_mjd2000: float
    v_inf_m_s: Vector
    first_mjd2000: float
    first_m_s: Vector
    second_mjd2000: float
    second_m_s: Vector

    @property
    def delta_v(self) -> float:
        """Sum of both impulses in m/s."""
        return float(np.linalg.norm(self.first_m_s) + np.linalg.norm(self.second_m_s))


def refined_route(
    body: Catalogue,
    launch_mjd2000: float,
    tof_days: float,
    *,
    v_inf: float,
    window_mjd2000: tuple[float, float],
    latest_arrival_days: float,
) -> Route:
    """Return the cheapest route near a direct arc.

    Launch, direction of the excess velocity, and the epochs of both impulses are free.

    Parameters
    ----------
    body : Catalogue
        One row: the body whose orbit is reached.
    launch_mjd2000, tof_days : float
        Of the direct arc.
    v_inf : float, m/s
        Largest excess velocity.
    window_mjd2000 : tuple of float
        Earliest and latest launch.
    latest_arrival_days : float
        Longest time from the launch to the second impulse.
    """
    legs = _Legs(body, v_inf)
    best: tuple[float, _Array] | None = None
    direction = legs.direction(launch_mjd2000, tof_days)
    for share in _FIRST_IMPULSES:
        start = np.array([launch_mjd2000, *direction, share, tof_days])
        bounds = [
            window_mjd2000,
            (direction[0] - np.pi, direction[0] + np.pi),
            (-0.5 * np.pi, 0.5 * np.pi),
            (0.01, 0.95),
            (60.0, latest_arrival_days),
        ]
        found = minimize(
            legs.cost,
            start,
            method="Nelder-Mead",
            bounds=bounds,
            options={
                "initial_simplex": start + np.vstack([np.zeros(5), np.diag(_STEPS)]),
                "maxfev": _EVALUATIONS,
                "xatol": 1e-4,
                "fatol": 1e-3,
            },
        )
        if best is None or found.fun < best[0]:
            best = float(found.fun), found.x
    assert best is not None
    return legs.route(best[1])


_FIRST_IMPULSES: Final = (0.1, 0.4)
"""Where the first impulse begins its search, as a share of the way."""

_STEPS: Final = (10.0, 0.05, 0.05, 0.1, 15.0)
"""First steps of the search: days, radians, radians, share of the way, days."""

_EVALUATIONS: Final = 600


@final
class _Legs:
    """A coast from the Earth and a Lambert arc to a body, by launch, direction and epochs."""

    def __init__(self, body: Catalogue, v_inf: float) -> None:
        self._body = body
        self._planet = earth()
        self._v_inf = v_inf

    def direction(self, launch_mjd2000: float, tof_days: float) -> tuple[float, float]:
        """Return longitude and latitude of the excess velocity of a direct arc."""
        home = self._planet.states(launch_mjd2000)
        goal = self._body.states(launch_mjd2000 + tof_days)
        v1, _ = lambert(home[:, :3], goal[:, :3], np.array([tof_days * DAY_S]))
        x, y, z = v1[0, 0] - home[0, 3:]
        return float(np.arctan2(y, x)), float(np.arctan2(z, np.hypot(x, y)))

    def cost(self, x: _Array) -> float:
        """Return the sum of both impulses in m/s; large where there is no arc."""
        first, second = self._impulses(x)[1:]
        cost = float(np.linalg.norm(first) + np.linalg.norm(second))
        return cost if np.isfinite(cost) else 1e6

    def route(self, x: _Array) -> Route:
        """Return the route of a point of the search."""
        excess, first, second = (_vector(v) for v in self._impulses(x))
        launch, arrival = float(x[0]), float(x[0] + x[4])
        return Route(launch, excess, launch + float(x[3] * x[4]), first, arrival, second)

    def _impulses(self, x: _Array) -> tuple[_Array, _Array, _Array]:
        launch, longitude, latitude, share, tof = (float(value) for value in x)
        home = self._planet.states(launch)
        cos = np.cos(latitude)
        unit = np.array([cos * np.cos(longitude), cos * np.sin(longitude), np.sin(latitude)])
        excess = self._v_inf * unit
        begin = home.copy()
        begin[0, 3:] += excess
        there = propagate_batch(begin, np.array([share * tof * DAY_S]), MU_SUN)
        goal = self._body.states(launch + tof)
        rest_s = np.array([(1.0 - share) * tof * DAY_S])
        v1, v2 = lambert(there[:, :3], goal[:, :3], rest_s)
        return excess, v1[0, 0] - there[0, 3:], goal[0, 3:] - v2[0, 0]


def _vector(v: _Array) -> Vector:
    return float(v[0]), float(v[1]), float(v[2])
