"""`refine_run`: reads a run folder, refines its tour to continuous thrust, writes the rows."""

import time
from pathlib import Path

from feasibility import InputError
from feasibility.runtime.locks import folder_lock
from feasibility.runtime.provenance import provenance
from feasibility.runtime.terminal import Level, say, shows
from seqsearch.refine import RefinedLeg, RefinedTour, refine_tour
from seqsearch.runs.fleet import is_fleet, probe_paths
from seqsearch.runs.run_folder import SEQUENCE
from seqsearch.tours.tour import Tour
from seqsearch.tours.tour_files import read_tour
from seqsearch.tours.trajectory_files import ROWS, write_trajectory


def refine_run(run: Path, *, time_price: float | None = None) -> list[RefinedTour]:
    """Refine the tour of a run folder, or those of a fleet.

    The best tour is refined, ``sequence.json``, whether it is the search's or a polished one.
    ``trajectory.rows`` and ``trajectory.json`` are written beside it.

    Parameters
    ----------
    run : Path
        The run folder.
    time_price : float, optional
        As `refine_tour` has it.

    Returns
    -------
    list of RefinedTour
        One, or one for each probe.

    Raises
    ------
    InputError
        No run folder, one that is damaged or in use, or a leg that cannot be flown.
    """
    if not run.is_dir():
        raise InputError(f"{run}: no such run folder")
    if is_fleet(run):
        return [_refined(path.parent, time_price) for path in probe_paths(run)]
    return [_refined(run, time_price)]


def _refined(folder: Path, time_price: float | None) -> RefinedTour:
    with folder_lock(folder):
        tour = read_tour(folder / SEQUENCE)
        began = time.monotonic()
        try:
            refined = _with_bar(tour, time_price)
        except InputError as error:
            raise InputError(f"{folder / SEQUENCE}: {error}") from None
        seconds = time.monotonic() - began
        summary = refined.summary() | {"seconds": seconds, "provenance": provenance()}
        write_trajectory(folder, tour, refined.trajectory, summary)
    for line in _table(refined):
        say(line, Level.PROGRESS)
    say(f"{refined.one_line()}; {seconds:.1f} s")
    say(f"{folder / ROWS}; check it with: seqsearch verify {folder} --continuous", Level.PROGRESS)
    return refined


def _with_bar(tour: Tour, time_price: float | None) -> RefinedTour:
    from tqdm import tqdm

    hidden = None if shows(Level.PROGRESS) else True
    with tqdm(total=len(tour.legs), desc="refining", unit=" legs", disable=hidden) as bar:

        def on_leg(leg: RefinedLeg) -> None:
            bar.set_postfix_str(f"{leg.start} -> {leg.end}", refresh=False)
            # A second attempt begins at the first leg again.
            bar.update(1 if bar.n < len(tour.legs) else 0)

        return refine_tour(tour, time_price=time_price, on_leg=on_leg)


def _table(refined: RefinedTour) -> list[str]:
    lines = ["leg                      propellant  impulses      diff.     late      miss"]
    for k, leg in enumerate(refined.legs, 1):
        way = f"{leg.start} -> {leg.end}"
        lines.append(
            f"{k:>3} {way:<20} {leg.propellant_kg:>8.3f} kg "
            f"{leg.impulsive_propellant_kg:>8.3f} kg "
            f"{leg.difference_percent:>+7.2f} % {leg.arrival_delay_days:>6.2f} d "
            f"{1e3 * leg.miss_km:>6.1f} m"
        )
    return lines
