"""`Homing`: beams of predicted legs that start at one orbit and have to end at another.

No leg is optimised, and none is asked about: all of them are on a chart. A wide beam takes a
tenth of a second. `retime` then flies what it finds.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from seqsearch.carriers.chart_kernels import expand
from seqsearch.carriers.leg_chart import STEP_DAYS, TOF_DAYS, ChartMaker, LegChart, Ways
from seqsearch.chart.choice_kernels import choose
from seqsearch.chart.curves import SPEED_UNIT, inverse_unit
from seqsearch.chart.ranks import Children, Rank
from seqsearch.core.nodes import Nodes
from seqsearch.polish.itinerary import Itinerary
from seqsearch.problems.rendezvous import RendezvousProblem

_Array = NDArray[np.float64]
_Index = NDArray[np.intp]

DAYS_PER_VISIT: Final = 300.0
"""Time that is worth a visit. A visit takes 170 days; but tours with time to spare have mostly
burnt their propellant for it."""

_HOMEWARD_SHARE: Final = 0.5
"""Share of the longest duration after which there has to be a way to the end. Tours could be far
away for longer, but beams that stay near the end find better ones."""

_FINE_MUST_SHARE: Final = 0.85
"""The same where little is left to a beam."""

_DISTANCE: Final = 5000.0
"""m/s of the orbital metric that count as one in the ranking."""

_FARTHEST: Final = 3.0
_STRETCHES: Final = np.log([1.0, 1.03, 1.07, 1.12, 1.18, 1.25, 1.4])
_FINE_STRETCHES: Final = np.log([1.0, 1.02, 1.04, 1.07, 1.1, 1.14, 1.18, 1.23, 1.3, 1.4, 1.55])
"""Flight times in units of the shortest."""

_LONGEST_DAYS: Final = 240.0
_LIGHTEST: Final = 0.97
"""Least mass that is predicted, in dry masses: retimed tours burn less."""

_CELL_DAYS: Final = 20.0
_FINE_CELL_DAYS: Final = 4.0
_ANY_MASS: Final = 1e9
_MASS_STEP: Final = 15.0
"""Nodes alike in epochs (and masses, where it is looked at finely) compete with each other."""

_PER_PARENT: Final = 10
_PER_CELL: Final = 3
_START_SHARE: Final = 0.1
"""Most children of one node, nodes at one body in a cell of epochs, and share of the width of
nodes that left at the same time."""

_LOOKED_AT: Final = 8
"""Ends that are looked at for each that is kept: many differ in their flight times only."""


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
    fine : bool
        Look finely at flight times and masses, where few orders of visit are left.
    thorough : bool
        Ask the classifier about the ways to the end, also from farther away than the chart's
        neighbours: a tenth of a second for an end, once.
    """

    width: int = 300
    propellant_weight: float = 0.2
    distance_weight: float = 0.2
    results: int = 3
    fine: bool = False
    thorough: bool = True


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
    """Runs beams over one chart.

    Parameters
    ----------
    chart : LegChart
        Its bodies include the start and the end.
    maker : ChartMaker
        Of the same chart; answers what is not on it.
    problem : RendezvousProblem
        Stays and masses; its longest duration may be more than is allowed, as predicted
        timetables are not yet the best.
    reserve : float
        By how much m* has to exceed the mass, as a share.
    """

    def __init__(
        self, chart: LegChart, maker: ChartMaker, problem: RendezvousProblem, reserve: float
    ) -> None:
        self.chart = chart
        self._maker = maker
        self._problem = problem
        craft = problem.spacecraft
        self._duration = problem.max_duration_days
        self._units = inverse_unit(craft.m_dry), SPEED_UNIT
        self._craft = (
            _LIGHTEST * craft.m_dry,
            problem.m0,
            float(craft.thrust),
            float(craft.exhaust_velocity),
            float(np.log1p(reserve)),
        )
        # Sums of random keys tell sets of bodies apart.
        self._keys = np.random.default_rng(0).integers(
            1, np.iinfo(np.uint64).max, len(chart.rows), dtype=np.uint64
        )
        self._known: tuple[tuple[int, int, int], Ways] | None = None

    def run(
        self,
        starts: Nodes,
        end: int,
        avoid: _Index,
        settings: HomingSettings,
        steps: Sequence[int | None] | None = None,
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
        steps : sequence of int, optional
            The bodies to be visited in this order, as catalogue rows; None where any will do.
            Default: any bodies, as many as there is time for. With steps all tours have as many
            visits.
        """
        chart = self.chart
        place = chart.positions(np.array([end]))
        rows = chart.positions(starts.row)
        if len(place) == 0 or len(rows) < len(starts):
            return []
        ways = self._ways(int(place[0]), starts, settings.thorough)
        closed = np.zeros(len(chart.rows), dtype=np.bool_)
        closed[chart.positions(avoid)] = True
        closed[chart.positions(np.unique(starts.visited))] = True
        closed[place] = True
        rank = Rank.first(starts, rows)
        ranks = [rank]
        found: list[Homecoming] = []
        distance = self._distances(starts, ways.end)
        masks = None if steps is None else self._masks(closed, steps)
        while masks is None or len(ranks) <= len(masks):
            mask = closed if masks is None else masks[len(ranks) - 1]
            children = self._expanded(rank, ways, mask, distance, settings)
            if len(children.row) == 0:
                break
            if masks is None or len(ranks) == len(masks):
                found += self._homecomings(ranks, children, ways, settings.results)
            rank = self._chosen(rank, children, settings, len(starts))
            ranks.append(rank)
        return sorted(found, key=lambda tour: (-tour.visits, tour.duration_days))

    def _masks(
        self, closed: NDArray[np.bool_], steps: Sequence[int | None]
    ) -> list[NDArray[np.bool_]]:
        """Return which bodies are closed at each step."""
        named = [
            None if step is None else self.chart.positions(np.array([step])) for step in steps
        ]
        free = closed.copy()
        for place in named:
            if place is not None:
                free[place] = True
        masks = []
        for place in named:
            mask = free
            if place is not None:
                mask = np.ones_like(closed)
                mask[place] = False
            masks.append(mask)
        return masks

    def _ways(self, end: int, starts: Nodes, thorough: bool) -> Ways:
        """Return the legs to the end, for all times at which tours may end."""
        begin = float(starts.t_first_mjd2000.min()) + _HOMEWARD_SHARE * self._duration
        first = self.chart.interval(begin)
        last = self.chart.interval(float(starts.t_first_mjd2000.max()) + self._duration)
        if not thorough:
            return self.chart.ways(end, first, last)
        if self._known is None or self._known[0] != (end, first, last):
            self._known = (end, first, last), self._maker.ways(end, first, last)
        return self._known[1]

    def _distances(self, starts: Nodes, end: int) -> tuple[int, NDArray[np.float32]]:
        """Return (k, n) how far bodies are from the end when tours end, from an interval on."""
        last = starts.t_first_mjd2000 + self._duration
        first = self.chart.interval(float(last.min()))
        points = self.chart.points[first : self.chart.interval(float(last.max())) + 2]
        away = np.sqrt(((points - points[:, end, None]) ** 2).sum(axis=2))
        return first, np.minimum(away / np.float32(_DISTANCE), np.float32(_FARTHEST))

    def _expanded(
        self,
        rank: Rank,
        ways: Ways,
        closed: NDArray[np.bool_],
        distance: tuple[int, NDArray[np.float32]],
        settings: HomingSettings,
    ) -> Children:
        chart = self.chart
        interval = np.clip((rank.ready - chart.t0_mjd2000) // STEP_DAYS, 0, chart.intervals - 1)
        entry = interval.astype(np.intp) * len(chart.rows) + rank.row
        stretches = _FINE_STRETCHES if settings.fine else _STRETCHES
        room = int((chart.offsets[entry + 1] - chart.offsets[entry]).sum()) * len(stretches)
        row, parent = np.empty(room, dtype=np.int32), np.empty(room, dtype=np.int32)
        arrival, mass, score, home = (np.empty(room) for _ in range(4))
        must = _FINE_MUST_SHARE if settings.fine else _HOMEWARD_SHARE
        count = expand(
            (rank.row, rank.ready, rank.first_departure, rank.mass),
            rank.own,
            closed,
            (chart.offsets, chart.target, chart.inverse, chart.speed, np.log(TOF_DAYS)),
            self._units,
            (chart.t0_mjd2000, STEP_DAYS, chart.intervals),
            (ways.first, ways.index, ways.inverse, ways.speed, ways.log_tof),
            distance,
            stretches,
            (self._duration, self._problem.min_stay_days, _LONGEST_DAYS, _HOMEWARD_SHARE, must),
            self._craft,
            (settings.propellant_weight, settings.distance_weight),
            (row, parent, arrival, mass, score, home),
        )
        return Children(
            *(row[:count], parent[:count], arrival[:count]),
            *(mass[:count], score[:count], home[:count]),
        )

    def _chosen(
        self, rank: Rank, children: Children, settings: HomingSettings, starts: int
    ) -> Rank:
        width, fine = settings.width, settings.fine
        share = 1.0 if fine else max(_START_SHARE, 2.0 / starts)
        per_parent, per_cell = (width, width) if fine else (_PER_PARENT, _PER_CELL)
        caps = np.array([width, per_parent, per_cell, int(np.ceil(share * width))])
        taken = np.empty(width, dtype=np.int64)
        kept = choose(
            np.argsort(children.score, kind="stable"),
            children.row,
            children.parent,
            children.arrival,
            rank.sets,
            self._keys,
            rank.start,
            caps,
            len(self.chart.rows),
            _FINE_CELL_DAYS if fine else _CELL_DAYS,
            children.mass,
            _MASS_STEP if fine else _ANY_MASS,
            taken,
        )
        return rank.children(children, taken[:kept], self._keys, self._problem.min_stay_days)

    def _homecomings(
        self, ranks: list[Rank], children: Children, ways: Ways, count: int
    ) -> list[Homecoming]:
        """Return the best ends of a rank of children, as tours."""
        order = np.argsort(children.home, kind="stable")[: _LOOKED_AT * count]
        order = order[children.home[order] <= self._duration]
        parent = children.parent[order]
        kinds = ranks[-1].sets[parent] + self._keys[children.row[order]]
        first = np.unique(kinds, return_index=True)[1]
        return [
            self._traced(ranks, children, int(order[k]), ways.end) for k in np.sort(first)[:count]
        ]

    def _traced(self, ranks: list[Rank], children: Children, last: int, end: int) -> Homecoming:
        """Return the tour that leads from the first rank to one of the children, and on."""
        at = int(children.parent[last])
        first_departure = float(ranks[-1].first_departure[at])
        arrival = float(children.arrival[last])
        departures = [arrival + self._problem.min_stay_days]
        flights = [first_departure + float(children.home[last]) - departures[0]]
        rows = [end, int(children.row[last])]
        for rank in reversed(ranks):
            departures.append(float(rank.ready[at]))
            flights.append(arrival - departures[-1])
            rows.append(int(rank.row[at]))
            arrival, at = float(rank.arrival[at]), int(rank.parent[at])
        itinerary = Itinerary(
            self.chart.rows[np.array(rows[::-1])],
            np.array(departures[::-1]),
            np.array(flights[::-1]),
        )
        visits = ranks[0].depth + len(ranks)
        return Homecoming(itinerary, visits, float(children.home[last]))
