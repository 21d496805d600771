"""`flight_of`: the tour of a run folder with the rows that it flies."""

from pathlib import Path

from feasibility.errors import InputError
from seqsearch.runs.fleet import is_fleet
from seqsearch.runs.run_folder import SEQUENCE
from seqsearch.tours.export.protocol import Flight
from seqsearch.tours.paths import impulsive_trajectory
from seqsearch.tours.tour_files import read_tour


def flight_of(path: Path) -> Flight:
    """Return the best tour of a run folder, or of a tour file, with its trajectory.

    Raises
    ------
    InputError
        It cannot be read, is a fleet's folder, or has no leg.
    """
    if path.is_dir() and is_fleet(path):
        raise InputError(f"{path}: a fleet, expected the folder of one probe, such as probe-1")
    file = path / SEQUENCE if path.is_dir() else path
    tour = read_tour(file)
    try:
        return Flight(tour, impulsive_trajectory(tour))
    except InputError as error:
        raise InputError(f"{file}: {error}") from None
