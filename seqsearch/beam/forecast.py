"""`Forecast`: which hops a predictor expects to be worth flying, before any is optimised.

Targets that cannot be reached within the longest flight time are dropped after one cheap
question. For the others a few cheap answers give the margin as a curve over the flight
time, and one good answer at the curve's crossing of 1 corrects it. From there on flight
times are free: the shortest that can be flown, and longer ones, which save propellant.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.arrays import StructOfArrays
from feasibility.classifier.predictor import LegPredictor, bounded_final_mass
from feasibility.orbits import OrbitalNeighbours
from feasibility.runtime.workers import in_threads
from seqsearch.core.candidates import Candidates, Pairs, near_pairs
from seqsearch.core.hop_margins import log_margin, quick_margin_of
from seqsearch.core.hops import Hops
from seqsearch.core.margin_curves import MarginCurves, flight_times
from seqsearch.core.nodes import Nodes
from seqsearch.core.problem import Problem
from seqsearch.settings import SearchSettings

_Array = NDArray[np.float64]

Allows = Callable[[Nodes, NDArray[np.intp], NDArray[np.intp]], NDArray[np.bool_]]
"""Tells which hops of nodes, given by positions of parents and rows of targets, are looked at."""

_PAIRS_AT_ONCE: Final = 10_000
"""Pairs of node and target looked at by one thread at once: bounds memory."""

_QUICK_DOUBT: Final = 0.1
"""Quick answers are hardly ever further off than this in log(m*/m0)."""


_MASS_DOUBT: Final = 0.02
"""Share of the predicted propellant by which a hop may seem to fall below the dry mass."""


@final
@dataclass(frozen=True, eq=False)
class PairCurves(StructOfArrays):
    """Pairs of node and target that can probably be flown, one row a pair.

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


@final
@dataclass(frozen=True, eq=False)
class Survey:
    """What one block of nodes has before it.

    Attributes
    ----------
    all_pairs : Pairs
        The n pairs that were looked at, with their longest flight times.
    hopeful : (n,) bool
        Which of them the predictor does not rule out.
    pairs : PairCurves
        The hopeful pairs of which something is known, with their curves.
    unknown : Pairs
        Those of which nothing is known.
    proposed : int
        Hops that a grid of as many flight times would have proposed.
    questions : int
        Legs that the predictor was asked about.
    """

    all_pairs: Pairs
    hopeful: NDArray[np.bool_]
    pairs: PairCurves
    unknown: Pairs
    proposed: int
    questions: int


@final
class Forecast:
    """Asks a predictor which hops lead on from nodes.

    Parameters
    ----------
    problem : Problem
        What hops there are.
    predictor : LegPredictor
        Predicts the legs. A `QuickPredictor` is asked for its quick answers first.
    neighbours : OrbitalNeighbours
        Which targets are looked at.
    threads : int
        How many questions are worked on at once; the answers do not depend on it.
    """

    def __init__(
        self,
        problem: Problem,
        predictor: LegPredictor,
        neighbours: OrbitalNeighbours,
        threads: int = 1,
    ) -> None:
        self._problem = problem
        self._predictor = predictor
        self._neighbours = neighbours
        self._threads = threads
        self._quick = quick_margin_of(predictor)

    def surveys(
        self, nodes: Nodes, settings: SearchSettings, allows: Allows | None = None
    ) -> Iterator[Survey]:
        """Look at the targets of nodes: nearest bodies x departure delays.

        Bodies visited before are left out, and so are first departures outside
        the problem's window, and what `allows` forbids. Blocks come in order of the nodes.
        """
        per_node = (settings.neighbours + int(nodes.depth.max(initial=0))) * len(
            settings.departure_delays_days
        )
        step = max(1, _PAIRS_AT_ONCE // per_node)
        blocks = (
            self._pairs(nodes, np.arange(first, min(first + step, len(nodes))), settings)
            for first in range(0, len(nodes), step)
        )

        if allows is not None:
            blocks = (pairs.take(allows(nodes, pairs.parent, pairs.target)) for pairs in blocks)

        def survey(pairs: Pairs) -> Survey:
            return self._survey(nodes, pairs, settings)

        yield from in_threads(survey, (pairs for pairs in blocks if len(pairs)), self._threads)

    def sharpened(self, nodes: Nodes, pairs: PairCurves, settings: SearchSettings) -> PairCurves:
        """Return the pairs with curves corrected by one good answer each.

        Asked at the shortest flight time that seems flyable; pairs that turn out to
        have none are dropped.
        """
        level = np.log1p(settings.margin_reserve)
        shortest = pairs.curves.shortest(level)
        longest = np.exp(pairs.curves.log_last)
        tof = np.where(np.isfinite(shortest), shortest, longest)

        def ask(rows: NDArray[np.intp]) -> _Array:
            hops = self._hops(nodes, pairs.take(rows), tof[rows])
            return log_margin(self._predictor.margin, hops)

        blocks = [
            np.arange(first, min(first + _PAIRS_AT_ONCE // 4, len(pairs)))
            for first in range(0, len(pairs), _PAIRS_AT_ONCE // 4)
        ]
        answers = list(in_threads(ask, blocks, self._threads))
        if not answers:
            return pairs
        curves = pairs.curves.corrected(tof, np.concatenate(answers))
        flyable = np.isfinite(curves.shortest(level))
        return replace(pairs, curves=curves).take(flyable)

    def outlook(
        self, nodes: Nodes, pairs: PairCurves, settings: SearchSettings
    ) -> tuple[Candidates, _Array, NDArray[np.intp]]:
        """Return hops with the shortest flyable flight time of each pair, and with longer ones.

        Returns
        -------
        candidates : Candidates
            n hops.
        m_final : (n,) float64, kg
            Predicted masses at arrival.
        pair : (n,) intp
            Which of the pairs each is of.
        """
        shortest = pairs.curves.shortest(np.log1p(settings.margin_reserve))
        longest = np.exp(pairs.curves.log_last)
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
            part = pairs.take(pair[rows])
            hops = self._hops(nodes, part, tof_days[rows])
            margin = np.exp(part.curves.log_margin(tof_days[rows]))
            return hops, bounded_final_mass(hops.legs[-1], margin)

        blocks = [
            np.arange(first, min(first + _PAIRS_AT_ONCE, len(pair)))
            for first in range(0, max(1, len(pair)), _PAIRS_AT_ONCE)
        ]
        parts = list(in_threads(mass, blocks, self._threads))
        candidates = Candidates(
            pairs.parent[pair],
            pairs.target[pair],
            Hops.concatenate([hops for hops, _ in parts]),
        )
        m_final = np.concatenate([mass for _, mass in parts])
        last = candidates.hops.legs[-1]
        enough = m_final >= last.m_dry - _MASS_DOUBT * (last.m0 - m_final)
        return candidates.take(enough), m_final[enough], pair[enough]

    def flyable(self, hops: Hops, settings: SearchSettings) -> NDArray[np.bool_]:
        """Return (n,) whether the good answers do not speak against n hops."""
        log = log_margin(self._predictor.margin, hops)
        flyable: NDArray[np.bool_] = np.isnan(log) | (log >= np.log1p(settings.margin_reserve))
        return flyable

    def _pairs(self, nodes: Nodes, block: NDArray[np.intp], settings: SearchSettings) -> Pairs:
        """Return pairs with the longest flight times that are worth a question."""
        n_near = settings.neighbours + int(nodes.depth[block].max())
        n_near = min(n_near, len(self._problem.catalogue) - 1)
        pairs = near_pairs(self._problem, nodes, block, self._neighbours, n_near, settings)
        pairs = pairs.take(pairs.days_left > settings.tof_days_min)
        return replace(pairs, days_left=np.minimum(pairs.days_left, settings.tof_days_max))

    def _survey(self, nodes: Nodes, pairs: Pairs, settings: SearchSettings) -> Survey:
        count = settings.coarse_flight_times
        parent, target, t_dep = pairs.parent, pairs.target, pairs.t_dep_mjd2000
        longest = pairs.days_left
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
            all_pairs=pairs,
            hopeful=hopeful,
            pairs=PairCurves(parent[rows], target[rows], t_dep[rows], curves),
            unknown=pairs.take(unknown),
            proposed=len(hops) * count,
            questions=len(hops.legs) * (len(hops) + len(values) * (count - 1)),
        )

    def _hops(self, nodes: Nodes, pairs: PairCurves, tof_days: _Array) -> Hops:
        return self._problem.hops(nodes, pairs.parent, pairs.target, pairs.t_dep_mjd2000, tof_days)
