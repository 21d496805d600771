"""`Forecast`: which hops a predictor expects to be worth flying, before any is optimised.

Targets that cannot be reached within the longest flight time are dropped after one cheap
question. For the others a few cheap answers give the margin as a curve over the flight
time, and one good answer at the curve's crossing of 1 corrects it. From there on flight
times are free: the shortest that can be flown, and longer ones, which save propellant.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility import Legs
from feasibility.classifier.predictor import LegPredictor, QuickPredictor, bounded_final_mass
from feasibility.orbits import OrbitalNeighbours
from feasibility.runtime.workers import in_threads
from seqsearch.core.candidates import Candidates
from seqsearch.core.margin_curves import MarginCurves, flight_times
from seqsearch.core.nodes import Nodes
from seqsearch.core.problem import Hops, TourProblem
from seqsearch.settings import SearchSettings

_Array = NDArray[np.float64]

_PAIRS_AT_ONCE: Final = 10_000
"""Pairs of node and target looked at by one thread at once: bounds memory."""

_QUICK_DOUBT: Final = 0.1
"""Quick answers are hardly ever further off than this in log(m*/m0)."""


_MASS_DOUBT: Final = 0.02
"""Share of the predicted propellant by which a hop may seem to fall below the dry mass."""


@final
@dataclass(frozen=True, eq=False)
class Prospects:
    """Targets that can probably be reached, one row a pair of node and target.

    With n the number of pairs.

    Attributes
    ----------
    parent : (n,) intp
        Position of the node among those that are expanded.
    target : (n,) intp
        Catalogue row of the target.
    t_dep_mjd2000 : (n,) float64
        Departure epoch.
    curves : MarginCurves
        n curves.
    """

    parent: NDArray[np.intp]
    target: NDArray[np.intp]
    t_dep_mjd2000: _Array
    curves: MarginCurves

    def __len__(self) -> int:
        return len(self.parent)

    def take(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> "Prospects":
        """Return the pairs at the given rows (indices or a mask)."""
        return Prospects(
            self.parent[rows],
            self.target[rows],
            self.t_dep_mjd2000[rows],
            self.curves.take(rows),
        )

    @staticmethod
    def concatenate(parts: "list[Prospects]") -> "Prospects":
        """Return the pairs of all parts, at least one, in order."""
        return Prospects(
            np.concatenate([part.parent for part in parts]),
            np.concatenate([part.target for part in parts]),
            np.concatenate([part.t_dep_mjd2000 for part in parts]),
            MarginCurves.concatenate([part.curves for part in parts]),
        )


@final
@dataclass(frozen=True, eq=False)
class Survey:
    """What one block of nodes has before it.

    Attributes
    ----------
    longest : Candidates
        One hop a pair, with the longest flight time: what was asked first.
    hopeful : (n,) bool
        Which of the n hops the predictor does not rule out.
    prospects : Prospects
        The hopeful pairs of which something is known, with their curves.
    unknown : (k,) intp
        Rows of `longest` of which nothing is known.
    proposed : int
        Hops that a grid of as many flight times would have proposed.
    questions : int
        Legs that the predictor was asked about.
    """

    longest: Candidates
    hopeful: NDArray[np.bool_]
    prospects: Prospects
    unknown: NDArray[np.intp]
    proposed: int
    questions: int


@final
class Forecast:
    """Asks a predictor about the ways on from nodes.

    Parameters
    ----------
    problem : TourProblem
        What hops there are.
    predictor : LegPredictor
        Whom to ask. A `QuickPredictor` is asked for its quick answers first.
    neighbours : OrbitalNeighbours
        Which targets are looked at.
    threads : int
        How many questions are worked on at once; the answers do not depend on it.
    """

    def __init__(
        self,
        problem: TourProblem,
        predictor: LegPredictor,
        neighbours: OrbitalNeighbours,
        threads: int = 1,
    ) -> None:
        self._problem = problem
        self._predictor = predictor
        self._neighbours = neighbours
        self._threads = threads
        self._quick = quick_margin_of(predictor)

    def surveys(self, nodes: Nodes, settings: SearchSettings) -> Iterator[Survey]:
        """Look at the targets of nodes: nearest bodies x departure delays.

        Bodies visited before are left out, and so are first departures outside
        the problem's window. Blocks come in order of the nodes.
        """
        per_node = (settings.neighbours + int(nodes.depth.max(initial=0))) * len(
            settings.departure_delays_days
        )
        step = max(1, _PAIRS_AT_ONCE // per_node)
        blocks = (
            self._pairs(nodes, np.arange(first, min(first + step, len(nodes))), settings)
            for first in range(0, len(nodes), step)
        )

        def survey(pairs: tuple[NDArray[np.intp], NDArray[np.intp], _Array, _Array]) -> Survey:
            return self._survey(nodes, *pairs, settings)

        yield from in_threads(survey, (pairs for pairs in blocks if len(pairs[0])), self._threads)

    def sharpened(self, nodes: Nodes, prospects: Prospects, settings: SearchSettings) -> Prospects:
        """Return the prospects with curves corrected by one good answer each.

        Asked at the shortest flight time that seems flyable; pairs that turn out to
        have none are dropped.
        """
        level = np.log1p(settings.margin_reserve)
        shortest = prospects.curves.shortest(level)
        longest = np.exp(prospects.curves.log_last)
        tof = np.where(np.isfinite(shortest), shortest, longest)

        def ask(rows: NDArray[np.intp]) -> _Array:
            hops = self._hops(nodes, prospects.take(rows), tof[rows])
            return log_margin(self._predictor.margin, hops)

        blocks = [
            np.arange(first, min(first + _PAIRS_AT_ONCE // 4, len(prospects)))
            for first in range(0, len(prospects), _PAIRS_AT_ONCE // 4)
        ]
        answers = list(in_threads(ask, blocks, self._threads))
        if not answers:
            return prospects
        curves = prospects.curves.corrected(tof, np.concatenate(answers))
        flyable = np.isfinite(curves.shortest(level))
        return Prospects(prospects.parent, prospects.target, prospects.t_dep_mjd2000, curves).take(
            flyable
        )

    def outlook(
        self, nodes: Nodes, prospects: Prospects, settings: SearchSettings
    ) -> tuple[Candidates, _Array, NDArray[np.intp]]:
        """Return hops with the shortest flyable flight time of each pair, and with longer ones.

        Returns
        -------
        candidates : Candidates
            n hops.
        m_final : (n,) float64, kg
            Predicted masses at arrival.
        pair : (n,) intp
            Which of the prospects each is of.
        """
        shortest = prospects.curves.shortest(np.log1p(settings.margin_reserve))
        longest = np.exp(prospects.curves.log_last)
        pair_parts, tof_parts = [], []
        for stretch in settings.flight_time_stretches:
            tof = shortest * stretch
            rows = np.flatnonzero(tof <= longest)
            pair_parts.append(rows)
            tof_parts.append(tof[rows])
        pair = np.concatenate(pair_parts)
        tof_days = np.concatenate(tof_parts)
        order = np.lexsort((tof_days, pair))
        pair, tof_days = pair[order], tof_days[order]

        def mass(rows: NDArray[np.intp]) -> tuple[Hops, _Array]:
            part = prospects.take(pair[rows])
            hops = self._hops(nodes, part, tof_days[rows])
            margin = np.exp(part.curves.log_margin(tof_days[rows]))
            return hops, bounded_final_mass(hops.stages[-1], margin)

        blocks = [
            np.arange(first, min(first + _PAIRS_AT_ONCE, len(pair)))
            for first in range(0, max(1, len(pair)), _PAIRS_AT_ONCE)
        ]
        parts = list(in_threads(mass, blocks, self._threads))
        candidates = Candidates(
            prospects.parent[pair],
            prospects.target[pair],
            Hops.concatenate([hops for hops, _ in parts]),
        )
        m_final = np.concatenate([mass for _, mass in parts])
        last = candidates.hops.stages[-1]
        enough = m_final >= last.m_dry - _MASS_DOUBT * (last.m0 - m_final)
        return candidates.take(enough), m_final[enough], pair[enough]

    def flyable(self, hops: Hops, settings: SearchSettings) -> NDArray[np.bool_]:
        """Return (n,) whether the good answers do not speak against n hops."""
        log = log_margin(self._predictor.margin, hops)
        flyable: NDArray[np.bool_] = np.isnan(log) | (log >= np.log1p(settings.margin_reserve))
        return flyable

    def grid(self, nodes: Nodes, longest: Candidates, settings: SearchSettings) -> Candidates:
        """Return hops with all flight times of the grid up to those of the given hops."""
        tof = settings.tof_days()
        pair, k = np.nonzero(tof <= longest.hops.tof_days[:, None])
        parent, target = longest.parent[pair], longest.target[pair]
        t_dep = longest.hops.t_dep_mjd2000[pair]
        return Candidates(parent, target, self._problem.hops(nodes, parent, target, t_dep, tof[k]))

    def _pairs(
        self, nodes: Nodes, block: NDArray[np.intp], settings: SearchSettings
    ) -> tuple[NDArray[np.intp], NDArray[np.intp], _Array, _Array]:
        """Return parent, target, departure epoch and longest flight time of the pairs."""
        problem = self._problem
        depth = nodes.depth[block]
        n_near = min(settings.neighbours + int(depth.max()), len(problem.catalogue) - 1)
        t_ready = nodes.t_ready_mjd2000[block]
        near = self._neighbours.query(nodes.row[block], t_ready, n_near)
        fresh = ~(near[:, :, None] == nodes.visited[block][:, None, :]).any(axis=2)
        departure = t_ready[:, None] + np.asarray(settings.departure_delays_days)
        at_start = depth[:, None] == 0
        in_window = ~at_start | (departure <= problem.first_departure_mjd2000[1])
        clock = np.where(at_start, departure, nodes.t_first_mjd2000[block][:, None])
        left = problem.max_duration_days - (departure - clock)
        in_time = left > settings.tof_days_min
        i, j, d = np.nonzero(fresh[:, :, None] & (in_window & in_time)[:, None, :])
        longest = np.minimum(left[i, d], settings.tof_days_max)
        return block[i], near[i, j], departure[i, d], longest

    def _survey(
        self,
        nodes: Nodes,
        parent: NDArray[np.intp],
        target: NDArray[np.intp],
        t_dep: _Array,
        longest: _Array,
        settings: SearchSettings,
    ) -> Survey:
        count = settings.coarse_flight_times
        hops = self._problem.hops(nodes, parent, target, t_dep, longest)
        at_longest = log_margin(self._quick, hops)
        unknown = np.isnan(at_longest)
        hopeful = unknown | (at_longest >= np.log1p(settings.margin_reserve) - _QUICK_DOUBT)
        rows = np.flatnonzero(hopeful & ~unknown)
        times = flight_times(np.full(len(rows), settings.tof_days_min), longest[rows], count)
        values = np.empty((len(rows), count))
        values[:, -1] = at_longest[rows]
        values[:, :-1] = log_margin(
            self._quick,
            self._problem.hops(
                nodes,
                np.repeat(parent[rows], count - 1),
                np.repeat(target[rows], count - 1),
                np.repeat(t_dep[rows], count - 1),
                times[:, :-1].ravel(),
            ),
        ).reshape(len(rows), count - 1)
        known = np.isfinite(values).all(axis=1)
        unknown[rows[~known]] = True
        rows = rows[known]
        curves = MarginCurves.through(
            np.full(len(rows), settings.tof_days_min), longest[rows], values[known]
        )
        return Survey(
            longest=Candidates(parent, target, hops),
            hopeful=hopeful,
            prospects=Prospects(parent[rows], target[rows], t_dep[rows], curves),
            unknown=np.flatnonzero(unknown),
            proposed=len(hops) * count,
            questions=len(hops.stages) * (len(hops) + len(values) * (count - 1)),
        )

    def _hops(self, nodes: Nodes, prospects: Prospects, tof_days: _Array) -> Hops:
        return self._problem.hops(
            nodes, prospects.parent, prospects.target, prospects.t_dep_mjd2000, tof_days
        )


def quick_margin_of(predictor: LegPredictor) -> Callable[[Legs], _Array]:
    """Return the predictor's quick answers, or the others if it has none."""
    if isinstance(predictor, QuickPredictor):
        return predictor.quick_margin
    return predictor.margin


def log_margin(ask: Callable[[Legs], _Array], hops: Hops) -> _Array:
    """Return (n,) log(m*/m0) of hops: that of their most difficult stage; NaN for unknown."""
    answers = [np.log(ask(legs)) for legs in hops.stages]
    lowest: _Array = np.min(answers, axis=0)
    return lowest
