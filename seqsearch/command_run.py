"""What ``seqsearch run`` does: read, check, begin a run folder, search."""

from pathlib import Path
from typing import Any

import numpy as np

from feasibility import InputError
from seqsearch.checkpoint import Checkpoints, Origin, catalogue_digest
from seqsearch.config import build_problem, override, read_config, with_catalogue
from seqsearch.pruner_spec import parse_pruner
from seqsearch.run_folder import RunFolder
from seqsearch.session import Budget, run_session
from seqsearch.state import SearchState


def run_search(
    problem_name: str,
    *,
    catalogue: str | None,
    out: Path | None,
    seed: int,
    budget: Budget,
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
    config = override(read_config(problem_name), **overrides)
    if catalogue is not None:
        config = with_catalogue(config, catalogue)
    if config.catalogue.file is not None:
        # The run folder's copy is read from elsewhere when the run is resumed.
        config = with_catalogue(config, str(Path(config.catalogue.file).absolute()))
    pruner = parse_pruner(config.search.pruner)
    problem = build_problem(config)
    folder = RunFolder.create(out or Path("runs") / config.problem.name, config, seed)
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
