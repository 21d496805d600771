"""`resume_search`: reads a run folder, checks that it is whole, goes on."""

from dataclasses import replace
from pathlib import Path

from feasibility import InputError
from feasibility.runtime.cluster import crew
from feasibility.runtime.locks import folder_lock
from feasibility.runtime.terminal import say
from feasibility.runtime.workers import default_workers
from seqsearch.budget import Limits
from seqsearch.problems.problem_file import build_problem, read_config, with_catalogue
from seqsearch.pruning.pruner_spec import parse_pruner
from seqsearch.runs.checkpoint import Checkpoints, catalogue_digest
from seqsearch.runs.run_folder import CONFIG, RunFolder
from seqsearch.runs.session import PACKAGES, run_session


def resume_search(
    run: Path,
    *,
    after: tuple[int, int] | None,
    time_limit_s: float | None,
    max_solves: int | None,
    workers: int | None,
    scheduler: str | None = None,
    catalogue: str | None = None,
) -> int:
    """Go on with a run where it stopped, or after a rank of it, and return the exit code.

    Nothing in the folder changes before everything is read and checked.

    Parameters
    ----------
    run : Path
        The run folder.
    after : tuple of int, optional
        Pass and rank after which to go on; checkpoints of later ranks are deleted.
    time_limit_s, max_solves : optional
        New budgets for the whole run; default: those that it was begun with.
    workers : int, optional
        Processes.
    scheduler : str, optional
        Address of a Dask scheduler whose workers take the place of processes.
    catalogue : str, optional
        Where the asteroid table is now; it has to be the same one.

    Raises
    ------
    InputError
        No run folder, or one that is damaged, changed or of another version;
        an asteroid table that is not the same any more; a budget that is used up.
    """
    if not run.is_dir():
        raise InputError(f"{run}: no such run folder")
    with folder_lock(run):
        return _resumed(
            run,
            after,
            Limits(
                time_limit_s=time_limit_s,
                max_solves=max_solves,
                workers=workers,
                scheduler=scheduler,
            ),
            catalogue,
        )


def _resumed(
    run: Path,
    after: tuple[int, int] | None,
    given: Limits,
    catalogue: str | None,
) -> int:
    checkpoints, state = Checkpoints.load(run, after)
    origin = checkpoints.origin
    limits = replace(
        given,
        time_limit_s=origin.time_limit_s if given.time_limit_s is None else given.time_limit_s,
        max_solves=origin.max_solves if given.max_solves is None else given.max_solves,
    )
    if limits.time_limit_s is not None and limits.time_limit_s <= state.spent_s:
        raise InputError(
            f"{run}: has spent {state.spent_s:.0f} s of {limits.time_limit_s:.0f} s; "
            "expected a larger --time-limit"
        )
    if limits.max_solves is not None and limits.max_solves <= state.solves:
        raise InputError(
            f"{run}: has used {state.solves} of {limits.max_solves} solves; "
            "expected a larger --max-solves"
        )
    folder = RunFolder.open(run)
    if folder.config_digest() != origin.config_sha256:
        raise InputError(
            f"{run / CONFIG}: changed since the run was begun; begin another run with it"
        )
    config = read_config(str(run / CONFIG))
    if catalogue is not None:
        config = with_catalogue(config, catalogue)
    pruner = parse_pruner(config.search.pruner)
    problem = build_problem(config)
    if catalogue_digest(problem.catalogue) != origin.catalogue_sha256:
        raise InputError(
            f"{problem.catalogue.source}: not the asteroid table that {run} was begun with"
        )
    with crew(limits.workers or default_workers(), limits.scheduler, PACKAGES) as executor:
        folder.note_session(limits.time_limit_s, limits.max_solves)
        checkpoints.discard_later()
        say(
            f"{problem.name}: {len(problem.catalogue)} bodies from {problem.catalogue.source}, "
            f"seed {origin.seed}, going on in {run} after pass {state.pass_number}, "
            f"{len(state.counters)} ranks and {state.spent_s:.0f} s"
        )
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
