"""`flight_of`: the tour of a run folder with the rows that it flies."""

from pathlib import Path

from feasibility.errors import InputError
from seqsearch.runs.fleet import is_fleet
from seqsearch.runs.run_folder import SEQUENCE
from seqsearch.tours.export.protocol import Flight
from seqsearch.tours.paths import impulsive_trajectory
from seqsearch.tours.tour import Tour
from seqsearch.tours.tour_files import read_tour
from seqsearch.tours.trajectory import Trajectory
from seqsearch.tours.trajectory_files import read_trajectory


def flight_of(path: Path) -> Flight:
    """Return the best tour of a run folder, or of a tour file, with its trajectory.

    That is the one with continuous thrust where the tour was refined, else that of its impulses.

    Raises
    ------
    InputError
        It cannot be read, is a fleet's folder, or has no leg; or the rows beside it are not of
        this tour.
    """
    file = tour_file(path)
    tour = read_tour(file)
    try:
        return Flight(tour, _refined(file, tour) or impulsive_trajectory(tour))
    except InputError as error:
        raise InputError(f"{file}: {error}") from None


def tour_file(path: Path) -> Path:
    """Return the tour file that a run folder, or the path of one, stands for.

    Raises
    ------
    InputError
        A fleet's folder.
    """
    if path.is_dir() and is_fleet(path):
        raise InputError(f"{path}: a fleet, expected the folder of one probe, such as probe-1")
    return path / SEQUENCE if path.is_dir() else path


def _refined(file: Path, tour: Tour) -> Trajectory | None:
    # Rows belong to the best tour of a folder; other tour files may lie beside it.
    return read_trajectory(file.parent, tour) if file.name == SEQUENCE else None
