"""`polish_run`: reads a run folder, polishes its tours, writes what is better."""

import sys
from concurrent.futures import BrokenExecutor, Executor
from dataclasses import asdict
from pathlib import Path
from typing import Final

import numpy as np

from feasibility import InputError
from feasibility.runtime.atomic import write_json
from feasibility.runtime.cluster import crew
from feasibility.runtime.interrupts import interrupt_code
from feasibility.runtime.locks import folder_lock
from feasibility.runtime.provenance import provenance
from feasibility.runtime.terminal import Level, say
from feasibility.runtime.workers import default_workers
from seqsearch.core.problem import Problem
from seqsearch.polish import PolishResult, PolishSettings, PolishStep, distinct_tours, polish
from seqsearch.problems.problem_file import build_problem, read_config, with_catalogue
from seqsearch.pruning.pruner_spec import parse_pruner, predictor_of
from seqsearch.runs.checkpoint import FOLDER, Checkpoints, catalogue_digest
from seqsearch.runs.run_folder import CONFIG, SEQUENCE, RunFolder, worth
from seqsearch.runs.session import PACKAGES
from seqsearch.tours.events.fly_by import FlyBy
from seqsearch.tours.events.launch import Launch
from seqsearch.tours.pictures.plots import plot_tour
from seqsearch.tours.tour import Tour
from seqsearch.tours.tour_files import read_tour

REPORT: Final = "polish.json"
"""Name of the file that says what polishing gained."""

_TOURS: Final = 6
"""Tours of the search tree that are polished together."""


def polish_run(
    run: Path,
    *,
    time_limit_s: float | None,
    seed: int = 0,
    workers: int | None = None,
    scheduler: str | None = None,
    catalogue: str | None = None,
) -> int:
    """Polish the tours of a run folder and return the exit code.

    ``sequence.json`` is replaced if the result is better; the search's own tour
    stays as ``sequence.search.json``. Polished again, it goes on from there.

    Parameters
    ----------
    run : Path
        The run folder.
    time_limit_s : float, optional
        Wall-clock time.
    seed : int
        Seed of the moves.
    workers : int, optional
        Processes; default: one a core.
    scheduler : str, optional
        Address of a Dask scheduler whose workers take the place of processes.
    catalogue : str, optional
        Where the asteroid table is now; it has to be the same one.

    Raises
    ------
    InputError
        No run folder, or one that is damaged; a problem whose tours are more
        than rendezvous; an asteroid table that is not the same any more; no cluster there.
    """
    if seed < 0:
        raise InputError(f"--seed {seed}: expected zero or more")
    if workers is not None and workers < 1:
        raise InputError(f"--workers {workers}: expected one or more")
    if not run.is_dir():
        raise InputError(f"{run}: no such run folder")
    working = crew(workers or default_workers(), scheduler, PACKAGES)
    with folder_lock(run), working as executor:
        try:
            return _polished(run, time_limit_s, seed, executor, catalogue)
        except BrokenExecutor as error:
            print(f"seqsearch: {error}", file=sys.stderr)
            print(f"what was gained is saved; again: seqsearch polish {run}", file=sys.stderr)
            return 1


def _polished(
    run: Path,
    time_limit_s: float | None,
    seed: int,
    executor: Executor | None,
    catalogue: str | None,
) -> int:
    before = read_tour(run / SEQUENCE)
    folder = RunFolder.open(run)
    config = read_config(str(run / CONFIG))
    if catalogue is not None:
        config = with_catalogue(config, catalogue)
    problem = build_problem(config)
    if problem.custom_moves is not None or not _at_rest_between(problem):
        raise InputError(
            f"{run}: {problem.name} is no tour of rendezvous alone, as polishing asks"
        )
    tours = [before, *_searched(run, problem)]
    if not before.legs:
        raise InputError(f"{run / SEQUENCE}: has no leg, so there is nothing to polish")
    predictor = predictor_of(parse_pruner(config.search.pruner))
    if predictor is None:
        # Imported here: loading the model is of no use to the other commands.
        from feasibility.classifier.classifier import FeasibilityClassifier

        predictor = FeasibilityClassifier.load()
    say(f"{run}: polishing {len(tours)} tours, the best: {before.summary()}", Level.PROGRESS)

    def on_step(step: PolishStep, tour: Tour) -> None:
        say(_step_line(step), Level.PROGRESS)
        if worth(tour) > worth(before):
            folder.write_polished(tour)

    result = polish(
        problem,
        tours,
        predictor=predictor,
        rng=np.random.default_rng(seed),
        executor=executor,
        # Of a sequence that the user gave the epochs alone are free.
        time_limit_s=None if config.mission.sequence else time_limit_s,
        settings=PolishSettings(rounds=0) if config.mission.sequence else None,
        on_step=on_step,
    )
    _report(run, before, result, seed, time_limit_s)
    if worth(result.tour) > worth(before):
        plot_tour(result.tour, run / "tour.png")
    say(level=Level.PROGRESS)
    say(result.tour.one_line())
    say(f"{result.tour.summary()}; polish {result.stopped}, {result.moves} moves")
    say(f"check it with: seqsearch verify {run}", Level.PROGRESS)
    return interrupt_code()


def _at_rest_between(problem: Problem) -> bool:
    """Tell whether tours have no other events than a launch and some speed at the end."""
    for event in problem.tour_rules().events:
        if isinstance(event, FlyBy):
            if event.times > 0 or event.visit_bound(last=False) > 0.0:
                return False
        elif not isinstance(event, Launch):
            return False
    return True


def _searched(run: Path, problem: Problem) -> list[Tour]:
    """Return distinct tours of the run's search tree; none without checkpoints."""
    if not (run / FOLDER).is_dir():
        return []
    checkpoints, state = Checkpoints.load(run)
    if catalogue_digest(problem.catalogue) != checkpoints.origin.catalogue_sha256:
        raise InputError(
            f"{problem.catalogue.source}: not the asteroid table that {run} was begun with"
        )
    return distinct_tours(problem, state.tree, _TOURS)


def _step_line(step: PolishStep) -> str:
    return (
        f"{step.action:<9} {step.n_asteroids} asteroids, {step.duration_days:.1f} days, "
        f"{step.m_final_kg:.1f} kg left, after {step.moves} moves, {step.seconds:.0f} s"
    )


def _report(
    run: Path, before: Tour, result: PolishResult, seed: int, time_limit_s: float | None
) -> None:
    record = {
        "seed": seed,
        "time_limit_s": time_limit_s,
        "moves": result.moves,
        "stopped": result.stopped,
        "replaced": worth(result.tour) > worth(before),
        "steps": [asdict(step) for step in result.steps],
        "provenance": provenance(),
    }
    write_json(run / REPORT, record)
