"""`EndOutlook`: which nodes can still come to the end, and what that leaves of time and mass."""

from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.arrays import StructOfArrays
from feasibility.classifier.predictor import LegPredictor, bounded_burn
from feasibility.constants import DAY_S
from seqsearch.beam.endings.table import GRID_DAYS, TOFS_DAYS, WayHomeTable
from seqsearch.core.ending import Ending
from seqsearch.core.nodes import Nodes
from seqsearch.core.problem import Problem

_Array = NDArray[np.float64]
_Flags = NDArray[np.bool_]

_LATER: Final = (1, 2, 4)
"""Departures that are looked at besides the first possible one, in steps of the grid."""

_HORIZON_DAYS: Final = 500.0
_NEAR_DAYS: Final = 200.0
"""With more time left than the first, the way home plays no part; with less than the second, it
counts in full. On orbits in the main belt, scouts found as much with 420 to 600 and
150 to 300 days, and less with 900 and 400, or 1400 and 800."""

_MUST_DAYS: Final = 500.0
"""With less time left than this, there has to be a way home from where a node is."""

_MARGIN_DOUBT: Final = 0.07
_MASS_DOUBT: Final = 0.02
"""How far log(m*/m0) may be below zero, and the mass below the dry mass, as a share of all
propellant, for a node that is not given up: quick answers between grid points."""

_BURN_WEIGHT: Final = 0.5
"""What a share of the propellant counts beside a share of the time, in the choice of a flight."""


@final
@dataclass(frozen=True, eq=False)
class Homecoming(StructOfArrays):
    """What the ends of n nodes look like.

    Attributes
    ----------
    weight : (n,) float64
        How much the way home counts by now, 0 to 1.
    possible, surely : (n,) bool
        Whether there may be a way home, and whether the predictor thinks so.
    t_arr_mjd2000 : (n,) float64
        Arrival at the end by the best flight.
    mass : (n,) float64, kg
        Mass there.
    """

    weight: _Array
    possible: _Flags
    surely: _Flags
    t_arr_mjd2000: _Array
    mass: _Array


@final
class EndOutlook:
    """Looks from nodes to the end.

    Parameters
    ----------
    problem : Problem
        What to solve.
    ending : Ending
        What completes its tours.
    predictor : LegPredictor
        Predicts the last legs.
    threads : int
        How many questions are worked on at once; the answers do not depend on it.
    """

    def __init__(
        self, problem: Problem, ending: Ending, predictor: LegPredictor, threads: int = 1
    ) -> None:
        self.ending = ending
        self._problem = problem
        self._table = WayHomeTable(problem, ending, predictor, threads)
        self._last: tuple[Nodes, Homecoming] | None = None

    def hopeful(self, nodes: Nodes) -> NDArray[np.intp]:
        """Return the positions of nodes from which there may be a way to the end."""
        return np.flatnonzero(self.homecoming(nodes).possible)

    def taken(self, nodes: Nodes, rows: NDArray[np.intp]) -> Nodes:
        """Return nodes at positions, about which `homecoming` need not look again."""
        some = nodes.take(rows)
        self._last = some, self.homecoming(nodes).take(rows)
        return some

    def homecoming(self, nodes: Nodes) -> Homecoming:
        """Return how each of n nodes comes to the end."""
        if self._last is None or self._last[0] is not nodes:
            self._last = nodes, self._looked(nodes)
        return self._last[1]

    def _looked(self, nodes: Nodes) -> Homecoming:
        n = len(nodes)
        left = self.ending.days_left(nodes, nodes.t_ready_mjd2000[:, None])[:, 0]
        missing = self.ending.missing(nodes)
        result = Homecoming(
            weight=np.clip((_HORIZON_DAYS - left) / (_HORIZON_DAYS - _NEAR_DAYS), 0.0, 1.0),
            possible=np.ones(n, dtype=np.bool_),
            surely=missing == 0,
            t_arr_mjd2000=nodes.t_arr_mjd2000.copy(),
            mass=nodes.mass.copy(),
        )
        if self.ending.row is None:
            return result
        late = np.flatnonzero(left < _HORIZON_DAYS)
        if len(late):
            found = self._flights(nodes.take(late), left[late])
            must = left[late] < _MUST_DAYS
            result.possible[late] = found.possible | ~must
            result.surely[late] &= found.surely
            result.t_arr_mjd2000[late] = found.t_arr_mjd2000
            result.mass[late] = found.mass
        return result

    def at_home(self, nodes: Nodes, homecoming: Homecoming) -> Nodes:
        """Return the nodes as they would be at the end."""
        return replace(nodes, t_arr_mjd2000=homecoming.t_arr_mjd2000, mass=homecoming.mass)

    def _flights(self, nodes: Nodes, left: _Array) -> Homecoming:
        """Return the homecomings of n late nodes that have some days left."""
        problem, n = self._problem, len(nodes)
        craft = problem.spacecraft
        log_m_star, delta_v, delay = self._departures(nodes)
        longest = np.clip(left[:, None] - delay, 0.0, TOFS_DAYS[-1])
        log_m_star, delta_v, tof = _with_longest(log_m_star, delta_v, longest)
        mass = nodes.mass[:, None, None]
        usable = tof <= longest[:, :, None]
        excess = np.where(usable, np.nan_to_num(log_m_star - np.log(mass), nan=0.0), -np.inf)
        most = craft.thrust / craft.exhaust_velocity * tof * DAY_S
        impulsive = np.minimum(mass * -np.expm1(-delta_v / craft.exhaust_velocity), most)
        final = mass - bounded_burn(impulsive, most, np.exp(np.maximum(excess, 0.0)))
        propellant = problem.m0 - craft.m_dry
        spare = final - craft.m_dry
        possible = (excess >= -_MARGIN_DOUBT) & (spare >= -_MASS_DOUBT * propellant)
        surely = (excess >= 0.0) & (spare >= 0.0)
        duration = (delay[:, :, None] + tof) / problem.max_duration_days
        cost = duration + _BURN_WEIGHT * (mass - final) / propellant
        # Where nothing can be flown, what is nearest to it.
        cost = np.where(
            surely, cost, 10.0 - np.minimum(excess, 0.0) + np.maximum(-spare, 0.0) / propellant
        )
        best = cost.reshape(n, -1).argmin(axis=1)
        pick = (np.arange(n), *np.divmod(best, tof.shape[2]))
        return Homecoming(
            weight=np.ones(n),
            possible=np.asarray(possible.reshape(n, -1).any(axis=1), dtype=np.bool_),
            surely=np.asarray(surely.reshape(n, -1).any(axis=1), dtype=np.bool_),
            t_arr_mjd2000=nodes.t_ready_mjd2000 + delay[pick[:2]] + tof[pick],
            mass=final[pick],
        )

    def _departures(self, nodes: Nodes) -> tuple[_Array, _Array, _Array]:
        """Return log m* and delta-v, (n, d, k) at d departures, and their (n, d) delays."""
        place = nodes.t_ready_mjd2000 / GRID_DAYS
        cell = np.floor(place).astype(np.int64)
        steps = np.array([0, *_LATER])
        shape = (len(nodes), len(steps), len(TOFS_DAYS))
        cells = (cell[:, None] + steps).ravel()
        values = self._table.at(np.repeat(nodes.row, len(steps)), cells)
        log_m_star, delta_v = (value.reshape(shape).copy() for value in values)
        share = (place - cell)[:, None]
        for value in (log_m_star, delta_v):
            value[:, 0] += share * (value[:, 1] - value[:, 0])
        delay = GRID_DAYS * (cell[:, None] + steps) - nodes.t_ready_mjd2000[:, None]
        delay[:, 0] = 0.0
        return log_m_star, delta_v, delay


def _with_longest(
    log_m_star: _Array, delta_v: _Array, longest: _Array
) -> tuple[_Array, _Array, _Array]:
    """Append the longest flights (n, d) to those of the grid, (n, d, k) each, and return tofs."""
    logs = np.log(TOFS_DAYS)
    u = (np.log(np.maximum(longest, TOFS_DAYS[0])) - logs[0]) / (logs[1] - logs[0])
    lower = np.clip(np.floor(u).astype(np.intp), 0, len(TOFS_DAYS) - 2)
    share = np.clip(u - lower, 0.0, 1.0)
    full = []
    for value in (log_m_star, delta_v):
        low = np.take_along_axis(value, lower[:, :, None], axis=2)[:, :, 0]
        high = np.take_along_axis(value, lower[:, :, None] + 1, axis=2)[:, :, 0]
        full.append(np.concatenate([value, (low + share * (high - low))[:, :, None]], axis=2))
    grid = np.broadcast_to(TOFS_DAYS, log_m_star.shape)
    # Too short a time for any flight is no flight of that time.
    last = np.where(longest >= TOFS_DAYS[0], longest, np.inf)
    return full[0], full[1], np.concatenate([grid, last[:, :, None]], axis=2)
