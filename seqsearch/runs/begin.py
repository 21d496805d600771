"""`begin_search`: makes a run folder and searches with a configuration."""

from pathlib import Path

import numpy as np

from feasibility.runtime.interrupts import say
from feasibility.runtime.locks import folder_lock
from seqsearch.beam.state import SearchState
from seqsearch.budget import Limits
from seqsearch.core.recording import record_tour
from seqsearch.problems.problem_file import Config, build_problem
from seqsearch.pruning.pruner_spec import parse_pruner
from seqsearch.runs.checkpoint import Checkpoints, Origin, catalogue_digest
from seqsearch.runs.run_folder import RunFolder
from seqsearch.runs.session import run_session


def begin_search(config: Config, path: Path, seed: int, limits: Limits) -> int:
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
            f"seed {seed}, writing to {folder.path}"
        )
        return run_session(
            folder,
            checkpoints,
            state,
            config=config,
            problem=problem,
            pruner=pruner,
            limits=limits,
        )
