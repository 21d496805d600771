"""Readers of the asteroid tables of the GTOC problems.

The layout is recognised by the table's header, whatever the file is called:

========  ==================================================================  ==============
layout    columns                                                             id
========  ==================================================================  ==============
GTOC2     spkid, a, e, i, node, argp, M, epoch, group                         spkid
GTOC4     'name', epoch, a, e, i, node, argp, M                               row, from 1
GTOC5     epoch, a, e, i, argp, node, M, number and name                      row, from 1
GTOC7     id, epoch, a, e, i, argp, node, M, name                             id
GTOC11    id, epoch, a, e, i, node, argp, M, mass                             id
GTOC12    id, epoch, a, e, i, node, argp, M                                   id
========  ==================================================================  ==============

Units in the files are AU, degrees, MJD and kg (mind that GTOC5 and GTOC7 give the
argument of perihelion before the node). Where a layout has no name, the name is the
id. Empty lines and lines that begin with ``#`` are skipped. The Earth, which
GTOC2 lists after its 910 asteroids as group 5, is left out: a table is read
for its asteroids, and `earth` has the Earth. What a layout has beside ids, names and orbits
(group, mass) is in the catalogue's `extra` by the column's name. A table of one's own is best
written in the GTOC12 layout::

    ID epoch(MJD) a(AU) e i(deg) LAN(deg) argperi(deg) M(deg)
    1 64328 2.3614601 0.0886122 7.14049 103.85129 151.21722 326.5320247
"""

import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Final, final

import numpy as np

from feasibility.constants import AU, MJD2000_MJD
from feasibility.errors import InputError
from feasibility.orbits.catalogue import Catalogue

_ORBIT: Final = ("a", "e", "i", "node", "argp", "M")
_MAX_MJD: Final = 200_000.0
_MAX_A_AU: Final = 1e4


@final
@dataclass(frozen=True)
class _Layout:
    """How one table is written."""

    name: str
    header: str
    """The header's words in lower case, without ``#`` and units in parentheses."""
    columns: tuple[str, ...]
    """What each column is; the last may hold several words if it is the name."""


_LAYOUTS: Final = (
    _Layout(
        "GTOC2",
        "spkid a e i lan argperi m epoch group",
        ("id", *_ORBIT, "epoch", "group"),
    ),
    _Layout(
        "GTOC4",
        "name epoch a e i lan arg. periap. mean anomaly",
        ("quoted name", "epoch", *_ORBIT),
    ),
    _Layout(
        "GTOC5",
        "epoch a e i w node m object",
        ("epoch", "a", "e", "i", "argp", "node", "M", "name"),
    ),
    _Layout(
        "GTOC7",
        "num epoch a e i w node m name",
        ("id", "epoch", "a", "e", "i", "argp", "node", "M", "name"),
    ),
    _Layout(
        "GTOC11",
        "id epoch_mjd a_au e inc_deg raan_deg argp_deg m_deg mass_kg",
        ("id", "epoch", *_ORBIT, "mass"),
    ),
    _Layout(
        "GTOC12",
        "id epoch a e i lan argperi m",
        ("id", "epoch", *_ORBIT),
    ),
)

_FURTHER: Final = ("group", "mass")
"""Columns that are not part of the orbit: `Catalogue.extra`."""

_EARTH_GROUP: Final = 5.0

_RANGES: Final[dict[str, tuple[Callable[[float], bool], str]]] = {
    "a": (lambda x: 0.0 < x <= _MAX_A_AU, "a semi-major axis in AU, more than 0"),
    "e": (lambda x: 0.0 <= x < 1.0, "an eccentricity of an ellipse, 0 <= e < 1"),
    "i": (lambda x: 0.0 <= x <= 180.0, "an inclination of 0 to 180 degrees"),
    "node": (lambda x: abs(x) <= 720.0, "an angle in degrees"),
    "argp": (lambda x: abs(x) <= 720.0, "an angle in degrees"),
    "M": (lambda x: abs(x) <= 720.0, "an angle in degrees"),
    "epoch": (lambda x: 0.0 <= x <= _MAX_MJD, f"an epoch in MJD, 0 to {_MAX_MJD:g}"),
    "group": (lambda _: True, "a number"),
    "mass": (lambda _: True, "a number"),
}
"""What each numeric column must satisfy, beyond being finite."""


def read_catalogue(path: str | PathLike[str]) -> Catalogue:
    """Read an asteroid table of GTOC2, 4, 5, 7, 11 or 12.

    Parameters
    ----------
    path : path-like
        The table, as the organisers published it (any line ends).

    Returns
    -------
    Catalogue
        The asteroids in the order of the file; `source` is the path, `extra` has the
        columns ``group`` (GTOC2) and ``mass`` in kg (GTOC11).

    Raises
    ------
    InputError
        The file cannot be read, is not text, is empty or in an unknown layout;
        or a line has a wrong number of columns, something that is not a
        finite number, a value out of range, or an id seen before. The message
        names the file, the line and what was expected.
    """
    file = Path(path)
    lines = _lines(file)
    start, layout = _recognise(file, lines)
    ids: list[int] = []
    names: list[str] = []
    orbits: list[list[float]] = []
    extra: dict[str, list[float]] = {column: [] for column in layout.columns if column in _FURTHER}
    line_of_id: dict[int, int] = {}
    for number, row in _rows(file, lines, start, layout):
        if row.values.get("group") == _EARTH_GROUP:
            continue
        identity = len(ids) + 1 if row.identity is None else row.identity
        if identity in line_of_id:
            raise InputError(
                f"{file}, line {number}: id {identity} was given to line "
                f"{line_of_id[identity]} already; expected different ids"
            )
        line_of_id[identity] = number
        ids.append(identity)
        names.append(str(identity) if row.name is None else row.name)
        orbits.append([row.values[column] for column in ("epoch", *_ORBIT)])
        for column, values in extra.items():
            values.append(row.values[column])
    if not ids:
        raise InputError(
            f"{file}: the table is empty; expected rows of {layout.name} after the header"
        )
    table = np.array(orbits)
    elements = np.column_stack([table[:, 1] * AU, table[:, 2], np.radians(table[:, 3:])])
    return Catalogue(
        ids, names, table[:, 0] - MJD2000_MJD, elements, source=str(file), extra=extra
    )


def _lines(file: Path) -> list[str]:
    try:
        data = file.read_bytes()
    except FileNotFoundError:
        raise InputError(f"{file}: no such file; expected an asteroid table") from None
    except IsADirectoryError:
        raise InputError(f"{file}: is a folder; expected an asteroid table") from None
    except OSError as error:
        raise InputError(f"{file}: cannot be read ({error.strerror})") from None
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        number = len(re.split(rb"\r\n|\r|\n", data[: error.start]))
        raise InputError(
            f"{file}, line {number}: byte 0x{data[error.start]:02x} is not UTF-8 text; "
            "expected an asteroid table as plain text"
        ) from None
    if not text.strip():
        raise InputError(f"{file}: the file is empty; expected an asteroid table")
    return re.split(r"\r\n|\r|\n", text)


def _recognise(file: Path, lines: list[str]) -> tuple[int, _Layout]:
    """Return the index of the first line after the header, and the layout."""
    for index, line in enumerate(lines):
        comment = line.lstrip().startswith("#")
        words = " ".join(re.sub(r"\([^)]*\)", " ", line.lower()).replace("#", " ").split())
        for layout in _LAYOUTS:
            # The comma or dot that some headers end with is no part of the last word.
            if words.rstrip(".,;") == layout.header:
                return index + 1, layout
        if words and not comment:
            break
    known = ", ".join(layout.name for layout in _LAYOUTS)
    raise InputError(
        f"{file}, line {index + 1}: unknown layout; expected the header line of an asteroid "
        f"table ({known})"
    )


@final
@dataclass(frozen=True)
class _Row:
    identity: int | None
    name: str | None
    values: dict[str, float]


def _rows(file: Path, lines: list[str], start: int, layout: _Layout) -> Iterator[tuple[int, _Row]]:
    last = len(lines) - 1
    for index in range(start, len(lines)):
        line = lines[index].strip()
        # GTOC7 underlines its header with dashes.
        if not line or line.startswith("#") or not line.strip("- \t"):
            continue
        try:
            row = _parse(line, layout)
        except _RowError as error:
            cut = "; the last line has no line end: is the file truncated?"
            raise InputError(
                f"{file}, line {index + 1}: {error}{cut if index == last else ''}"
            ) from None
        yield index + 1, row


@final
class _RowError(Exception):
    """What is wrong with one row; the caller knows the file and the line."""


def _parse(line: str, layout: _Layout) -> _Row:
    columns = layout.columns
    name = None
    if columns[0] == "quoted name":
        quoted = re.match(r"'([^']+)'(?=\s)", line)
        if quoted is None:
            raise _RowError(f"expected a name in single quotes first, as {layout.name} has it")
        name, line, columns = quoted[1].strip(), line[quoted.end() :], columns[1:]
    words = line.split(None, len(columns) - 1) if columns[-1] == "name" else line.split()
    if len(words) != len(columns):
        raise _RowError(
            f"{len(words)} columns, expected {len(columns)} of {layout.name}: {', '.join(columns)}"
        )
    identity = None
    values = {}
    for column, word in zip(columns, words, strict=True):
        if column == "name":
            name = word
        elif column == "id":
            identity = _identity(word)
        else:
            values[column] = _number(column, word)
    return _Row(identity, name, values)


def _identity(word: str) -> int:
    if not (word.isascii() and word.isdigit() and len(word) < 19):
        raise _RowError(f"id is {word!r}; expected a whole number")
    return int(word)


def _number(column: str, word: str) -> float:
    within, expectation = _RANGES[column]
    try:
        # Python reads 1_000 as a number; no table writes that on purpose.
        value = math.nan if "_" in word else float(word)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and within(value)):
        raise _RowError(f"{column} is {word!r}; expected {expectation}")
    return value
