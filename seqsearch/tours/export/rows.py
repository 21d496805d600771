"""``rows``: the layout in which most competitions ask for a trajectory; written and read.

A line each day at most, and at arrivals::

    MJD x y z vx vy vz m Tx Ty Tz      km, km/s, kg, N

with blanks between and 17 digits, so that numbers come back as they were. Thrust is constant
from a row to the next, and zero in the last row of a phase. ``# phase K: FROM -> TO`` opens
phase K; other lines that begin with ``#`` are comments.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, final

import numpy as np

from feasibility.constants import MJD2000_MJD
from feasibility.errors import InputError
from feasibility.runtime.atomic import atomic_path
from seqsearch.tours.export.protocol import Flight
from seqsearch.tours.trajectory import Phase, Trajectory

_COLUMNS: Final = 11
_HEAD: Final = "# MJD x y z vx vy vz m Tx Ty Tz; km, km/s, kg, N; heliocentric ecliptic J2000\n"
_PHASE: Final = re.compile(r"#\s*phase\s+(\d+)\s*:\s*(\S+)\s*->\s*(\S+)\s*$")
_MEANT: Final = re.compile(r"#\s*phase\s+\d")
_UNITS: Final = np.array([1.0, *[1e3] * 6, *[1.0] * 4])
"""SI for one of each column."""


@final
class RowsExporter:
    """Writes the rows of a flight with continuous thrust."""

    name = "rows"

    def write(self, flight: Flight, path: Path, /) -> None:
        """Write the rows of a flight.

        Raises
        ------
        InputError
            The flight has impulses, or the file cannot be written.
        """
        if not flight.trajectory.continuous:
            raise InputError(
                f"{path}: rows have continuous thrust and this tour has impulses; "
                "refine it first (seqsearch refine RUN)"
            )
        write_rows(flight.trajectory, path, title=flight.tour.one_line())


def write_rows(
    trajectory: Trajectory, path: Path, *, title: str = "", digits: int | None = None
) -> None:
    """Write a trajectory of continuous thrust, whole or not at all.

    Parameters
    ----------
    trajectory : Trajectory
        The phases.
    path : Path
        The file.
    title : str
        A line for people.
    digits : int, optional
        Significant digits of all numbers but the epochs; default: so many that the numbers come
        back as they were.

    Raises
    ------
    InputError
        The file cannot be written.
    """
    form = ".16e" if digits is None else f".{digits}g"
    with atomic_path(path) as temporary, temporary.open("w", encoding="utf-8") as file:
        if title:
            file.write(f"# {title}\n")
        file.write(
            "# MJD x y z vx vy vz m Tx Ty Tz; km, km/s, kg, N; heliocentric ecliptic J2000\n"
        )
        for number, phase in enumerate(trajectory.phases, 1):
            file.write(f"# phase {number}: {phase.start} -> {phase.end}\n")
            file.writelines(_lines(phase, form))


def _lines(phase: Phase, form: str) -> Iterator[str]:
    epochs = phase.t_mjd2000 + MJD2000_MJD
    table = np.column_stack([epochs, phase.states, phase.mass_kg, phase.thrust_n]) / _UNITS
    for row in table.tolist():
        numbers = " ".join(f"{number:{form}}" if number else "0" for number in row[1:])
        yield f"{row[0]:.17g} {numbers}\n"


def read_rows(path: Path) -> Trajectory:
    """Read a file of rows.

    Raises
    ------
    InputError
        The file cannot be read, or a line is neither a row nor a comment; with file and line.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: not a text file, expected rows of {_COLUMNS} numbers") from None
    open_phases: list[_OpenPhase] = []
    for number, line in enumerate(text.splitlines(), 1):
        where = f"{path}, line {number}"
        if line.lstrip().startswith("#"):
            if (opened := _opened(line.strip(), where, len(open_phases) + 1)) is not None:
                open_phases.append(opened)
        elif line.strip():
            if not open_phases:
                raise InputError(f"{where}: a row before the first line '# phase 1: FROM -> TO'")
            open_phases[-1].rows.append(_row(line, where, open_phases[-1]))
    if not open_phases:
        raise InputError(f"{path}: no line '# phase 1: FROM -> TO', expected one for each leg")
    phases = tuple(phase.closed() for phase in open_phases)
    try:
        return Trajectory(phases, continuous=True)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


@dataclass
class _OpenPhase:
    where: str
    start: str
    end: str
    rows: list[list[float]] = field(default_factory=list)

    def closed(self) -> Phase:
        if len(self.rows) < 2:
            raise InputError(
                f"{self.where}: phase {self.start} -> {self.end} has {len(self.rows)} rows, "
                "expected two or more"
            )
        table = np.array(self.rows) * _UNITS
        try:
            return Phase(
                self.start,
                self.end,
                table[:, 0] - MJD2000_MJD,
                table[:, 1:7],
                table[:, 7],
                table[:, 8:],
            )
        except InputError as error:
            raise InputError(f"{self.where}: {error}") from None


def _opened(comment: str, where: str, expected: int) -> _OpenPhase | None:
    """Return the phase that a comment opens; None for other comments."""
    match = _PHASE.match(comment)
    if match is None:
        if _MEANT.match(comment):
            raise InputError(f"{where}: {comment!r}, expected '# phase {expected}: FROM -> TO'")
        return None
    if int(match[1]) != expected:
        raise InputError(f"{where}: phase {match[1]}, expected phase {expected}")
    return _OpenPhase(where, match[2], match[3])


def _row(line: str, where: str, phase: _OpenPhase) -> list[float]:
    cells = line.split()
    if len(cells) != _COLUMNS:
        raise InputError(
            f"{where}: {len(cells)} columns, expected {_COLUMNS} (MJD x y z vx vy vz m Tx Ty Tz)"
        )
    row = []
    for cell in cells:
        try:
            row.append(float(cell))
        except ValueError:
            raise InputError(f"{where}: {cell!r}, expected a number") from None
    if not np.isfinite(row).all():
        raise InputError(f"{where}: a number that is not finite")
    if row[7] <= 0.0:
        raise InputError(f"{where}: mass {row[7]:g} kg, expected more than 0")
    if phase.rows and row[0] < phase.rows[-1][0]:
        raise InputError(
            f"{where}: MJD {row[0]:.17g} after {phase.rows[-1][0]:.17g}, expected time to go on"
        )
    return row
