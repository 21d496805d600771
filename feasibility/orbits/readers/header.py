"""Headers of tables: what the columns are, in which units, and what parts them."""

import csv
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, final

from feasibility.errors import InputError
from feasibility.orbits.readers.columns import (
    INSTEAD,
    NEEDED,
    STRICT,
    Column,
    UnitError,
    column_of,
    with_unit,
)

EXAMPLE: Final = "ID epoch(MJD) a(AU) e i(deg) LAN(deg) argperi(deg) M(deg)"
"""A header line that is read: messages show it."""

COMMENT: Final = ("#", "%", "!", "//")

_PREAMBLE: Final = 60
"""Lines before a header that may hold anything."""

SEPARATORS: Final = (",", ";", "|")
_PARENTHESES: Final = re.compile(r"\(([^)]*)\)|\[([^\]]*)\]")
_WORD: Final = re.compile(r"([^\s(\[]+)\s*(?:\(([^)]*)\)|\[([^\]]*)\])?")
_PHRASES: Final = {"arg. periap.": "argperi", "mean anomaly": "M"}
"""Names of several words that a header without separators may have."""
_ALMOST: Final = 4
"""With so many columns of an orbit a line is meant as a header."""


@final
@dataclass(frozen=True)
class Header:
    """How one table is written.

    Attributes
    ----------
    label : str
        Name of the layout, or "the header".
    columns : tuple of Column
        In the order of the file.
    separator : str
        Between the columns; empty for white space.
    first : int
        Index of the first line after the header.
    widths : tuple of pair of int
        Where the columns begin and end, of tables of fixed widths; else empty.
    quoted : bool
        Whether names stand in single quotes.
    """

    label: str
    columns: tuple[Column, ...]
    separator: str
    first: int
    widths: tuple[tuple[int, int], ...]
    quoted: bool

    def meanings(self) -> list[str]:
        """Return what the columns are, those that are skipped by their words."""
        return [column.meaning or column.word for column in self.columns]


def find_header(
    file: Path,
    lines: Sequence[str],
    known: Mapping[tuple[str, ...], str],
    quoted: Sequence[str] = (),
    units: Mapping[str, str] | None = None,
) -> Header:
    """Return the header of a table.

    Parameters
    ----------
    file : Path
        For messages.
    lines : sequence of str
        The whole table.
    known : mapping
        Names of layouts by their columns.
    quoted : sequence of str
        Layouts whose names stand in single quotes.
    units : mapping of str to str, optional
        Units of columns, by their words or what they mean, where the header does not tell them.

    Raises
    ------
    InputError
        No line names all columns of an orbit, or a unit is not known.
    """
    faults: list[str] = []
    place = None
    for index, line in enumerate(lines):
        if index >= _PREAMBLE and place is not None:
            break
        words = _without_mark(line)
        if not words:
            continue
        if place is None and not line.lstrip().startswith(COMMENT):
            place = index
        try:
            columns, separator = _columns(words)
        except UnitError as error:
            faults.append(f"line {index + 1}: {error}")
            continue
        columns = _with_units_first(columns)
        after = lines[index + 1] if index + 1 < len(lines) else ""
        columns, widths = _widths(columns, lines[index], after)
        meanings = [column.meaning for column in columns]
        missing = [name for name in NEEDED if name not in meanings]
        # The names of comets have blanks: without a separator their columns are uncertain.
        instead = INSTEAD if separator or widths else {}
        if all(instead.get(name, "") in meanings for name in missing):
            _check_twice(file, index, columns)
            columns = _without_spare(_in_units(file, index, columns, units or {}))
            label = known.get(_layout(columns), "the header")
            return Header(label, columns, separator, index + 1, widths, label in quoted)
        if len(NEEDED) - len(missing) >= _ALMOST:
            comet = {"q", "tp"} & {column.word.lower() for column in columns}
            faults.append(
                f"line {index + 1}: no column {', '.join(missing)}"
                + (
                    "; comets, with q and the time of perihelion, are read from CSV and from "
                    "JPL's ELEMENTS.COMET"
                    if comet
                    else ""
                )
            )
    if faults:
        raise InputError(f"{file}, {faults[0]}; {_expected(known)}")
    number = (place if place is not None else len(lines) - 1) + 1
    raise InputError(f"{file}, line {number}: unknown layout; {_expected(known)}")


def _expected(known: Mapping[tuple[str, ...], str]) -> str:
    names = ", ".join(known.values())
    return f"expected the header line of an asteroid table ({names}), or one such as {EXAMPLE!r}"


def _without_mark(line: str) -> str:
    stripped = line.strip()
    for mark in COMMENT:
        stripped = stripped.removeprefix(mark)
    return stripped.strip()


def _columns(line: str) -> tuple[tuple[Column, ...], str]:
    """Return the columns of a header and its separator."""
    bare = _PARENTHESES.sub("", line)
    separator = next((mark for mark in SEPARATORS if bare.rstrip(mark).count(mark) > 5), "")
    tabs = [cell.strip() for cell in line.split("\t")]
    if not separator and len(tabs) > 6 and all(tabs):
        separator = "\t"
    if not separator:
        for phrase, name in _PHRASES.items():
            line = re.sub(re.escape(phrase), name, line, flags=re.IGNORECASE)
        parts = [(m[1], m[2] or m[3]) for m in _WORD.finditer(line)]
        return tuple(column_of(word, unit) for word, unit in parts), separator
    cells = []
    for cell in split_cells(line, separator):
        unit = _PARENTHESES.search(cell)
        word = _PARENTHESES.sub(" ", cell).strip()
        cells.append(column_of(word, None if unit is None else unit[1] or unit[2]))
    return tuple(cells), separator


def split_cells(line: str, separator: str) -> list[str]:
    """Return the cells of a line, which may stand in double quotes, without outer blanks."""
    if '"' in line:
        try:
            cells = next(csv.reader([line], delimiter=separator, skipinitialspace=True))
        except (csv.Error, StopIteration):
            cells = line.split(separator)
    else:
        cells = line.split(separator)
    return [cell.strip() for cell in cells]


def _with_units_first(columns: tuple[Column, ...]) -> tuple[Column, ...]:
    """Leave out columns of what another has with its unit: JPL has ``epoch`` and ``epoch_mjd``."""
    told = [column.meaning for column in columns if column.unit]
    return tuple(
        replace(column, meaning=None)
        if column.meaning in NEEDED and not column.unit and told.count(column.meaning) == 1
        else column
        for column in columns
    )


def _check_twice(file: Path, index: int, columns: Sequence[Column]) -> None:
    for name in NEEDED:
        words = [column.word for column in columns if column.meaning == name]
        if len(words) > 1:
            raise InputError(
                f"{file}, line {index + 1}: columns {' and '.join(words)} are both {name}; "
                "expected one"
            )


def _layout(columns: Sequence[Column]) -> tuple[str, ...]:
    """Return the meanings by which a layout is known."""
    return tuple(
        column.meaning for column in columns if column.meaning in ("id", "name", *NEEDED, *STRICT)
    )


def _in_units(
    file: Path, index: int, columns: tuple[Column, ...], units: Mapping[str, str]
) -> tuple[Column, ...]:
    """Return columns with units that the user tells."""
    changed = list(columns)
    for name, unit in units.items():
        places = [
            place
            for place, column in enumerate(columns)
            if column.meaning is not None
            and name.lower() in (column.word.lower(), column.meaning.lower())
        ]
        exact = [
            place for place in places if name in (columns[place].word, columns[place].meaning)
        ]
        places = exact or places
        if not places:
            words = ", ".join(column.word for column in columns if column.meaning is not None)
            raise InputError(
                f"{file}, line {index + 1}: units of {name!r}, which is no column; columns are "
                f"{words}"
            )
        try:
            for place in places:
                changed[place] = with_unit(columns[place], unit)
        except UnitError as error:
            raise InputError(f"{file}, line {index + 1}: {error}") from None
    return tuple(changed)


def _without_spare(columns: tuple[Column, ...]) -> tuple[Column, ...]:
    """Leave out what would stand in place of a column that is there."""
    meanings = [column.meaning for column in columns]
    spare = [other for name, other in INSTEAD.items() if name in meanings]
    return tuple(
        replace(column, meaning=None) if column.meaning in spare else column for column in columns
    )


def _widths(
    columns: tuple[Column, ...], header: str, after: str
) -> tuple[tuple[Column, ...], tuple[tuple[int, int], ...]]:
    """Return the columns and where dashes below a header begin and end, if they line up."""
    if "\t" in header or "\t" in after or after.strip("- "):
        return columns, ()
    dashes = [(m.start(), m.end()) for m in re.finditer(r"-+", after)]
    begin = [column.meaning for column in columns[:2]]
    if len(dashes) == len(columns) - 1 and begin == ["id", "name"]:
        # "Num  Name" of JPL's comets is one column, such as "1P/Halley".
        columns = columns[1:]
    return columns, tuple(dashes) if len(dashes) == len(columns) else ()
