"""`begin_search`: makes a run folder and searches with a configuration."""

from pathlib import Path
from typing import Final

import numpy as np

from feasibility import AllOf
from feasibility.constants import YEAR_DAYS
from feasibility.orbits.spk.kepler_error import motion_line
from feasibility.runtime.cluster import ClusterExecutor, crew
from feasibility.runtime.locks import folder_lock
from feasibility.runtime.terminal import Level, say
from feasibility.runtime.workers import MendingPool, default_workers
from seqsearch.beam.state import SearchState
from seqsearch.budget import Limits
from seqsearch.core.possible import check_possible
from seqsearch.core.problem import Problem
from seqsearch.core.recording import record_tour
from seqsearch.problems.problem_file import Config, build_problem
from seqsearch.pruning.pruner_spec import parse_pruner
from seqsearch.runs.checkpoint import Checkpoints, Origin, catalogue_digest
from seqsearch.runs.run_folder import RunFolder
from seqsearch.runs.session import PACKAGES, run_session
from seqsearch.tours.dates import date_of

_OLD_DAYS: Final = 50 * YEAR_DAYS
"""Elements that are further from the mission than this say little, or its window is no MJD."""


def begin_search(config: Config, path: Path, seed: int, limits: Limits) -> int:
    """Make a run folder, search with a configuration and return the exit code.

    Raises
    ------
    InputError
        Anything in the configuration that cannot be used, the folder exists, or no cluster
        is where `limits` say.
    """
    pruner = parse_pruner(config.search.pruner)
    problem = build_problem(config)
    check_possible(problem, config.search)
    with crew(limits.workers or default_workers(), limits.scheduler, PACKAGES) as executor:
        return _begun(config, path, seed, limits, pruner, problem, executor)


def _begun(
    config: Config,
    path: Path,
    seed: int,
    limits: Limits,
    pruner: AllOf,
    problem: Problem,
    executor: MendingPool | ClusterExecutor | None,
) -> int:
    """Make the run folder and search; all that can be checked before is checked."""
    folder = RunFolder.create(path, config, seed)
    rng = np.random.default_rng(seed)
    state = SearchState(settings=config.search, rng_state=dict(rng.bit_generator.state))
    origin = Origin(
        seed=seed,
        time_limit_s=limits.time_limit_s,
        max_solves=limits.max_solves,
        config_sha256=folder.config_digest(),
        catalogue_sha256=catalogue_digest(problem.catalogue),
    )
    with folder_lock(folder.path):
        checkpoints = Checkpoints.begin(folder.path, origin, state)
        # Whenever the run ends, even before its first node, there is a result to read.
        folder.write(record_tour(problem, state.tree, state.best_node), state.counters)
        say(
            f"{problem.name}: {len(problem.catalogue)} bodies from {problem.catalogue.source}, "
            f"seed {seed}, writing to {folder.path}",
            Level.PROGRESS,
        )
        say(_window_line(problem), Level.PROGRESS)
        if motion := motion_line(problem.catalogue):
            say(motion, Level.PROGRESS)
        return run_session(
            folder,
            checkpoints,
            state,
            config=config,
            problem=problem,
            pruner=pruner,
            limits=limits,
            executor=executor,
        )


def _window_line(problem: Problem) -> str:
    """Return when the tour may begin, and a warning where the table is of another age."""
    window = problem.first_departure_mjd2000
    line = f"first departure {date_of(window[0])} to {date_of(window[1])}"
    age_days = float(np.median(problem.catalogue.epoch_mjd2000)) - float(np.mean(window))
    if abs(age_days) > _OLD_DAYS:
        line += (
            f"; the table's elements are {abs(age_days) / YEAR_DAYS:.0f} years "
            f"{'older' if age_days < 0 else 'younger'}: is the window in MJD?"
        )
    return line
