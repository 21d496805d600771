"""`fly_run`: when and with what masses a named sequence can be flown, or where it breaks."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, final

import msgspec
import numpy as np
from numpy.typing import NDArray

from feasibility import FeasibilityClassifier, Legs
from feasibility.runtime.locks import folder_lock
from feasibility.runtime.terminal import Level, say
from seqsearch.beam.scouting.scout import STRETCHES
from seqsearch.budget import Limits
from seqsearch.core.ending import Ending, ending_of
from seqsearch.core.problem import Problem
from seqsearch.polish.itinerary import Itinerary
from seqsearch.polish.retiming import retime
from seqsearch.problems.problem_file import Config, build_problem
from seqsearch.runs.begin import begin_search
from seqsearch.runs.polishing import polish_run
from seqsearch.runs.run_folder import SEQUENCE, RunFolder
from seqsearch.runs.whole_chain import whole_chain
from seqsearch.settings import SearchSettings
from seqsearch.tours.dates import date_of
from seqsearch.tours.pictures.plots import plot_tour
from seqsearch.tours.tour import Tour
from seqsearch.tours.tour_files import read_tour

_WIDTH: Final = 400
_CELL_DAYS: Final = 5.0
"""Variants of the sequence that go on at each rank, and how far apart their arrivals are."""

_DAYS_PER_START: Final = 15.0
_MOST_STARTS: Final = 400
"""How dense the epochs are at which the first leg may begin."""

_DELAYS_DAYS: Final = (0.0, 20.0, 50.0, 100.0, 180.0)
"""Waits beyond the shortest stay: a body may be far off in phase for a while."""

_WAITS: Final = 40
_TIMES: Final = 60
"""Grid on which the leg at which a sequence breaks is looked at."""


def for_sequence(config: Config) -> Config:
    """Return a configuration that searches for the epochs of its sequence, and for nothing else.

    Longest flight times, pruner and solver stay as they are.
    """
    earliest, latest = config.mission.first_departure_mjd
    starts = int(np.clip((latest - earliest) / _DAYS_PER_START, 10, _MOST_STARTS))
    search = config.search.with_(
        beam_width=_WIDTH,
        starts=starts,
        start_epochs=starts,
        # A start and an end that the sequence does not name are among the bodies too.
        neighbours=len(config.mission.sequence) + (2 if config.bodies else 0),
        flight_time_stretches=STRETCHES,
        departure_delays_days=_DELAYS_DAYS,
        frontier={
            "kind": "depth",
            "max_per_parent": _WIDTH,
            "max_per_cell": _WIDTH,
            "max_start_share": 1.0,
            "cell_days": _CELL_DAYS,
        },
        scouts={"generations": 0, "share": 0.0},
        audit={"per_rank": 0},
    )
    fleet = msgspec.structs.replace(config.fleet, probes=1)
    return msgspec.structs.replace(config, search=search, fleet=fleet)


def fly_run(config: Config, folder: Path, seed: int, limits: Limits) -> int:
    """Fly the sequence of a configuration, write a run folder and return the exit code.

    A beam in which every node follows the sequence finds epochs, and polishing improves all of
    them together. Bodies that the beam did not reach are then appended one by one.

    Returns
    -------
    int
        0: the whole sequence is flown; 1: it breaks, and a line says where; else as
        `begin_search`.

    Raises
    ------
    InputError
        As `begin_search`; an id is not in the table, or the problem is no tour of rendezvous.
    """
    config = for_sequence(config)
    code = begin_search(config, folder, seed, limits)
    if code == 0 and read_tour(folder / SEQUENCE).legs:
        code = polish_run(
            folder,
            time_limit_s=None,
            seed=seed,
            workers=limits.workers,
            scheduler=limits.scheduler,
        )
    if code != 0:
        return code
    if not _is_whole(config, read_tour(folder / SEQUENCE)):
        problem = build_problem(config)
        ending = ending_of(problem)
        broken = (
            _completed(problem, folder, config)
            if ending is None
            else _ended(problem, ending, folder, config)
        )
        if broken and (limits.time_limit_s is not None or limits.max_solves is not None):
            broken += "; the limit may have been too short to find it"
        if broken:
            say(broken)
            return 1
    tour = read_tour(folder / SEQUENCE)
    say(tour.one_line())
    say(f"the whole sequence: {tour.summary()}")
    return 0


def _is_whole(config: Config, tour: Tour) -> bool:
    """Tell whether a tour visits all of the sequence, and ends where it has to."""
    ids = [body.id for body in tour.bodies]
    end = config.mission.end_id
    return set(config.mission.sequence) <= set(ids) and (end is None or ids[-1] == end)


def _ended(problem: Problem, ending: Ending, path: Path, config: Config) -> str:
    """Fly the sequence to its end if that can be; return what it lacks, or nothing."""
    tour = read_tour(path / SEQUENCE)
    ids = {body.id for body in tour.bodies}
    count = sum(body in ids for body in config.mission.sequence)
    chain = whole_chain(
        problem, ending, tour, config.mission.sequence, FeasibilityClassifier.load()
    )
    if chain.tour is None:
        return (
            f"flown to {count} of {len(config.mission.sequence)} and then to the end; of the "
            f"whole sequence the best timetable has {chain.lacks}"
        )
    with folder_lock(path):
        RunFolder.open(path).write_polished(chain.tour)
        plot_tour(chain.tour, path / "tour.png")
    return ""


def _completed(problem: Problem, path: Path, config: Config) -> str:
    """Append what is missing of the sequence to the tour; return where it breaks, or nothing."""
    wanted = config.mission.sequence
    tour = read_tour(path / SEQUENCE)
    count = max(1, len(tour.bodies))
    while count < len(wanted):
        before, after = wanted[count - 1 : count + 1]
        broken = f"flown to {count} of {len(wanted)}; breaks at leg {count}, {before} -> {after}: "
        if not tour.legs:
            return broken + "no departure in the window leads to a leg that can be flown"
        trial = next_leg(problem, tour, (before, after), config.search)
        if isinstance(trial, str):
            return broken + trial
        row = int(problem.catalogue.rows_of([after])[0])
        longer = Itinerary.from_tour(problem, tour).appended(
            row, trial.t_dep_mjd2000, trial.tof_days
        )
        retimed = retime(problem, longer)
        if retimed is None or not retimed.flight.keeps_rules(problem):
            return broken + trial.words
        tour = retimed.flight.to_tour(problem)
        count = len(tour.bodies)
        with folder_lock(path):
            RunFolder.open(path).write_polished(tour)
            plot_tour(tour, path / "tour.png")
        say(f"appended {after}: {tour.summary()}", Level.PROGRESS)
    return ""


@final
@dataclass(frozen=True)
class NextLeg:
    """The most promising leg from the end of a tour to a body.

    Attributes
    ----------
    t_dep_mjd2000, tof_days : float
        When and how long.
    words : str
        What is known of it.
    """

    t_dep_mjd2000: float
    tof_days: float
    words: str


def next_leg(
    problem: Problem, tour: Tour, bodies: tuple[int, int], settings: SearchSettings
) -> NextLeg | str:
    """Return the most promising leg on from the end of a tour, or why there is none.

    All waits and flight times of the mission that are left are looked at with the default model:
    the leg that leaves most mass, or the one that is nearest to being flyable.
    """
    rules = tour.rules
    ready = tour.legs[-1].t_arr_mjd2000 + rules.min_stay_days
    end = tour.legs[0].t_dep_mjd2000 + rules.max_duration_days
    left = f"{end - ready:.0f} days are left on {date_of(ready)}"
    longest = min(end - ready, settings.tof_days_max)
    if longest < settings.tof_days_min:
        return f"{left}, the shortest flight is {settings.tof_days_min:g} (tof_days_min)"
    times = np.linspace(settings.tof_days_min, longest, _TIMES)
    waits = np.linspace(0.0, end - ready - settings.tof_days_min, _WAITS)
    wait, tof = (grid.ravel() for grid in np.meshgrid(waits, times))
    fits = ready + wait + tof <= end
    wait, tof = wait[fits], tof[fits]
    legs = _legs(problem, bodies, ready + wait, tof, tour.m_final_kg)
    answers = FeasibilityClassifier.load().predict(legs)
    margin = np.nan_to_num(answers.margin, nan=0.0)
    flyable = margin >= 1.0
    best = int(np.argmax(np.where(flyable, 1.0 + answers.final_mass, margin)))
    what = f"m*/m0 is {margin[best]:.3f} at best"
    if flyable.any():
        what = f"{answers.final_mass[best]:.1f} kg would be left at best"
    return NextLeg(
        float(ready + wait[best]),
        float(tof[best]),
        f"{left} with {tour.m_final_kg:.1f} kg (dry {rules.m_dry_kg:g}), and {what}, after a wait "
        f"of {wait[best]:.0f} and a flight of {tof[best]:.0f} days",
    )


def _legs(
    problem: Problem,
    bodies: tuple[int, int],
    t_dep_mjd2000: NDArray[np.float64],
    tof_days: NDArray[np.float64],
    mass: float,
) -> Legs:
    """Return n legs between two bodies, given by their ids, at different epochs."""
    rows = problem.catalogue.rows_of(bodies).astype(np.intp)
    n = len(tof_days)
    start = problem.start_nodes(rows[:1], t_dep_mjd2000[:1])
    nodes = replace(start, mass=np.array([mass]))
    parent = np.zeros(n, dtype=np.intp)
    return problem.hops(nodes, parent, np.full(n, rows[1]), t_dep_mjd2000, tof_days).legs[-1]
