"""What ``seqsearch run`` does: read, check, search, write, report."""

import os
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

import numpy as np

from feasibility import InputError, Pruner
from feasibility.sims_flanagan.prepare import compile_kernels, sample_leg
from feasibility.workers import worker_pool
from seqsearch.beam import search
from seqsearch.config import build_problem, override, read_config, with_catalogue
from seqsearch.counters import RankCounters
from seqsearch.plots import plot_tour
from seqsearch.pruner_spec import parse_pruner
from seqsearch.run_folder import RunFolder
from seqsearch.state import SearchState
from seqsearch.tour import Tour


def run_search(
    problem_name: str,
    *,
    catalogue: str | None,
    out: Path | None,
    seed: int,
    time_limit_s: float | None,
    workers: int | None,
    overrides: dict[str, Any],
) -> int:
    """Run a search as the command line asks for it and return the exit code.

    Everything is read and checked before the run folder is made.

    Raises
    ------
    InputError
        Anything in the input that cannot be used.
    """
    if seed < 0:
        raise InputError(f"--seed {seed}: expected zero or more")
    if workers is not None and workers < 1:
        raise InputError(f"--workers {workers}: expected one or more")
    config = override(read_config(problem_name), **overrides)
    if catalogue is not None:
        config = with_catalogue(config, catalogue)
    pruner = parse_pruner(config.search.pruner)
    problem = build_problem(config)
    folder = RunFolder.create(out or Path("runs") / config.problem.name, config, seed)
    print(
        f"{problem.name}: {len(problem.catalogue)} bodies from {problem.catalogue.source}, "
        f"seed {seed}, writing to {folder.path}"
    )

    def on_rank(state: SearchState) -> None:
        tour = Tour.from_tree(problem, state.tree, state.best_node)
        folder.write(tour, state.counters)
        print(_rank_line(state.counters[-1], tour), flush=True)

    with worker_pool(workers or os.cpu_count() or 1) as executor:
        if config.search.solver == "fast":
            _compile_side_by_side(executor, pruner)
        result = search(
            problem,
            pruner=pruner,
            settings=config.search,
            rng=np.random.default_rng(seed),
            executor=executor,
            time_limit_s=time_limit_s,
            on_rank=on_rank,
        )
    folder.write(result.tour, result.counters)
    plot_tour(result.tour, folder.path / "tour.png")
    print()
    print(result.tour.table())
    print()
    print(result.tour.one_line())
    print(f"{result.tour.summary()}; search {result.stopped}")
    print(f"check it with: seqsearch verify {folder.path}")
    return 0


def _compile_side_by_side(executor: Executor | None, pruner: Pruner) -> None:
    """Compile the solver's kernels in one worker while this process compiles the pruner's."""
    solver = None if executor is None else executor.submit(compile_kernels)
    pruner.keep(sample_leg())
    if solver is None:
        compile_kernels()
    else:
        solver.result()


def _rank_line(counters: RankCounters, tour: Tour) -> str:
    pruned = ", ".join(f"{name} {count}" for name, count in counters.pruned.items())
    return (
        f"pass {counters.pass_number} rank {counters.rank:>2}: {counters.nodes} nodes, "
        f"{counters.proposed} proposed, pruned {pruned or 'none'}, "
        f"{counters.optimised} optimised, {counters.feasible} feasible, {counters.kept} kept, "
        f"{counters.seconds:.1f} s | best {tour.n_asteroids} asteroids"
    )
