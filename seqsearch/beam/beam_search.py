"""`search`: the beam search itself."""

import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import contextmanager, suppress
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from feasibility import InputError, Pruner
from feasibility.classifier.predictor import LegPredictor
from feasibility.runtime.workers import worker_pool
from seqsearch.beam.assembly import Beam, OwnParts, Tools, assemble
from seqsearch.beam.counters import RankCounters
from seqsearch.beam.expanders.protocol import MakeExpander
from seqsearch.beam.frontiers.protocol import MakeFrontier
from seqsearch.beam.rankings.protocol import Ranking
from seqsearch.beam.rankings.rebalance import rebalanced
from seqsearch.beam.result import SearchResult
from seqsearch.beam.state import SearchState
from seqsearch.budget import Budget
from seqsearch.core.flown_hops import FlownHops
from seqsearch.core.nodes import Nodes
from seqsearch.core.problem import Problem
from seqsearch.core.recording import record_tour
from seqsearch.settings import SearchSettings


def search(
    problem: Problem,
    *,
    pruner: Pruner | None = None,
    predictor: LegPredictor | None = None,
    audit_predictor: LegPredictor | None = None,
    beam_width: int | None = None,
    settings: SearchSettings | None = None,
    ranking: Ranking | None = None,
    frontier: MakeFrontier | None = None,
    expander: MakeExpander | None = None,
    rng: np.random.Generator | None = None,
    executor: Executor | None = None,
    workers: int | None = None,
    threads: int | None = None,
    time_limit_s: float | None = None,
    max_solves: int | None = None,
    resume: SearchState | None = None,
    on_rank: Callable[[SearchState], None] | None = None,
) -> SearchResult:
    """Search for the tour with the most visits.

    Parameters
    ----------
    problem : Problem
        What to solve.
    pruner : Pruner, optional
        Which candidate legs are worth optimising; default: the one that `settings` name.
    predictor : LegPredictor, optional
        Finds flight times, tells which hops are worth optimising; default: the pruner's, if any.
    audit_predictor : LegPredictor, optional
        Sorts the pruned hops for the audit; default: `predictor`.
    beam_width : int, optional
        Overrides ``settings.beam_width``.
    settings : SearchSettings, optional
        How to search.
    ranking : Ranking, optional
        Which nodes to keep; default: the one that `settings` name.
    frontier, expander : callable, optional
        Make the `Frontier` and the `Expander` of each pass; default: those that fit the
        settings and the problem. Scouts are sent out only where both are left out.
    rng : numpy.random.Generator, optional
        Draws the start epochs; default: seed 0. The same seed gives the same
        result with any executor, unless a time limit cuts the search short.
    executor : concurrent.futures.Executor, optional
        Where legs are optimised, if you bring your own; default: `workers`.
    workers : int, optional
        Processes that optimise legs, started and ended by the search; default: 1, this one.
        With more, a script searches under ``if __name__ == "__main__":``, as each imports it.
    threads : int, optional
        Threads of this process that ask the predictor; default: as many as `workers`.
    time_limit_s : float, optional
        Stop after this wall-clock time, sessions before included, with the best tour so far.
        Passes beyond ``settings.passes`` are then run until the time is up.
    max_solves : int, optional
        Stop when this many legs were given to the solver, the audit's not counted; otherwise
        as `time_limit_s`.
    resume : SearchState, optional
        Go on from here. The state is changed.
    on_rank : callable, optional
        Called with the state after each rank; the state changes afterwards. A state whose last
        rank is `cut` does not lead to the result of an uninterrupted search.

    Returns
    -------
    SearchResult
        The best tour and the whole tree. Ctrl-C ends the search early and is no error.

    Raises
    ------
    InputError
        Settings that do not fit the problem, an unreadable pruner, `workers` and an executor.
    PrunerContractError
        The pruner raised, or returned something else than a boolean a leg.
    BrokenExecutor
        Workers died again and again, or those of `executor` died.
    """
    settings = _with_width(settings or SearchSettings(), beam_width)
    rng = rng or np.random.default_rng(0)
    state = resume or SearchState(settings=settings)
    if resume is not None:
        rng.bit_generator.state = resume.rng_state
    stopped = "interrupted"
    with suppress(KeyboardInterrupt), _at_work(executor, workers) as at_work:
        tools = assemble(
            problem,
            settings,
            pruner=pruner,
            predictor=predictor,
            audit_predictor=audit_predictor,
            own=OwnParts(ranking, frontier, expander),
            rng=rng,
            executor=at_work,
            threads=threads or workers or 1,
            budget=Budget(time_limit_s, max_solves, spent_s=state.spent_s, solves=state.solves),
        )
        _run(tools, state, on_rank or (lambda _: None))
        stopped = tools.budget.ending()
    tour = record_tour(problem, state.tree, state.best_node, state.closing)
    return SearchResult(tour, state.tree, state.counters, stopped)


def _with_width(settings: SearchSettings, beam_width: int | None) -> SearchSettings:
    return settings if beam_width is None else settings.with_(beam_width=beam_width)


@contextmanager
def _at_work(executor: Executor | None, workers: int | None) -> Iterator[Executor | None]:
    """Yield the caller's executor, or a pool of our own where a number of workers is given."""
    if executor is not None and workers is not None:
        raise InputError(f"search: workers = {workers} and an executor; expected one of them")
    if workers is not None and workers < 1:
        raise InputError(f"search: workers = {workers}, expected one or more")
    if workers is None:
        yield executor
        return
    with worker_pool(workers) as pool:
        yield pool


def _run(tools: Tools, state: SearchState, on_rank: Callable[[SearchState], None]) -> None:
    """Run pass after pass, rank after rank."""

    def report(waiting: Nodes) -> None:
        state.waiting = waiting if len(waiting) else None
        state.rng_state = dict(tools.rng.bit_generator.state)
        state.spent_s, state.solves = tools.budget.spent_s, tools.budget.solves
        on_rank(state)

    for starts in tools.passes.begin(state, report):
        beam = tools.beam(state)
        beam.frontier.push(starts)
        while len(waiting := beam.frontier.waiting()) and not tools.budget.used_up():
            if beam.guide.free:
                width = tools.pacing.width(waiting, state.settings, state.counters)
                state.settings = state.settings.with_(beam_width=width)
            _run_rank(tools, beam, state)
            report(beam.frontier.waiting())
        state.waiting = None


def _run_rank(tools: Tools, beam: Beam, state: SearchState) -> None:
    """Expand the nodes that are next, audit, and let the best of what was found go on."""
    began = time.perf_counter()
    settings = beam.guide.settings(state.settings)
    nodes = beam.frontier.pop(settings.beam_width)
    nodes = tools.pacing.narrowed(beam.guide, nodes, state.counters)
    counters = RankCounters(
        pass_number=state.pass_number, rank=int(nodes.depth.max()) + 1, nodes=len(nodes)
    )
    sample = tools.auditor.sample(state)
    affordable = settings.with_(solves_per_rank=tools.budget.affordable(settings.solves_per_rank))
    found = beam.expander.expand(
        nodes, beam.frontier, affordable, counters, sample, tools.budget.deadline
    )
    tools.budget.charge(found.n_legs)
    counters.optimised, counters.feasible = found.n_hops, len(found.nodes)
    clock = time.perf_counter()
    counters.audit = sample.solve(
        tools.problem,
        nodes,
        tools.optimiser,
        settings.solver,
        tools.budget.deadline,
        lambda lost: _contends(lost, found, beam, settings.beam_width),
    )
    counters.seconds_audit = time.perf_counter() - clock
    kept = _hung(tools, found, beam.frontier.admit(found.nodes, settings.beam_width), state)
    if len(kept):
        beam.frontier.push(kept)
    tools.best.note(kept, state)
    counters.kept = len(kept)
    counters.cut = tools.budget.used_up()
    counters.seconds = time.perf_counter() - began
    state.counters.append(counters)
    if not counters.cut and beam.guide.free and len(beam.frontier.waiting()) == 0:
        state.settings = rebalanced(state.settings, nodes, tools.problem)


def _hung(tools: Tools, found: FlownHops, rows: NDArray[np.intp], state: SearchState) -> Nodes:
    """Hang the nodes that go on into the tree and return them with their ids."""
    kept = found.nodes.take(rows)
    legs = found.legs(tools.problem, rows)
    ids = [
        state.tree.add_hop(int(parent), chain)
        for parent, chain in zip(kept.parent_id, legs, strict=True)
    ]
    return replace(kept, tree_id=np.asarray(ids, dtype=np.int64))


def _contends(lost: Nodes, found: FlownHops, beam: Beam, width: int) -> NDArray[np.bool_]:
    """Return (n,) which of n pruned but flyable nodes would have gone on."""
    n = len(found.nodes)
    chosen = beam.frontier.admit(Nodes.concatenate([found.nodes, lost]), width)
    if not beam.guide.free:
        # A guided pass keeps all it finds: what is lost must be better than some of it.
        chosen = chosen[: max(1, n)]
    return np.isin(np.arange(n, n + len(lost)), chosen)
