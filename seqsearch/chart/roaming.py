"""`Roaming`: beams of predicted legs over a chart, from any body, without a fixed end."""

from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from seqsearch.chart.choice_kernels import choose
from seqsearch.chart.curve_kernels import expand
from seqsearch.chart.curves import SPEED_UNIT, CurveChart
from seqsearch.chart.ranks import Children, Rank
from seqsearch.polish.itinerary import Itinerary
from seqsearch.problems.rendezvous import RendezvousProblem

_Array = NDArray[np.float64]
_Index = NDArray[np.intp]

_STRETCHES: Final = np.log([1.0, 1.03, 1.07, 1.12, 1.18, 1.25, 1.4])
"""Flight times in units of the shortest."""

_RESERVE: Final = 0.003
"""By how much m* has to exceed the mass, as a share."""

_LIGHTEST: Final = 0.98
_OVERTIME: Final = 0.023
"""Least mass that is predicted, in dry masses, and by how much longer than allowed tours may be:
with a better timetable they burn up to 20 kg less and take up to 50 days less."""

_PER_PARENT: Final = 10
_START_SHARE: Final = 0.1
"""Most children of one node, and most nodes, as a share of the width, that began at one body."""

_LOOKED_AT: Final = 60
"""Ends that are looked at for each tour wanted: many differ in their flight times only."""


@final
@dataclass(frozen=True)
class RoamingOrder:
    """What one beam is told.

    Attributes
    ----------
    begin_mjd2000, days : float
        Its slice of the departure window.
    epochs : int
        Departures in the slice; all bodies are starts at each.
    width : int
        Nodes of a rank.
    propellant_weight : float
        What a share of the propellant counts beside a share of the time.
    per_cell : int
        Most nodes at one body in a cell.
    cell_days, cell_kg : float
        Nodes that visited the same bodies and are alike in epochs and masses are one.
    results : int
        Tours of each of the last two ranks that are wanted.
    """

    begin_mjd2000: float
    days: float = 60.0
    epochs: int = 6
    width: int = 2500
    propellant_weight: float = 0.2
    per_cell: int = 10
    cell_days: float = 10.0
    cell_kg: float = 30.0
    results: int = 8


@final
@dataclass(frozen=True, eq=False)
class RoamingTour:
    """A predicted tour.

    Attributes
    ----------
    itinerary : Itinerary
        Its bodies and its timetable.
    mass : float, kg
        Mass at the end.
    """

    itinerary: Itinerary
    mass: float

    @property
    def bodies(self) -> frozenset[int]:
        """Catalogue rows of its bodies."""
        return frozenset(self.itinerary.rows.tolist())


@final
class Roaming:
    """Runs beams over one chart.

    Parameters
    ----------
    chart : CurveChart
        Everything they know.
    problem : RendezvousProblem
        Window, stays, masses.
    """

    def __init__(self, chart: CurveChart, problem: RendezvousProblem) -> None:
        self._chart = chart
        self._problem = problem
        craft = problem.spacecraft
        self._craft = (
            _LIGHTEST * craft.m_dry,
            problem.m0,
            float(craft.thrust),
            float(craft.exhaust_velocity),
            float(np.log1p(_RESERVE)),
        )
        self._duration = (1.0 + _OVERTIME) * problem.max_duration_days
        self._starts = chart.positions(problem.start_rows())
        # Sums of random keys tell sets of bodies apart.
        self._keys = np.random.default_rng(0).integers(
            1, np.iinfo(np.uint64).max, len(chart.rows), dtype=np.uint64
        )

    def run(self, order: RoamingOrder) -> list[RoamingTour]:
        """Return the best tours of the last two ranks of a beam, those of the last rank first."""
        rank = self._first(order)
        ranks: list[Rank] = []
        grown: list[Children] = []
        while len(rank.row):
            children = self._expanded(rank, order.propellant_weight)
            if len(children.row) == 0:
                break
            ranks.append(rank)
            grown.append(children)
            rank = self._chosen(rank, children, order)
        return [
            tour
            for k in range(len(grown) - 1, max(len(grown) - 3, -1), -1)
            for tour in self._best(ranks[: k + 1], grown[k], order.results)
        ]

    def _first(self, order: RoamingOrder) -> Rank:
        last = self._problem.first_departure_mjd2000[1]
        epochs = order.begin_mjd2000 + order.days * np.arange(order.epochs) / order.epochs
        epochs = np.minimum(epochs, last)
        rows = np.tile(self._starts, len(epochs))
        nodes = self._problem.start_nodes(
            self._chart.rows[rows], np.repeat(epochs, len(self._starts))
        )
        rank = Rank.first(nodes, rows)
        return replace(rank, start=rank.row)

    def _expanded(self, rank: Rank, propellant_weight: float) -> Children:
        chart = self._chart
        interval = (rank.ready - chart.t0_mjd2000) // chart.step_days
        interval = np.clip(interval, 0, chart.intervals - 1).astype(np.intp)
        entry = interval * len(chart.rows) + rank.row
        pairs = int((chart.offsets[entry + 1] - chart.offsets[entry]).sum())
        room = pairs * len(_STRETCHES)
        row, parent = np.empty(room, dtype=np.int32), np.empty(room, dtype=np.int32)
        arrival, mass, score = (np.empty(room) for _ in range(3))
        count = expand(
            (rank.row, rank.ready, rank.first_departure, rank.mass),
            rank.own,
            np.zeros(len(chart.rows), dtype=np.bool_),
            (chart.offsets, chart.target, chart.inverse, chart.speed, np.log(chart.tof_days)),
            (chart.inverse_unit, SPEED_UNIT),
            (chart.t0_mjd2000, chart.step_days, chart.intervals),
            _STRETCHES,
            (self._duration, float(chart.tof_days[-1])),
            self._craft,
            propellant_weight,
            (row, parent, arrival, mass, score),
        )
        parts = (row[:count], parent[:count], arrival[:count], mass[:count], score[:count])
        return Children(*parts, home=arrival[:count])

    def _chosen(self, rank: Rank, children: Children, order: RoamingOrder) -> Rank:
        width = order.width
        per_start = int(np.ceil(_START_SHARE * width))
        caps = np.array([width, min(width, _PER_PARENT), min(width, order.per_cell), per_start])
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
            len(self._chart.rows),
            order.cell_days,
            children.mass,
            order.cell_kg,
            taken,
        )
        return rank.children(children, taken[:kept], self._keys, self._problem.min_stay_days)

    def _best(self, ranks: list[Rank], children: Children, count: int) -> list[RoamingTour]:
        """Return the shortest tours that end with some children, no two of the same bodies."""
        last = ranks[-1]
        days = children.arrival - last.first_departure[children.parent]
        order = np.argsort(days, kind="stable")[: _LOOKED_AT * count]
        kinds = last.sets[children.parent[order]] + self._keys[children.row[order]]
        first = np.sort(np.unique(kinds, return_index=True)[1])[:count]
        return [self._traced(ranks, children, int(k)) for k in order[first]]

    def _traced(self, ranks: list[Rank], children: Children, last: int) -> RoamingTour:
        """Return the tour that leads from the first rank to one of the children."""
        at, arrival = int(children.parent[last]), float(children.arrival[last])
        rows, departures, flights = [int(children.row[last])], [], []
        for rank in reversed(ranks):
            departures.append(float(rank.ready[at]))
            flights.append(arrival - departures[-1])
            rows.append(int(rank.row[at]))
            arrival, at = float(rank.arrival[at]), int(rank.parent[at])
        itinerary = Itinerary(
            self._chart.rows[np.array(rows[::-1])],
            np.array(departures[::-1]),
            np.array(flights[::-1]),
        )
        return RoamingTour(itinerary, float(children.mass[last]))
