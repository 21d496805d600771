"""`Homing`: beams of predicted legs that start at one orbit and have to end at another.

No leg is optimised: the predictor's flight times and masses are good to a few percent, and beams
that tell good orbits from poor ones take a second. `retime` then flies what they find.
"""

from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.predictor import LegPredictor, bounded_final_mass
from feasibility.orbits import OrbitalNeighbours
from feasibility.orbits.neighbours import orbital_metric
from seqsearch.beam.forecast import Forecast, PairCurves
from seqsearch.beam.frontiers.depth import DepthFrontier
from seqsearch.beam.rankings.balanced import BalancedRanking
from seqsearch.core.candidates import reached
from seqsearch.core.hop_margins import log_margin, quick_margin_of
from seqsearch.core.margin_curves import MarginCurves, flight_times
from seqsearch.core.nodes import Nodes
from seqsearch.core.problem import Problem
from seqsearch.polish.itinerary import Itinerary
from seqsearch.settings import SearchSettings

_Array = NDArray[np.float64]
_Index = NDArray[np.intp]

DAYS_PER_VISIT: Final = 300.0
"""Time that is worth a visit. A visit takes 170 days; but tours with time to spare have mostly
burnt their propellant for it."""

_SHORTEST_DAYS: Final = 40.0
_LONGEST_DAYS: Final = 500.0
_FLIGHTS: Final = 6
"""Flight times to the end that are asked about."""

_HOME_STRETCHES: Final = (1.0, 1.1, 1.2, 1.35, 1.6, 2.0)
"""Flights to the end in units of the shortest."""

_HOMEWARD_SHARE: Final = 0.5
"""Share of the longest duration after which there has to be a way to the end."""

_DISTANCE: Final = 5000.0
"""m/s of the orbital metric that count as one in the ranking."""

_FARTHEST: Final = 3.0

_SPARE: Final = 2.0
"""Pairs that get a good answer, for each node that goes on."""

_STRETCHES: Final = (1.0, 1.03, 1.07, 1.12, 1.18, 1.25, 1.4)
_ELAPSED: Final = (0.3, 0.7, 0.8, 0.9)
_WIDTHS: Final = (2.0, 0.5, 0.5, 2.0)
"""Width in units of that asked for, by the share of the longest duration that has elapsed."""


@final
@dataclass(frozen=True)
class HomingSettings:
    """How a beam goes about it.

    Attributes
    ----------
    width : int
        Nodes of a rank.
    propellant_weight : float
        What a share of the propellant counts beside a share of the time.
    distance_weight : float
        What the distance from the end counts, at the end of the time.
    results : int
        Most tours of each number of visits that are returned.
    """

    width: int = 60
    propellant_weight: float = 0.6
    distance_weight: float = 0.2
    results: int = 3


@final
@dataclass(frozen=True, eq=False)
class Homecoming:
    """A predicted tour from its start to its end.

    Attributes
    ----------
    itinerary : Itinerary
        From the nodes that the beam began with to the end.
    visits : int
        Bodies between start and end, those before the beam's own included.
    duration_days : float
        From the first departure to the end.
    """

    itinerary: Itinerary
    visits: int
    duration_days: float

    def value(self, duration_days: float) -> float:
        """Return the visits, and what is left of a duration as a share of one."""
        return self.visits + (duration_days - self.duration_days) / DAYS_PER_VISIT


@final
class Homing:
    """Runs beams for one problem.

    Parameters
    ----------
    problem : Problem
        Bodies, window, stays; its longest duration may be more than is allowed, as predicted
        timetables are not yet the best.
    predictor : LegPredictor
        Predicts the legs.
    base : SearchSettings
        Caps of the frontier, and the range of flight times.
    threads : int
        Threads that ask the predictor.
    """

    def __init__(
        self, problem: Problem, predictor: LegPredictor, base: SearchSettings, threads: int = 1
    ) -> None:
        self._problem = problem
        self._quick = quick_margin_of(predictor)
        self._base = base
        neighbours = OrbitalNeighbours(problem.catalogue, base.reference_tof_days)
        self._forecast = Forecast(problem, predictor, neighbours, threads)

    def run(
        self, starts: Nodes, end: int, avoid: _Index, settings: HomingSettings
    ) -> list[Homecoming]:
        """Return tours from starts to an end, those with most visits first, the shortest of them.

        Parameters
        ----------
        starts : Nodes
            Where the beam begins; all of the same depth.
        end : int
            Catalogue row of the orbit at which tours end.
        avoid : (k,) intp
            Catalogue rows that are not visited.
        settings : HomingSettings
            How.
        """
        ranks = [_numbered(starts)]
        found: list[Homecoming] = []
        ranking = _HomingRanking(end, settings)
        while True:
            children = self._children(ranks[-1], end, avoid, ranking, settings)
            if len(children) == 0:
                break
            ranks.append(_numbered(children))
            found += self._homecomings(ranks, end, settings.results)
        return sorted(found, key=lambda tour: (-tour.visits, tour.duration_days))

    def _children(
        self,
        nodes: Nodes,
        end: int,
        avoid: _Index,
        ranking: "_HomingRanking",
        settings: HomingSettings,
    ) -> Nodes:
        """Return the nodes of the next rank, from all of which there is a way to the end."""
        problem = self._problem
        here = self._base.with_(
            neighbours=16,
            coarse_flight_times=5,
            flight_time_stretches=_STRETCHES,
            beam_width=self._width(nodes, settings.width),
        )

        def allows(nodes: Nodes, parent: _Index, target: _Index) -> NDArray[np.bool_]:  # noqa: ARG001
            return ~np.isin(target, avoid)

        surveys = self._forecast.surveys(nodes, here, allows)
        pairs = [survey.pairs for survey in surveys if len(survey.pairs)]
        if not pairs:
            return nodes.take(np.zeros(0, dtype=np.intp))
        frontier = DepthFrontier(here.frontier, problem, ranking)
        known = PairCurves.concatenate(pairs)
        candidates, m_final, pair = self._forecast.outlook(nodes, known, here)
        quick = reached(problem, nodes, candidates, m_final)
        known = known.take(np.unique(pair[frontier.admit(quick, here.beam_width, _SPARE)]))
        known = self._forecast.sharpened(nodes, known, here)
        candidates, m_final, _ = self._forecast.outlook(nodes, known, here)
        enough = m_final >= problem.spacecraft.m_dry
        children = reached(problem, nodes, candidates.take(enough), m_final[enough])
        elapsed = children.t_arr_mjd2000 - children.t_first_mjd2000
        late = np.flatnonzero(elapsed > _HOMEWARD_SHARE * problem.max_duration_days)
        hopeless = late[~np.isfinite(self._days_home(children.take(late), end))]
        children = children.take(np.setdiff1d(np.arange(len(children)), hopeless))
        if len(children) == 0:
            return children
        return children.take(frontier.admit(children, here.beam_width))

    def _homecomings(self, ranks: list[Nodes], end: int, count: int) -> list[Homecoming]:
        """Return the best ends of the last rank, as tours."""
        nodes = ranks[-1]
        elapsed = nodes.t_ready_mjd2000 - nodes.t_first_mjd2000
        rows = np.flatnonzero(elapsed > _HOMEWARD_SHARE * self._problem.max_duration_days)
        if len(rows) == 0:
            return []
        days = self._days_home(nodes.take(rows), end)
        order = np.argsort(elapsed[rows] + days, kind="stable")
        sets: set[tuple[int, ...]] = set()
        tours: list[Homecoming] = []
        for k in order:
            kind = tuple(sorted(nodes.visited[rows[k]].tolist()))
            if not np.isfinite(days[k]) or len(tours) == count:
                break
            if kind not in sets:
                sets.add(kind)
                tours.append(_traced(ranks, int(rows[k]), end, float(days[k])))
        return tours

    def _days_home(self, nodes: Nodes, end: int) -> _Array:
        """Return (n,) the shortest flight from each node to the end; inf where there is none."""
        problem = self._problem
        days = np.full(len(nodes), np.inf)
        elapsed = nodes.t_ready_mjd2000 - nodes.t_first_mjd2000
        left = np.minimum(problem.max_duration_days - elapsed, _LONGEST_DAYS)
        rows = np.flatnonzero(left > _SHORTEST_DAYS)
        if len(rows) == 0:
            return days
        here, n = nodes.take(rows), len(rows)
        first = np.full(n, _SHORTEST_DAYS)
        times = flight_times(first, left[rows], _FLIGHTS)
        parent = np.repeat(np.arange(n), _FLIGHTS)
        target = np.full(len(parent), end, dtype=np.intp)
        ready = here.t_ready_mjd2000
        hops = problem.hops(here, parent, target, ready[parent], times.ravel())
        values = log_margin(self._quick, hops).reshape(n, _FLIGHTS)
        known: NDArray[np.bool_] = np.asarray(np.isfinite(values).all(axis=1))
        curves = MarginCurves.through(first, left[rows], np.where(known[:, None], values, -1.0))
        shortest = curves.shortest(np.log1p(self._base.margin_reserve))
        # Longer flights burn less.
        stretches = np.array(_HOME_STRETCHES)
        tof = np.minimum(np.where(known, shortest, np.inf)[:, None] * stretches, left[rows, None])
        row, column = np.nonzero(np.isfinite(tof) & (tof >= shortest[:, None]))
        flight = tof[row, column]
        margin = np.exp(curves.take(row).log_margin(flight))
        ways = problem.hops(here, row, target[: len(row)], ready[row], flight)
        mass = bounded_final_mass(ways.legs[-1], margin)
        enough = mass >= problem.spacecraft.m_dry
        best = np.full(n, np.inf)
        np.minimum.at(best, row[enough], flight[enough])
        days[rows] = best
        return days

    def _width(self, nodes: Nodes, width: int) -> int:
        elapsed = float((nodes.t_arr_mjd2000 - nodes.t_first_mjd2000).mean())
        share = elapsed / self._problem.max_duration_days
        factor = np.exp(np.interp(share, _ELAPSED, np.log(_WIDTHS)))
        return max(1, round(width * float(factor)))


@final
class _HomingRanking:
    """Scores by what is used up, and by how far the end will be; a `Ranking`."""

    def __init__(self, end: int, settings: HomingSettings) -> None:
        self._end = end
        self._base = BalancedRanking(1.0, settings.propellant_weight)
        self._weight = settings.distance_weight

    def score(self, nodes: Nodes, problem: Problem, /) -> _Array:
        """Return (n,) float64, smaller is better."""
        t_end = nodes.t_first_mjd2000 + problem.max_duration_days
        share = (nodes.t_arr_mjd2000 - nodes.t_first_mjd2000) / problem.max_duration_days
        here = orbital_metric(problem.catalogue.states_at(nodes.row, t_end), 180.0)
        rows = np.full(len(nodes), self._end)
        there = orbital_metric(problem.catalogue.states_at(rows, t_end), 180.0)
        distance = np.minimum(np.linalg.norm(here - there, axis=1) / _DISTANCE, _FARTHEST)
        score: _Array = self._base.score(nodes, problem) + self._weight * share**2 * distance
        return score


def _traced(ranks: list[Nodes], last: int, end: int, days: float) -> Homecoming:
    """Return the tour that leads from the first rank to a node of the last one, and on."""
    leaf = ranks[-1]
    rows = [end, int(leaf.row[last])]
    departures, flights = [float(leaf.t_ready_mjd2000[last])], [days]
    at = last
    for before, after in zip(ranks[-2::-1], ranks[:0:-1], strict=True):
        arrival, at = float(after.t_arr_mjd2000[at]), int(after.parent_id[at])
        departures.append(float(before.t_ready_mjd2000[at]))
        flights.append(arrival - departures[-1])
        rows.append(int(before.row[at]))
    itinerary = Itinerary(
        np.array(rows[::-1], dtype=np.intp), np.array(departures[::-1]), np.array(flights[::-1])
    )
    duration = float(leaf.t_ready_mjd2000[last] + days - leaf.t_first_mjd2000[last])
    return Homecoming(itinerary, int(leaf.depth[last]), duration)


def _numbered(nodes: Nodes) -> Nodes:
    """Return nodes with ids of their own, by which their children know them."""
    return replace(nodes, tree_id=np.arange(len(nodes), dtype=np.int64))
