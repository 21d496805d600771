"""`search`: the beam search itself."""

import time
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import final

import numpy as np
from numpy.typing import NDArray

from feasibility import AllOf, Pruner
from feasibility.orbits import OrbitalNeighbours
from feasibility.orbits.lambert import lambert
from seqsearch.counters import RankCounters
from seqsearch.deadline import Deadline
from seqsearch.expansion import Candidates, expand, reached
from seqsearch.nodes import Nodes
from seqsearch.optimisation import LegOptimiser, Optimised
from seqsearch.problem import Problem
from seqsearch.pruner_spec import parse_pruner
from seqsearch.ranking import Ranking, TimePropellantRanking
from seqsearch.selection import select
from seqsearch.settings import SearchSettings
from seqsearch.starts import dense_starts
from seqsearch.tour import Tour
from seqsearch.tree import FlownLeg, SearchTree


@final
@dataclass(frozen=True, eq=False)
class SearchResult:
    """What a search found.

    Attributes
    ----------
    tour : Tour
        The best tour: most legs, then best score. It may have no leg.
    tree : SearchTree
        Every node that the beam kept, over all passes.
    counters : list of RankCounters
        One record for each rank of each pass.
    stopped : str
        ``"complete"``, ``"time limit"`` or ``"interrupted"``.
    """

    tour: Tour
    tree: SearchTree
    counters: list[RankCounters]
    stopped: str


def search(
    problem: Problem,
    *,
    pruner: Pruner | None = None,
    beam_width: int | None = None,
    settings: SearchSettings | None = None,
    ranking: Ranking | None = None,
    rng: np.random.Generator | None = None,
    executor: Executor | None = None,
    time_limit_s: float | None = None,
    on_rank: Callable[[RankCounters, Tour], None] | None = None,
) -> SearchResult:
    """Search for the tour with the most visits.

    Parameters
    ----------
    problem : Problem
        What to solve.
    pruner : Pruner, optional
        Which candidate legs are worth optimising; default: the one that
        `settings` name.
    beam_width : int, optional
        Overrides ``settings.beam_width``.
    settings : SearchSettings, optional
        How to search.
    ranking : Ranking, optional
        Which nodes to keep; default: weighted time and propellant.
    rng : numpy.random.Generator, optional
        Draws the start epochs; default: seed 0. The same seed gives the same
        result with any executor, unless a time limit cuts the search short.
    executor : concurrent.futures.Executor, optional
        Where legs are optimised; default: this process.
    time_limit_s : float, optional
        Stop after this wall-clock time with the best tour so far. Passes
        beyond ``settings.passes`` are then run until the time is up.
    on_rank : callable, optional
        Called after each rank with its counters and the best tour so far.

    Returns
    -------
    SearchResult
        The best tour and the whole tree. An interrupt from the keyboard ends
        the search early and is no error.

    Raises
    ------
    InputError
        Settings that do not fit the problem, or a pruner specification that
        cannot be read.
    """
    settings = settings or SearchSettings()
    if beam_width is not None:
        settings = settings.with_(beam_width=beam_width)
    return _Search(
        problem,
        settings,
        pruner or parse_pruner(settings.pruner),
        ranking or TimePropellantRanking(settings.time_weight, settings.propellant_weight),
        LegOptimiser(settings, executor),
        Deadline(time_limit_s),
        on_rank,
    ).run(rng or np.random.default_rng(0), endless=time_limit_s is not None)


@final
class _Search:
    """The state of one search: tree, counters and best node so far."""

    def __init__(
        self,
        problem: Problem,
        settings: SearchSettings,
        pruner: Pruner,
        ranking: Ranking,
        optimiser: LegOptimiser,
        deadline: Deadline,
        on_rank: Callable[[RankCounters, Tour], None] | None,
    ) -> None:
        self._problem = problem
        self._settings = settings
        self._pruner = pruner if isinstance(pruner, AllOf) else AllOf(pruner)
        self._ranking = ranking
        self._optimiser = optimiser
        self._deadline = deadline
        self._on_rank = on_rank
        self._neighbours = OrbitalNeighbours(
            problem.catalogue, reference_tof_days=settings.reference_tof_days
        )
        self._tree = SearchTree()
        self._counters: list[RankCounters] = []
        self._best_node = -1
        self._best_key = (-1, 0.0)

    def run(self, rng: np.random.Generator, *, endless: bool) -> SearchResult:
        stopped = "complete"
        pass_number = 0
        try:
            while (endless or pass_number < self._settings.passes) and not self._deadline.passed():
                pass_number += 1
                self._run_pass(pass_number, rng)
        except KeyboardInterrupt:
            stopped = "interrupted"
        if stopped == "complete" and self._deadline.passed():
            stopped = "time limit"
        return SearchResult(self._best_tour(), self._tree, self._counters, stopped)

    def _run_pass(self, pass_number: int, rng: np.random.Generator) -> None:
        nodes = self._start_nodes(rng)
        while len(nodes) and not self._deadline.passed():
            counters = RankCounters(pass_number=pass_number, rank=nodes.rank + 1, nodes=len(nodes))
            start = time.perf_counter()
            candidates = self._prune(nodes, counters)
            optimised = self._optimise(nodes, candidates, counters)
            nodes = self._next_rank(nodes, candidates, optimised)
            counters.kept = len(nodes)
            counters.seconds = time.perf_counter() - start
            self._counters.append(counters)
            if self._on_rank is not None:
                self._on_rank(counters, self._best_tour())

    def _start_nodes(self, rng: np.random.Generator) -> Nodes:
        rows, epochs = dense_starts(self._problem, self._neighbours, self._settings, rng)
        m0 = self._problem.m0
        ids = [
            self._tree.add_start(int(row), float(t), m0)
            for row, t in zip(rows, epochs, strict=True)
        ]
        nodes = Nodes(
            row=rows,
            t_ready_mjd2000=epochs,
            t_arr_mjd2000=epochs,
            t_first_mjd2000=epochs,
            mass=np.full(len(rows), m0),
            visited=rows[:, None],
            tree_id=np.asarray(ids, dtype=np.int64),
        )
        self._note_best(nodes)
        return nodes

    def _prune(self, nodes: Nodes, counters: RankCounters) -> Candidates | None:
        """Propose candidates and return those that every pruner keeps."""
        kept = []
        clock = time.perf_counter()
        for block in expand(self._problem, nodes, self._neighbours, self._settings):
            counters.proposed += len(block)
            counters.seconds_expand += time.perf_counter() - clock
            clock = time.perf_counter()
            mask, pruned = self._pruner.keep_with_counts(block.legs)
            counters.count_pruned(pruned)
            counters.seconds_prune += time.perf_counter() - clock
            clock = time.perf_counter()
            if mask.any():
                kept.append(block.take(mask))
            if self._deadline.passed():
                break
        return Candidates.concatenate(kept) if kept else None

    def _optimise(
        self, nodes: Nodes, candidates: Candidates | None, counters: RankCounters
    ) -> Optimised | None:
        if candidates is None:
            return None
        clock = time.perf_counter()
        promise = self._promise(nodes, candidates)
        optimised = self._optimiser.run(candidates, promise, self._deadline)
        counters.optimised = optimised.n_optimised
        counters.feasible = len(optimised.candidate)
        counters.seconds_optimise = time.perf_counter() - clock
        return optimised

    def _promise(self, nodes: Nodes, candidates: Candidates) -> NDArray[np.float64]:
        """Predict the score of the node that each leg leads to.

        The propellant is that of the zero-revolution Lambert arc, and no more
        than what the engine can burn in the time of flight.
        """
        legs = candidates.legs
        v_dep, v_arr = lambert(legs.rv_dep[:, :3], legs.rv_arr[:, :3], legs.tof_s, max_revs=0)
        delta_v = np.linalg.norm(v_dep[:, 0] - legs.rv_dep[:, 3:], axis=1) + np.linalg.norm(
            v_arr[:, 0] - legs.rv_arr[:, 3:], axis=1
        )
        burnt = legs.m0 * -np.expm1(-np.nan_to_num(delta_v, nan=np.inf) / legs.exhaust_velocity)
        most = legs.thrust / legs.exhaust_velocity * legs.tof_s
        m_final = np.maximum(legs.m0 - np.minimum(burnt, most), legs.m_dry)
        return self._ranking.score(
            reached(self._problem, nodes, candidates, m_final), self._problem
        )

    def _next_rank(
        self, nodes: Nodes, candidates: Candidates | None, optimised: Optimised | None
    ) -> Nodes:
        """Select the best of the nodes that were reached and hang them into the tree."""
        if candidates is None or optimised is None or len(optimised.candidate) == 0:
            return nodes.take(np.zeros(0, dtype=np.intp))
        flown = candidates.take(optimised.candidate)
        found = reached(self._problem, nodes, flown, optimised.solutions.m_final)
        scores = self._ranking.score(found, self._problem)
        chosen = select(scores, found, flown.parent, self._settings)
        tree_id = found.tree_id.copy()
        for i in chosen:
            leg = _flown_leg(flown, optimised, int(i), nodes)
            tree_id[i] = self._tree.add_leg(int(nodes.tree_id[flown.parent[i]]), leg)
        kept = replace(found, tree_id=tree_id).take(chosen)
        self._note_best(kept)
        return kept

    def _note_best(self, nodes: Nodes) -> None:
        """Remember the deepest node; among equally deep ones that of the best score."""
        if len(nodes) == 0:
            return
        scores = self._ranking.score(nodes, self._problem)
        best = int(np.argmin(scores))
        if (nodes.rank, -scores[best]) > self._best_key:
            self._best_key = (nodes.rank, -float(scores[best]))
            self._best_node = int(nodes.tree_id[best])

    def _best_tour(self) -> Tour:
        return Tour.from_tree(self._problem, self._tree, self._best_node)


def _flown_leg(flown: Candidates, optimised: Optimised, i: int, nodes: Nodes) -> FlownLeg:
    legs = flown.legs
    assert legs.t_dep_mjd2000 is not None
    return FlownLeg(
        dep_row=int(nodes.row[flown.parent[i]]),
        arr_row=int(flown.target[i]),
        t_dep_mjd2000=float(legs.t_dep_mjd2000[i]),
        tof_days=float(legs.tof_days[i]),
        m0=float(legs.m0[i]),
        m_final=float(optimised.solutions.m_final[i]),
        m_star=float(optimised.m_star[i]),
        throttles=optimised.solutions.throttles[i],
        mismatch=float(optimised.solutions.mismatch[i]),
    )
