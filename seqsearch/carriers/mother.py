"""The mother ship's flight: to the orbit of one asteroid, and on to that of another.

She releases all probes on her first orbit and catches them on the second one. At rest at an
asteroid, she spares one probe the flight to it: it waits there, and the asteroid counts.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from feasibility.constants import DAY_S
from feasibility.orbits import Catalogue
from feasibility.orbits.lambert import lambert, lambert_delta_v
from seqsearch.carriers.routes import Route
from seqsearch.tours.carrier.records import (
    Carrier,
    CarrierEvent,
    CarrierImpulse,
    CarrierLaunch,
    CarrierRules,
    CraftCapture,
    CraftRelease,
)
from seqsearch.tours.records import Vector

_Array = NDArray[np.float64]
_Index = NDArray[np.intp]

_REVOLUTIONS: Final = 2
_DEPARTURES: Final = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
_ARRIVALS: Final = (0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
_SHORTEST: Final = 0.15
"""Departures and arrivals that are tried, and the shortest flight, as shares of the time."""

_EVALUATIONS: Final = 300
_SPEED: Final = 15_000.0
"""m/s, the least on orbits of the belt. An impulse turns the plane by at most dv / v, and changes
the vector of the eccentricity and a (as a share) by 2 dv / v: Gauss's equations."""

_ALLOWANCE: Final = 1.2
_NEAR: Final = (0.08, 0.12, 0.07)
"""By how much these limits are exceeded, and the most of a, e and the plane."""


@final
@dataclass(frozen=True)
class Change:
    """Two impulses from one orbit to another."""

    t_dep_mjd2000: float
    dep_m_s: Vector
    t_arr_mjd2000: float
    arr_m_s: Vector

    @property
    def delta_v(self) -> float:
        """Sum of both impulses in m/s."""
        return float(np.linalg.norm(self.dep_m_s) + np.linalg.norm(self.arr_m_s))

    @property
    def impulses(self) -> tuple[CarrierImpulse, CarrierImpulse]:
        """Both, as events."""
        return (
            CarrierImpulse(t_mjd2000=self.t_dep_mjd2000, dv_m_s=self.dep_m_s),
            CarrierImpulse(t_mjd2000=self.t_arr_mjd2000, dv_m_s=self.arr_m_s),
        )


def change_costs(
    catalogue: Catalogue, first: int, second: _Index, between_mjd2000: tuple[float, float]
) -> _Array:
    """Return (n,) m/s: what it costs to go from one body to n others within some time."""
    begin, end = between_mjd2000
    n = len(second)
    least = np.full(n, np.inf)
    for leave in _DEPARTURES:
        for arrive in _ARRIVALS:
            if arrive - leave >= _SHORTEST:
                t_dep, t_arr = begin + leave * (end - begin), begin + arrive * (end - begin)
                costs = lambert_delta_v(
                    catalogue.states_at(np.full(n, first), t_dep),
                    catalogue.states_at(second, t_arr),
                    (t_arr - t_dep) * DAY_S,
                    max_revs=_REVOLUTIONS,
                )
                least = np.minimum(least, costs)
    return least


def next_orbits(
    catalogue: Catalogue, first: int, between_mjd2000: tuple[float, float], delta_v_max: float
) -> tuple[_Index, _Array]:
    """Return rows of bodies that can be gone on to, cheapest first, and what that costs in m/s.

    Parameters
    ----------
    catalogue : Catalogue
        The bodies.
    first : int
        Row of the body that is left.
    between_mjd2000 : tuple of float
        Earliest departure and latest arrival.
    delta_v_max : float, m/s
        Largest cost.
    """
    a, e, i, node, argp = catalogue.elements[:, :5].T
    plane = np.column_stack([np.sin(i) * np.sin(node), -np.sin(i) * np.cos(node), np.cos(i)])
    along = e * np.cos(node + argp), e * np.sin(node + argp)
    turn = _ALLOWANCE * delta_v_max / _SPEED
    limits = np.minimum(_NEAR, (2.0 * turn, 2.0 * turn, turn))
    near = np.abs(a / a[first] - 1.0) < limits[0]
    near &= np.hypot(*(part - part[first] for part in along)) < limits[1]
    near &= plane @ plane[first] > np.cos(limits[2])
    near[first] = False
    rows = np.flatnonzero(near)
    costs = change_costs(catalogue, first, rows, between_mjd2000)
    cheap = np.flatnonzero(costs <= delta_v_max)
    order = cheap[np.argsort(costs[cheap], kind="stable")]
    return rows[order], costs[order]


def change_orbit(
    catalogue: Catalogue, first: int, second: int, between_mjd2000: tuple[float, float]
) -> Change:
    """Return the cheapest two impulses from one body to another within some time."""
    begin, end = between_mjd2000
    days = end - begin
    starts = [
        (leave, arrive)
        for leave in _DEPARTURES
        for arrive in _ARRIVALS
        if arrive - leave >= _SHORTEST
    ]
    ways = [_arc(catalogue, first, second, begin + a * days, begin + b * days) for a, b in starts]
    order = np.argsort([way.delta_v for way in ways], kind="stable")
    best: Change = ways[int(order[0])]
    for k in order[:3]:
        found = minimize(
            lambda x: min(
                _arc(catalogue, first, second, begin + x[0] * days, begin + x[1] * days).delta_v,
                1e6,
            ),
            starts[k],
            method="Nelder-Mead",
            bounds=[(0.0, 0.85), (_SHORTEST, 1.0)],
            options={"maxfev": _EVALUATIONS, "xatol": 1e-5, "fatol": 1e-3},
        )
        leave, arrive = map(float, found.x)
        if arrive - leave >= 0.5 * _SHORTEST:
            way = _arc(catalogue, first, second, begin + leave * days, begin + arrive * days)
            best = way if way.delta_v < best.delta_v else best
    return best


def _arc(catalogue: Catalogue, first: int, second: int, t_dep: float, t_arr: float) -> Change:
    """Return the cheapest Lambert arc between two epochs; infinite impulses for none."""
    t_dep, t_arr = float(t_dep), float(t_arr)
    there = catalogue.states_at([first], t_dep)
    goal = catalogue.states_at([second], t_arr)
    if t_arr - t_dep < 1.0:
        return Change(t_dep, (np.inf, 0.0, 0.0), t_arr, (0.0, 0.0, 0.0))
    tof_s = np.array([(t_arr - t_dep) * DAY_S])
    v1, v2 = lambert(there[:, :3], goal[:, :3], tof_s, _REVOLUTIONS)
    leave, arrive = v1[0] - there[0, 3:], goal[0, 3:] - v2[0]
    cost = np.linalg.norm(leave, axis=1) + np.linalg.norm(arrive, axis=1)
    best = int(np.argmin(np.where(np.isfinite(cost), cost, np.inf)))
    if not np.isfinite(cost[best]):
        return Change(t_dep, (np.inf, 0.0, 0.0), t_arr, (0.0, 0.0, 0.0))
    return Change(t_dep, _vector(leave[best]), t_arr, _vector(arrive[best]))


def mother_flight(
    rules: CarrierRules,
    route: Route,
    impulses: Sequence[CarrierImpulse],
    releases_mjd2000: Sequence[float],
    captures: Sequence[tuple[float, float]],
) -> Carrier:
    """Return the mother ship's flight.

    Parameters
    ----------
    rules : CarrierRules
        The problem.
    route : Route
        To the first orbit.
    impulses : sequence of CarrierImpulse
        After that, to the second orbit; none: she stays.
    releases_mjd2000 : sequence of float
        Epochs, one a probe.
    captures : sequence of tuple of float
        Epochs and masses in kg, one a probe.
    """
    events: list[CarrierEvent] = [
        CarrierLaunch(t_mjd2000=route.launch_mjd2000, v_inf_m_s=route.v_inf_m_s),
        CarrierImpulse(t_mjd2000=route.first_mjd2000, dv_m_s=route.first_m_s),
        CarrierImpulse(t_mjd2000=route.second_mjd2000, dv_m_s=route.second_m_s),
    ]
    more: list[CarrierEvent] = [*impulses]
    more += [
        CraftRelease(t_mjd2000=epoch, craft=number)
        for number, epoch in enumerate(releases_mjd2000, 1)
    ]
    more += [
        CraftCapture(t_mjd2000=epoch, craft=number, mass_kg=mass)
        for number, (epoch, mass) in enumerate(captures, 1)
    ]
    return Carrier(rules=rules, events=tuple(events)).with_events(*more)


def later_budget(rules: CarrierRules, route_delta_v: float) -> float:
    """Return m/s that are left for impulses after all releases; negative for too dear a route."""
    exhaust = rules.isp_s * rules.g0_m_s2
    alone = rules.m0_kg * np.exp(-route_delta_v / exhaust) - rules.craft_count * rules.craft.m0_kg
    if alone <= 0.0:
        return -np.inf
    return float(exhaust * np.log(alone / rules.m_dry_kg))


def _vector(v: _Array) -> Vector:
    return float(v[0]), float(v[1]), float(v[2])
