"""`search`: the beam search itself."""

import time
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility import AllOf, InputError, Pruner
from feasibility.classifier.predictor import LegPredictor
from feasibility.orbits import OrbitalNeighbours
from seqsearch.beam.counters import RankCounters
from seqsearch.beam.expanders.custom_moves import OwnMovesExpander
from seqsearch.beam.expanders.forecast import Expander, ForecastExpander, GridExpander
from seqsearch.beam.frontiers.depth import Frontier, make_frontier, no_nodes
from seqsearch.beam.passes import Pacer, rebalanced
from seqsearch.beam.rankings import make_ranking
from seqsearch.beam.rankings.protocol import Ranking, TimePropellantRanking
from seqsearch.beam.scouting.generations import season
from seqsearch.beam.scouting.guide import Guide, guided, starts_of
from seqsearch.beam.scouting.scouts import Camp
from seqsearch.beam.starts import dense_starts, reachable_starts
from seqsearch.beam.state import SearchState
from seqsearch.core.custom_moves import OwnMoves
from seqsearch.core.flown_hops import FlownHops, flown_legs
from seqsearch.core.nodes import Nodes
from seqsearch.core.optimisation import LegOptimiser
from seqsearch.core.problem import TourProblem
from seqsearch.core.tree import SearchTree
from seqsearch.deadline import Deadline
from seqsearch.polish.best_nodes import best_nodes
from seqsearch.pruning.audit import RankSample
from seqsearch.pruning.pruner_spec import parse_pruner, predictor_of
from seqsearch.settings import SearchSettings
from seqsearch.tours.tour import Tour

_ITINERARIES: Final = 150
"""Itineraries that a pass optimises, where scouts found so many."""


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
        ``"complete"``, ``"time limit"``, ``"solve limit"`` or ``"interrupted"``.
    """

    tour: Tour
    tree: SearchTree
    counters: list[RankCounters]
    stopped: str

    def best_tours(self, problem: TourProblem, count: int) -> list[Tour]:
        """Return tours that visit different bodies, best first, for a polish to start from.

        Most visits first, then the least sum of the shares of time and propellant used up.
        """
        return [
            Tour.from_tree(problem, self.tree, node)
            for node in best_nodes(self.tree, problem, count)
        ]


def search(
    problem: TourProblem,
    *,
    pruner: Pruner | None = None,
    predictor: LegPredictor | None = None,
    audit_predictor: LegPredictor | None = None,
    beam_width: int | None = None,
    settings: SearchSettings | None = None,
    ranking: Ranking | None = None,
    rng: np.random.Generator | None = None,
    executor: Executor | None = None,
    threads: int = 1,
    time_limit_s: float | None = None,
    max_solves: int | None = None,
    resume: SearchState | None = None,
    on_rank: Callable[[SearchState], None] | None = None,
) -> SearchResult:
    """Search for the tour with the most visits.

    Parameters
    ----------
    problem : TourProblem
        What to solve.
    pruner : Pruner, optional
        Which candidate legs are worth optimising; default: the one that
        `settings` name.
    predictor : LegPredictor, optional
        Finds flight times and tells which hops are worth optimising; default:
        the classifier of the pruner, if that has one.
    audit_predictor : LegPredictor, optional
        Sorts the pruned hops for the audit; default: `predictor`.
    beam_width : int, optional
        Overrides ``settings.beam_width``.
    settings : SearchSettings, optional
        How to search.
    ranking : Ranking, optional
        Which nodes to keep; default: the one that `settings` name.
    rng : numpy.random.Generator, optional
        Draws the start epochs; default: seed 0. The same seed gives the same
        result with any executor, unless a time limit cuts the search short.
    executor : concurrent.futures.Executor, optional
        Where legs are optimised; default: this process.
    threads : int
        Threads of this process that ask the predictor.
    time_limit_s : float, optional
        Stop after this wall-clock time, sessions before included, with the best
        tour so far. Passes beyond ``settings.passes`` are then run until the
        time is up.
    max_solves : int, optional
        Stop when this many legs were given to the solver, the audit's not
        counted; otherwise as `time_limit_s`.
    resume : SearchState, optional
        Go on from here. The state is changed.
    on_rank : callable, optional
        Called with the state after each rank; the state changes afterwards.
        A state whose last rank is `cut` does not lead to the result of an
        uninterrupted search.

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
    PrunerContractError
        The pruner raised, or returned something else than a boolean a leg.
    BrokenExecutor
        The workers of `executor` died.
    """
    settings = settings or SearchSettings()
    if beam_width is not None:
        settings = settings.with_(beam_width=beam_width)
    rng = rng or np.random.default_rng(0)
    state = resume or SearchState(settings=settings)
    if resume is not None:
        rng.bit_generator.state = resume.rng_state
    pruner = pruner or parse_pruner(settings.pruner)
    predictor = predictor or predictor_of(pruner)
    return _Search(
        problem,
        settings,
        pruner,
        predictor,
        audit_predictor or predictor,
        ranking,
        executor,
        Deadline(None if time_limit_s is None else time_limit_s - state.spent_s),
        max_solves,
        state,
        rng,
        on_rank,
        threads,
    ).run(endless=time_limit_s is not None or max_solves is not None)


@final
class _Search:
    """A search that runs: what it was given, and its state."""

    def __init__(
        self,
        problem: TourProblem,
        settings: SearchSettings,
        pruner: Pruner,
        predictor: LegPredictor | None,
        audit_predictor: LegPredictor | None,
        ranking: Ranking | None,
        executor: Executor | None,
        deadline: Deadline,
        max_solves: int | None,
        state: SearchState,
        rng: np.random.Generator,
        on_rank: Callable[[SearchState], None] | None,
        threads: int,
    ) -> None:
        self._problem = problem
        self._settings = settings
        self._pruner = pruner if isinstance(pruner, AllOf) else AllOf(pruner)
        self._predictor = predictor
        self._audit_predictor = audit_predictor
        self._optimiser = LegOptimiser(executor)
        self._deadline = deadline
        self._max_solves = max_solves
        self._state = state
        self._rng = rng
        self._on_rank = on_rank
        self._neighbours = OrbitalNeighbours(
            problem.catalogue, reference_tof_days=settings.reference_tof_days
        )
        self._given_ranking = ranking
        self._threads = threads
        self._pacer = None if deadline.remaining_s() is None else Pacer(problem, deadline)
        # Passes may rank differently; which of two tours is better must not depend on it.
        self._judge = TimePropellantRanking(settings.time_weight, settings.propellant_weight)
        self._camp = self._make_camp(executor)
        self._spent_before = state.spent_s
        self._began = time.monotonic()

    def run(self, *, endless: bool) -> SearchResult:
        state = self._state
        stopped = "complete"
        try:
            if state.waiting is not None:
                self._begin_pass()
                self._run_pass(state.waiting)
            while (
                endless or state.pass_number < self._settings.passes
            ) and not self._out_of_budget():
                state.pass_number += 1
                # What was loaded at the end of a pass still names the guide of that pass.
                state.guide = None
                self._begin_pass()
                scouted = self._camp is not None and self._scout(self._camp)
                if self._out_of_budget():
                    break
                nodes = self._start_nodes()
                if scouted:
                    self._report(nodes)
                self._run_pass(nodes)
        except KeyboardInterrupt:
            stopped = "interrupted"
        if stopped == "complete" and self._deadline.passed():
            stopped = "time limit"
        elif stopped == "complete" and self._out_of_budget():
            stopped = "solve limit"
        return SearchResult(self._best_tour(), state.tree, state.counters, stopped)

    def _begin_pass(self) -> None:
        """Under a time limit, about as many starts as the beam is going to be wide."""
        if self._pacer is None:
            return
        state = self._state
        self._pacer.begin_pass(state.pass_number, scouted=self._camp is not None)
        width = self._pacer.width(no_nodes(), state.settings, state.counters)
        starts = max(width, min(2 * width, self._settings.starts))
        screen_legs = max(self._pacer.screen_legs(), self._settings.screen_legs)
        state.settings = state.settings.with_(
            beam_width=width,
            starts=starts,
            screen_legs=screen_legs,
            start_epochs=self._pacer.start_epochs(self._settings),
        )

    def _make_camp(self, executor: Executor | None) -> Camp | None:
        """Return what sends out scouts; None where a search does without."""
        settings = self._settings
        wanted = settings.scout_generations if self._pacer is None else settings.scout_share
        plain = settings.ranking in ("weighted", "balanced") and settings.frontier == "depth"
        if not (wanted and plain) or self._given_ranking is not None:
            return None
        if self._predictor is None or isinstance(self._problem, OwnMoves):
            return None
        return Camp(self._problem, self._predictor, settings, executor)

    def _scout(self, camp: Camp) -> bool:
        """Look for itineraries, to which the pass will keep; False where there were none."""
        state, pacer = self._state, self._pacer
        counters = RankCounters(pass_number=state.pass_number, rank=0)
        seconds = None
        if pacer is not None:
            seconds = state.settings.scout_share * pacer.seconds_of_pass()
        pool = season(
            camp,
            state.pool,
            state.settings,
            self._rng,
            counters,
            seconds=seconds,
            workers=self._threads,
            over=self._out_of_budget,
        )
        state.pool, guide = pool.unflown(_ITINERARIES)
        state.guide = guide if len(guide) else None
        counters.kept = len(guide)
        state.counters.append(counters)
        return state.guide is not None

    def _make_ranking(self) -> Ranking:
        return self._given_ranking or make_ranking(
            self._state.settings, self._predictor, self._neighbours
        )

    def _make_expander(self, ranking: Ranking) -> Expander:
        problem = self._problem
        means = (problem, self._neighbours, self._pruner, ranking, self._optimiser)
        if isinstance(problem, OwnMoves):
            if self._predictor is None:
                raise InputError(
                    f"problem {problem.name}: its moves need a trained model, such as the pruner "
                    "default:0.99"
                )
            return OwnMovesExpander(
                problem,
                problem,
                self._predictor,
                self._pruner,
                ranking,
                self._optimiser,
                self._threads,
            )
        if self._predictor is None:
            return GridExpander(*means)
        guide = None if self._state.guide is None else Guide(self._state.guide)
        return ForecastExpander(*means, self._predictor, self._threads, guide)

    def _run_pass(self, nodes: Nodes) -> None:
        """Run a pass from its starts, or go on with one."""
        state = self._state
        ranking = self._make_ranking()
        expander = self._make_expander(ranking)
        frontier = make_frontier(self._of_pass(), self._problem, ranking)
        frontier.push(nodes)
        while len(nodes := frontier.pop()) and not self._out_of_budget():
            if self._pacer is not None and state.guide is None:
                width = self._pacer.width(nodes, state.settings, state.counters)
                state.settings = state.settings.with_(beam_width=width)
                frontier = _remade(frontier, state.settings, self._problem, ranking)
                if nodes.depth.min() > 0:
                    nodes = nodes.take(np.arange(min(len(nodes), width)))
            counters = RankCounters(
                pass_number=state.pass_number, rank=int(nodes.depth.max()) + 1, nodes=len(nodes)
            )
            start = time.perf_counter()
            sample = self._sample()
            expanded = expander.expand(
                nodes, frontier, self._affordable(), counters, sample, self._deadline
            )
            found = None
            if expanded is not None and expanded.optimised.solved is not None:
                found = FlownHops.of(self._problem, nodes, expanded.candidates, expanded.optimised)
            if expanded is not None:
                counters.optimised = expanded.optimised.n_hops
                counters.feasible = len(expanded.optimised.candidate)
                state.solves += expanded.optimised.n_legs
            if sample is not None:
                self._audit(sample, frontier, nodes, found, counters)
            if found is not None:
                self._advance(frontier, found, counters)
            counters.cut = self._out_of_budget()
            counters.seconds = time.perf_counter() - start
            state.counters.append(counters)
            if not counters.cut and frontier.waiting() is None and state.guide is None:
                state.settings = rebalanced(state.settings, nodes, self._problem)
            self._report(frontier.waiting())
        state.waiting = None

    def _of_pass(self) -> SearchSettings:
        """Return the settings of the pass."""
        settings, guide = self._state.settings, self._state.guide
        return settings if guide is None else guided(settings, len(guide))

    def _out_of_budget(self) -> bool:
        spent = self._max_solves is not None and self._state.solves >= self._max_solves
        return spent or self._deadline.passed()

    def _affordable(self) -> SearchSettings:
        """Return the settings of the pass, with no more solves than are left."""
        settings = self._of_pass()
        if self._max_solves is None:
            return settings
        left = self._max_solves - self._state.solves
        return settings.with_(solves_per_rank=min(left, settings.solves_per_rank))

    def _report(self, waiting: Nodes | None) -> None:
        state = self._state
        state.waiting = waiting
        state.rng_state = dict(self._rng.bit_generator.state)
        state.spent_s = self._spent_before + time.monotonic() - self._began
        if self._on_rank is not None:
            self._on_rank(state)

    def _start_nodes(self) -> Nodes:
        state = self._state
        if state.guide is not None:
            nodes = self._problem.start_nodes(*starts_of(state.guide))
        elif isinstance(self._problem, OwnMoves):
            nodes = self._problem.starts(state.settings, self._rng)
        else:
            nodes = self._problem.start_nodes(*self._choose_starts())
        ids = [
            state.tree.add_start(int(row), float(t), float(mass))
            for row, t, mass in zip(nodes.row, nodes.t_first_mjd2000, nodes.mass, strict=True)
        ]
        nodes = replace(nodes, tree_id=np.asarray(ids, dtype=np.int64))
        self._note_best(nodes)
        return nodes

    def _choose_starts(self) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
        settings = self._state.settings
        if self._predictor is None:
            return dense_starts(self._problem, self._neighbours, settings, self._rng)
        return reachable_starts(
            self._problem,
            self._neighbours,
            self._predictor,
            settings,
            self._rng,
            self._threads,
        )

    def _sample(self) -> RankSample | None:
        """Return what draws this rank's audit; None without an audit or a pruner."""
        solves = self._state.settings.audit_per_rank
        if solves == 0 or self._pruner.pruners == ():
            return None
        if self._pacer is not None and not self._pacer.audits(self._state.counters):
            return None
        return RankSample(self._rng, len(self._state.counters), solves, self._audit_predictor)

    def _audit(
        self,
        sample: RankSample,
        frontier: Frontier,
        nodes: Nodes,
        found: FlownHops | None,
        counters: RankCounters,
    ) -> None:
        def contends(lost: Nodes) -> NDArray[np.bool_]:
            n = 0 if found is None else len(found.nodes)
            rivals = lost if found is None else Nodes.concatenate([found.nodes, lost])
            chosen = frontier.admit(rivals)
            if self._state.guide is not None:
                # A guided pass keeps all it finds: what is lost must be better than some of it.
                chosen = chosen[: max(1, n)]
            return np.isin(np.arange(n, n + len(lost)), chosen)

        clock = time.perf_counter()
        counters.audit = sample.solve(
            self._problem,
            nodes,
            self._optimiser,
            self._state.settings.solver,
            self._deadline,
            contends,
        )
        counters.seconds_audit = time.perf_counter() - clock

    def _advance(self, frontier: Frontier, found: FlownHops, counters: RankCounters) -> None:
        """Hang the nodes that go on into the tree and into the frontier."""
        chosen = frontier.admit(found.nodes)
        chains = flown_legs(self._problem, found.flown.take(chosen), found.solved.take(chosen))
        ids = [
            self._state.tree.add_hop(int(parent), chain)
            for parent, chain in zip(found.nodes.parent_id[chosen], chains, strict=True)
        ]
        kept = replace(found.nodes.take(chosen), tree_id=np.asarray(ids, dtype=np.int64))
        if len(kept):
            frontier.push(kept)
        counters.kept = len(kept)
        self._note_best(kept)

    def _note_best(self, nodes: Nodes) -> None:
        """Remember the deepest node; among equally deep ones that of the best score."""
        if len(nodes) == 0:
            return
        deepest = nodes.take(nodes.depth == nodes.depth.max())
        scores = self._judge.score(deepest, self._problem)
        best = int(np.argmin(scores))
        key = (int(deepest.depth[0]), -float(scores[best]))
        if key > self._state.best_key:
            self._state.best_key = key
            self._state.best_node = int(deepest.tree_id[best])

    def _best_tour(self) -> Tour:
        return Tour.from_tree(self._problem, self._state.tree, self._state.best_node)


def _remade(
    frontier: Frontier, settings: SearchSettings, problem: TourProblem, ranking: Ranking
) -> Frontier:
    """Return the frontier as it is, with other settings."""
    waiting = frontier.waiting()
    remade = make_frontier(settings, problem, ranking)
    if waiting is not None:
        remade.push(waiting)
    return remade
