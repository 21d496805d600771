"""Reads the files of a carrier for its verification; shares nothing with what writes them.

``M.TXT`` has a line for each event, ``MJD x y z vx vy vz m EVENT``: the state and the mass after
the event, in km, km/s and kg. ``P1.TXT``, ``P2.TXT`` and so on have phases that begin with
``# phase K: FROM -> TO``, with lines ``MJD x y z vx vy vz m Tx Ty Tz``; thrust is in N and
constant from a row to the next. All other lines that begin with ``#`` are comments.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.errors import InputError
from seqsearch.tours.trajectory import Phase

LOG: Final = "M.TXT"
"""Name of the file with the events of the carrier."""

LAUNCH: Final = "LAUNCH"
IMPULSE: Final = "DV"
RELEASE: Final = "RELEASE"
CAPTURE: Final = "CAPTURE"

_MJD_OF_MJD2000: Final = 51544.0
_LOG_LAYOUT: Final = "MJD x y z vx vy vz m EVENT"
_ROW_LAYOUT: Final = "MJD x y z vx vy vz m Tx Ty Tz"
_MOST_MJD: Final = 200_000.0
_MOST_KM: Final = 1e11
_MOST_KM_S: Final = 1e4


@final
@dataclass(frozen=True, eq=False)
class LogRow:
    """A line of the carrier's file.

    Attributes
    ----------
    t_mjd2000 : float
        Epoch.
    state : (6,) array
        State after the event, m and m/s.
    mass_kg : float
        Mass after the event, with the craft aboard.
    kind : str
        `LAUNCH`, `IMPULSE`, `RELEASE` or `CAPTURE`.
    craft : int
        Number of the craft; 0 for events without one.
    """

    t_mjd2000: float
    state: NDArray[np.float64]
    mass_kg: float
    kind: str
    craft: int

    def __str__(self) -> str:
        return f"{self.kind} P{self.craft}" if self.craft else self.kind


@final
@dataclass(frozen=True, eq=False)
class CarrierFiles:
    """What is handed in: the carrier's events, and the phases of each craft by its number."""

    log: tuple[LogRow, ...]
    craft: Mapping[int, tuple[Phase, ...]]


def is_carrier(folder: Path) -> bool:
    """Tell whether a folder holds the files of a carrier."""
    return (folder / LOG).is_file()


def read_carrier_files(folder: Path) -> CarrierFiles:
    """Read ``M.TXT`` and the file of each craft that it releases, and any other craft's there.

    Raises
    ------
    InputError
        A file is missing or cannot be read, or a line is neither a row nor a comment; with file
        and line.
    """
    log = tuple(_log(folder / LOG))
    if not log:
        raise InputError(f"{folder / LOG}: no event, expected rows {_LOG_LAYOUT}")
    numbers = {row.craft for row in log if row.craft}
    for file in folder.glob("P*.TXT"):
        if file.stem[1:].isascii() and file.stem[1:].isdigit():
            numbers.add(int(file.stem[1:]))
    return CarrierFiles(log, {n: _phases(folder / f"P{n}.TXT") for n in sorted(numbers)})


def _lines(file: Path) -> Iterator[tuple[str, str]]:
    """Yield the lines that are not empty, each with what messages about it begin with."""
    try:
        text = file.read_text(encoding="ascii")
    except OSError as error:
        raise InputError(f"{file}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError:
        raise InputError(f"{file}: not a text file in ASCII") from None
    for number, line in enumerate(text.splitlines(), 1):
        if line.strip():
            yield f"{file}, line {number}", line.strip()


def _log(file: Path) -> Iterator[LogRow]:
    last = -math.inf
    for where, line in _lines(file):
        if line.startswith("#"):
            continue
        cells = line.split()
        if len(cells) < 9:
            raise InputError(f"{where}: {len(cells)} columns, expected {_LOG_LAYOUT}")
        row = _numbers(cells[:8], where)
        kind, craft = _event(cells[8:], where)
        if row[0] < last:
            raise InputError(f"{where}: MJD {row[0]:.9f} after {last:.9f}, expected time to go on")
        last = row[0]
        state = 1e3 * np.array(row[1:7])
        yield LogRow(row[0] - _MJD_OF_MJD2000, state, row[7], kind, craft)


def _event(words: list[str], where: str) -> tuple[str, int]:
    match words:
        case [kind] if kind in (LAUNCH, IMPULSE):
            return kind, 0
        case [kind, craft] if kind in (RELEASE, CAPTURE) and craft[:1] == "P":
            number = craft[1:]
            if number.isascii() and number.isdigit() and 0 < int(number) < 1000:
                return kind, int(number)
    raise InputError(
        f"{where}: event {' '.join(words)!r}, "
        f"expected {LAUNCH}, {IMPULSE}, {RELEASE} P1 or {CAPTURE} P1"
    )


def _phases(file: Path) -> tuple[Phase, ...]:
    headed: list[tuple[str, str, str, list[list[float]]]] = []
    for where, line in _lines(file):
        if line.startswith("#"):
            words = line[1:].replace("->", " -> ").split()
            if words[:1] == ["phase"] and len(words) > 1 and words[1].rstrip(":").isdigit():
                headed.append((where, *_ends(words, where, len(headed) + 1), []))
            continue
        if not headed:
            raise InputError(f"{where}: a row before the first line '# phase 1: FROM -> TO'")
        cells = line.split()
        if len(cells) != 11:
            raise InputError(f"{where}: {len(cells)} columns, expected {_ROW_LAYOUT}")
        headed[-1][3].append(_numbers(cells, where))
    if not headed:
        raise InputError(f"{file}: no line '# phase 1: FROM -> TO', expected one for each leg")
    phases = []
    for where, start, end, rows in headed:
        if len(rows) < 2:
            raise InputError(f"{where}: {len(rows)} rows in the phase, expected two or more")
        table = np.array(rows)
        epochs = table[:, 0] - _MJD_OF_MJD2000
        try:
            phases.append(
                Phase(start, end, epochs, 1e3 * table[:, 1:7], table[:, 7], table[:, 8:])
            )
        except InputError as error:
            raise InputError(f"{where}: {error}") from None
    return tuple(phases)


def _ends(words: list[str], where: str, expected: int) -> tuple[str, str]:
    match words:
        case [_, number, start, "->", end] if number == f"{expected}:":
            return start, end
    raise InputError(f"{where}: {' '.join(words)!r}, expected 'phase {expected}: FROM -> TO'")


def _numbers(cells: list[str], where: str) -> list[float]:
    row = []
    for cell in cells:
        try:
            row.append(float(cell))
        except ValueError:
            raise InputError(f"{where}: {cell[:40]!r}, expected a number") from None
    limits = (_MOST_MJD, *[_MOST_KM] * 3, *[_MOST_KM_S] * 3, 1e9, *[1e6] * 3)
    for value, limit in zip(row, limits, strict=False):
        if not abs(value) <= limit:
            raise InputError(f"{where}: {value}, expected a number of at most {limit:g}")
    if row[7] <= 0.0:
        raise InputError(f"{where}: mass {row[7]:g} kg, expected more than 0")
    if not any(row[1:4]):
        raise InputError(f"{where}: a position in the Sun")
    return row
