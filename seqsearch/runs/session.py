"""A session of a run: searches from a state on, writes the run folder, reports on screen."""

import sys
from concurrent.futures import BrokenExecutor, Executor
from pathlib import Path
from typing import Final

import numpy as np

from feasibility import AllOf, Pruner
from feasibility.classifier.predictor import LegPredictor
from feasibility.pruners import PrunerContractError
from feasibility.runtime.cluster import ClusterExecutor
from feasibility.runtime.interrupts import interrupt_code
from feasibility.runtime.terminal import Level, say
from feasibility.runtime.workers import MendingPool, default_workers
from feasibility.sims_flanagan.fast.compilation import compile_kernels, sample_leg
from seqsearch.beam.beam_search import search
from seqsearch.beam.result import SearchResult
from seqsearch.beam.state import SearchState
from seqsearch.budget import Limits
from seqsearch.core.problem import Problem
from seqsearch.core.recording import record_tour
from seqsearch.problems.problem_file import Config
from seqsearch.pruning.audit_estimate import AuditEstimate
from seqsearch.pruning.pruner_spec import predictor_of
from seqsearch.runs.checkpoint import Checkpoints
from seqsearch.runs.progress import Progress
from seqsearch.runs.run_folder import RunFolder
from seqsearch.tours.pictures.plots import plot_tour

PACKAGES: Final = ("feasibility", "seqsearch")
"""What has to be the same on all workers of a cluster."""


def run_session(
    folder: RunFolder,
    checkpoints: Checkpoints,
    state: SearchState,
    *,
    config: Config,
    problem: Problem,
    pruner: AllOf,
    limits: Limits,
    executor: MendingPool | ClusterExecutor | None,
) -> int:
    """Search from a state to the end, or until a budget is used up, and return the exit code.

    Returns
    -------
    int
        0; 1 where the worker processes died again and again; 2 where the pruner
        broke its contract; 130 or 143 after Ctrl-C or SIGTERM. What was found until then is
        in the run folder.
    """

    def on_rank(state: SearchState) -> None:
        # A rank that a budget cut short is repeated on resuming, so that the result is the same.
        if not state.counters[-1].cut:
            checkpoints.save(state)
        tour = record_tour(problem, state.tree, state.best_node, state.closing)
        folder.write(tour, state.counters)
        progress.rank(state.counters[-1], tour)

    workers = limits.workers or default_workers()
    progress = Progress(limits.time_limit_s, state.spent_s)
    try:
        with progress.alive():
            if config.search.solver == "fast":
                _compile_side_by_side(executor, pruner)
            result = search(
                problem,
                pruner=pruner,
                audit_predictor=_audit_predictor(config, pruner),
                settings=config.search,
                rng=np.random.default_rng(checkpoints.origin.seed),
                executor=executor,
                threads=workers,
                time_limit_s=limits.time_limit_s,
                max_solves=limits.max_solves,
                resume=state,
                on_rank=on_rank,
            )
            mended = 0 if executor is None else executor.mended
            if executor is not None and result.stopped == "interrupted":
                executor.abandon()
    except (PrunerContractError, BrokenExecutor) as error:
        print(f"seqsearch: {error}", file=sys.stderr)
        print(f"all ranks before are saved: {_go_on(folder.path)}", file=sys.stderr)
        return 2 if isinstance(error, PrunerContractError) else 1
    folder.write(result.tour, result.counters)
    plot_tour(result.tour, folder.path / "tour.png")
    _report(folder.path, result, mended)
    return interrupt_code()


def _audit_predictor(config: Config, pruner: AllOf) -> LegPredictor | None:
    """Return what sorts the audit's legs: the default model, where the pruner has none."""
    if config.search.audit.per_rank == 0 or pruner.pruners == ():
        return None
    # Imported here: a search without audit and model should not pay for the model's kernels.
    from feasibility.classifier.classifier import FeasibilityClassifier

    return predictor_of(pruner) or FeasibilityClassifier.load()


def _report(path: Path, result: SearchResult, mended: int) -> None:
    tour, counters = result.tour, result.counters
    say(level=Level.PROGRESS)
    if tour.legs:
        say(tour.table(), Level.PROGRESS)
        say(level=Level.PROGRESS)
    if counters and (barren := counters[-1].barren_pruner()):
        say(f"no leg survived pruner {barren} at rank {counters[-1].rank}", Level.PROGRESS)
    if mended:
        say(f"workers were lost {mended} times; others did their work again", Level.PROGRESS)
    audits = [record.audit for record in counters if record.audit is not None]
    if audits:
        say(AuditEstimate.of(audits).one_line(), Level.PROGRESS)
    optimised = sum(record.optimised for record in counters)
    if optimised:
        failed = 100.0 * (1.0 - sum(record.feasible for record in counters) / optimised)
        say(
            f"{optimised} legs optimised, {failed:.1f} % of them could not be flown",
            Level.PROGRESS,
        )
    if tour.bodies:
        say(tour.one_line())
        say(f"{tour.summary()}; search {result.stopped}")
    else:
        say(f"nothing found yet (search {result.stopped}); give more time")
    if result.stopped != "complete":
        say(_go_on(path), Level.PROGRESS)
    if tour.legs:
        say(f"check it with: seqsearch verify {path}", Level.PROGRESS)


def _go_on(path: Path) -> str:
    return f"go on with: seqsearch resume {path}"


def _compile_side_by_side(executor: Executor | None, pruner: Pruner) -> None:
    """Compile the solver's kernels in one worker while this process compiles the pruner's."""
    # Imported here: it loads numba.
    from feasibility.runtime.jit import rare_collections

    solver = None if executor is None else executor.submit(compile_kernels)
    with rare_collections():
        pruner.keep(sample_leg())
    if solver is None:
        compile_kernels()
    else:
        solver.result()
