"""A refined tour as files beside its ``sequence.json``: the rows, and what is known of them."""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from feasibility.errors import InputError
from feasibility.runtime.atomic import write_json
from seqsearch.tours.export.rows import read_rows, write_rows
from seqsearch.tours.tour import Tour
from seqsearch.tours.tour_files import to_json
from seqsearch.tours.trajectory import Trajectory

ROWS: Final = "trajectory.rows"
"""Name of the file with the rows, as they are handed in."""

SUMMARY: Final = "trajectory.json"
"""Name of the file that says which tour they fly, and how."""

FORMAT: Final = "seqsearch-trajectory-1"


def tour_digest(tour: Tour) -> str:
    """Return the SHA-256 of a tour as `to_json` writes it."""
    return hashlib.sha256(to_json(tour).encode()).hexdigest()


def write_trajectory(
    folder: Path, tour: Tour, trajectory: Trajectory, summary: Mapping[str, Any]
) -> None:
    """Write the trajectory of a tour; files of an interrupted writing are known as stale.

    Parameters
    ----------
    folder : Path
        Where the tour's file is.
    tour : Tour
        The tour.
    trajectory : Trajectory
        Its rows.
    summary : mapping
        What else is to be known, plain data.

    Raises
    ------
    InputError
        A file cannot be written.
    """
    write_rows(trajectory, folder / ROWS, title=tour.one_line())
    digests = {
        "format": FORMAT,
        "tour_sha256": tour_digest(tour),
        "rows_sha256": _digest(folder / ROWS),
    }
    write_json(folder / SUMMARY, digests | dict(summary))


def read_trajectory(folder: Path, tour: Tour) -> Trajectory | None:
    """Return the trajectory that belongs to a tour; None where it was not refined.

    Parameters
    ----------
    folder : Path
        Where the tour's file is.
    tour : Tour
        The tour, as it is now.

    Raises
    ------
    InputError
        The files belong to another tour or not together, or cannot be read.
    """
    if not (folder / SUMMARY).is_file():
        return None
    record = read_summary(folder)
    if record["tour_sha256"] != tour_digest(tour):
        raise InputError(
            f"{folder / ROWS}: refined from another tour than the one that is there now; "
            f"refine it again (seqsearch refine {folder})"
        )
    if record["rows_sha256"] != _digest(folder / ROWS):
        raise InputError(
            f"{folder / ROWS}: not the rows that {SUMMARY} was written for; "
            f"refine again (seqsearch refine {folder})"
        )
    return read_rows(folder / ROWS)


def read_summary(folder: Path) -> dict[str, Any]:
    """Return what was written beside the rows.

    Raises
    ------
    InputError
        It cannot be read or is of another version.
    """
    file = folder / SUMMARY
    try:
        record = json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{file}: cannot be read ({error.strerror})") from None
    except ValueError as error:
        raise InputError(f"{file}: not a complete {FORMAT} file ({error})") from None
    if not isinstance(record, dict) or record.get("format") != FORMAT:
        raise InputError(f"{file}: expected a file of format {FORMAT!r}")
    if not all(isinstance(record.get(key), str) for key in ("tour_sha256", "rows_sha256")):
        raise InputError(f"{file}: has no digests, expected tour_sha256 and rows_sha256")
    return record


def _digest(file: Path) -> str:
    try:
        return hashlib.sha256(file.read_bytes()).hexdigest()
    except OSError as error:
        raise InputError(f"{file}: cannot be read ({error.strerror})") from None
