"""What ``seqsearch run`` does: read, check, begin a run folder, search."""

from pathlib import Path
from typing import Any

import numpy as np

from feasibility import InputError
from seqsearch.beam.state import SearchState
from seqsearch.commands.fleet import run_fleet
from seqsearch.commands.polish import polish_run
from seqsearch.problems.problem_file import (
    Config,
    build_problem,
    override,
    read_config,
    with_catalogue,
)
from seqsearch.pruning.pruner_spec import parse_pruner
from seqsearch.runs.checkpoint import Checkpoints, Origin, catalogue_digest
from seqsearch.runs.run_folder import RunFolder
from seqsearch.runs.session import Budget, run_session


def run_search(
    problem_name: str,
    *,
    catalogue: str | None,
    out: Path | None,
    seed: int,
    budget: Budget,
    overrides: dict[str, Any],
    polish_s: float | None = None,
) -> int:
    """Run a search as the command line asks for it and return the exit code.

    With `polish_s`, the best tours are polished for so many seconds afterwards.
    A fleet polishes each probe within the time limit instead.

    Everything is read and checked before the run folder is made.

    Raises
    ------
    InputError
        Anything in the input that cannot be used.
    """
    if seed < 0:
        raise InputError(f"--seed {seed}: expected zero or more")
    config = override(read_config(problem_name), **overrides)
    if catalogue is not None:
        config = with_catalogue(config, catalogue)
    if config.catalogue.file is not None:
        # The run folder's copy is read from elsewhere when the run is resumed.
        config = with_catalogue(config, str(Path(config.catalogue.file).absolute()))
    folder = out or Path("runs") / config.problem.name
    if config.fleet.probes > 1:
        return run_fleet(config, folder, seed=seed, budget=budget, search_probe=begin_search)
    code = begin_search(config, folder, seed, budget)
    if code == 0 and polish_s is not None:
        code = polish_run(folder, time_limit_s=polish_s, seed=seed, workers=budget.workers)
    return code


def begin_search(config: Config, path: Path, seed: int, budget: Budget) -> int:
    """Make a run folder, search with a configuration and return the exit code.

    Raises
    ------
    InputError
        Anything in the configuration that cannot be used, or the folder exists.
    """
    pruner = parse_pruner(config.search.pruner)
    problem = build_problem(config)
    folder = RunFolder.create(path, config, seed)
    rng = np.random.default_rng(seed)
    state = SearchState(settings=config.search, rng_state=dict(rng.bit_generator.state))
    origin = Origin(
        seed=seed,
        time_limit_s=budget.time_limit_s,
        max_solves=budget.max_solves,
        config_sha256=folder.config_digest(),
        catalogue_sha256=catalogue_digest(problem.catalogue),
    )
    checkpoints = Checkpoints.begin(folder.path, origin, state)
    print(
        f"{problem.name}: {len(problem.catalogue)} bodies from {problem.catalogue.source}, "
        f"seed {seed}, writing to {folder.path}"
    )
    return run_session(
        folder, checkpoints, state, config=config, problem=problem, pruner=pruner, budget=budget
    )
