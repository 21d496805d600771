"""Rows of tables with a header: split, read as numbers, checked."""

import math
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

from feasibility.errors import InputError
from feasibility.orbits.readers.bodies import A_RANGE_AU, MAX_MJD, TOO_WIDE, UNBOUND, WORDS
from feasibility.orbits.readers.columns import FURTHER, JD_MJD, STRICT, in_table_units
from feasibility.orbits.readers.header import COMMENT, SEPARATORS, Header, split_cells
from feasibility.orbits.readers.json_text import JULIAN
from feasibility.orbits.readers.perihelion import a_of, mean_anomaly_of, mjd_of_calendar

_MIN_A_AU, _MAX_A_AU = A_RANGE_AU
_NEARLY_OPEN: Final = 0.99
_CALENDAR: Final = 1e7
"""Numbers from which times are calendar dates such as 19860205.9."""
_TRUTH: Final = {"Y": 1.0, "N": 0.0, "true": 1.0, "false": 0.0}

_OTHER_UNITS: Final = ("km", "m", "rad", "jd", "mjd2000")

_FORTRAN: Final = re.compile(r"([+-]?\d*\.?\d*)[dD]([+-]?\d+)")
_QUOTED: Final = re.compile(r"'([^']+)'(?=\s)")

_RANGES: Final[dict[str, tuple[Callable[[float], bool], str]]] = {
    "a": (
        lambda x: _MIN_A_AU <= x <= _MAX_A_AU,
        f"a semi-major axis in AU, more than 0: {_MIN_A_AU:g} to {_MAX_A_AU:g}",
    ),
    "e": (lambda x: 0.0 <= x < 1.0, "an eccentricity of an ellipse, 0 <= e < 1"),
    "i": (lambda x: 0.0 <= x <= 180.0, "an inclination of 0 to 180 degrees"),
    "node": (lambda x: abs(x) <= 720.0, "an angle in degrees"),
    "argp": (lambda x: abs(x) <= 720.0, "an angle in degrees"),
    "M": (lambda x: abs(x) <= 720.0, "an angle in degrees"),
    "epoch": (lambda x: 0.0 <= x <= MAX_MJD, f"an epoch in MJD, 0 to {MAX_MJD:g}"),
    "q": (
        lambda x: 0.0 < x <= _MAX_A_AU,
        f"a perihelion distance in AU, more than 0, up to {_MAX_A_AU:g}",
    ),
    "tp": (lambda x: abs(x) <= 1e8, "a time of perihelion: MJD, Julian date or YYYYMMDD.D"),
    "group": (lambda _: True, "a number"),
    "mass": (lambda _: True, "a number"),
}
"""What each numeric column must satisfy in AU, degrees and MJD, beyond being finite."""


@final
@dataclass(frozen=True)
class Row:
    """One body.

    Attributes
    ----------
    line : int
        Number of its line, from 1.
    identity : int, optional
        Its id, where the table has some.
    name : str, optional
        Its name, where the table has some.
    values : dict of str to float
        Epoch in MJD, a in AU, angles in degrees, and what else the table has.
    fault : str
        Why the body is left out, as for `LeftOut`; empty for one that is not.
    """

    line: int
    identity: int | None
    name: str | None
    values: dict[str, float]
    fault: str = ""


@final
class _RowError(Exception):
    """What is wrong with one row; the caller knows the file and the line."""


def read_rows(file: Path, lines: Sequence[str], header: Header, all_bound: bool) -> Iterator[Row]:
    """Yield the rows below a header, also of bodies that are no use: those have a fault.

    Parameters
    ----------
    file : Path
        For messages.
    lines : sequence of str
        The whole table.
    header : Header
        How it is written.
    all_bound : bool
        Whether an orbit that is no ellipse is an error; else such a body has a fault.

    Raises
    ------
    InputError
        A line has a wrong number of columns, something that is no finite number, or a value
        out of range; the message names file, line and column.
    """
    last = len(lines) - 1
    julian: bool | None = None
    begun = False
    for index in range(header.first, len(lines)):
        line = lines[index]
        stripped = line.strip()
        if not stripped or stripped.startswith(COMMENT) or not stripped.strip("-=+|* \t"):
            continue
        if not begun and not any(letter.isdigit() for letter in stripped):
            # A second line of the header, with the units.
            _check_units_line(file, index, stripped)
            continue
        begun = True
        try:
            cells = _cells(line, header)
            if julian is None:
                julian = _is_julian(header, cells)
            row = _row(index + 1, cells, header, julian, all_bound)
        except _RowError as error:
            cut = "; the last line has no line end: is the file truncated?"
            raise InputError(
                f"{file}, line {index + 1}: {error}{cut if index == last else ''}"
            ) from None
        yield row


def takes_julian_dates(lines: Sequence[str], header: Header) -> bool:
    """Return whether the epochs of a table whose header is silent are Julian dates."""
    for line in lines[header.first :]:
        try:
            return _is_julian(header, _cells(line, header))
        except _RowError:
            continue
    return False


def _check_units_line(file: Path, index: int, line: str) -> None:
    if re.search(r"\brad|\bkm\b|\bJD\b|MJD2000", line):
        raise InputError(
            f"{file}, line {index + 1}: units in a line of their own, {line!r}; "
            "expected AU, degrees and MJD, or the units in parentheses behind the names"
        )


def _is_julian(header: Header, cells: Sequence[str]) -> bool:
    for column, cell in zip(header.columns, cells, strict=True):
        if column.meaning == "epoch" and not column.unit:
            value = _float(cell)
            return JULIAN[0] <= value <= JULIAN[1]
    return False


def _cells(line: str, header: Header) -> list[str]:
    columns = header.columns
    count = len(columns)
    if header.widths:
        # The last column may be wider than its dashes, and numbers stand right-aligned.
        ends = [*(end for _, end in header.widths[:-1]), len(line)]
        begins = [0, *ends[:-1]]
        return [line[begin:end].strip() for begin, end in zip(begins, ends, strict=True)]
    line = line.strip()
    if header.separator and header.separator in line:
        cells = split_cells(line, header.separator)
        if len(cells) == count + 1 and not cells[-1]:
            cells.pop()
        if len(cells) == count:
            return cells
        raise _RowError(_wrong_count(len(cells), header))
    if header.quoted:
        quoted = _QUOTED.match(line)
        if quoted is None:
            raise _RowError(f"expected a name in single quotes first, as {header.label} has it")
        words = line[quoted.end() :].split()
        if len(words) != count - 1:
            raise _RowError(_wrong_count(len(words), header, count - 1))
        return [quoted[1].strip(), *words]
    words = line.split()
    if len(words) == count:
        return words
    names = [place for place, column in enumerate(columns) if column.meaning == "name"]
    if len(words) > count and len(names) == 1:
        # A name may have several words.
        place, more = names[0], len(words) - count
        if place == count - 1:
            return line.split(None, count - 1)
        name = " ".join(words[place : place + more + 1])
        return [*words[:place], name, *words[place + more + 1 :]]
    for mark in SEPARATORS:
        # The header has blanks, the rows have something else.
        cells = split_cells(line, mark)
        if len(cells) == count:
            return cells
    raise _RowError(_wrong_count(len(words), header))


def _wrong_count(found: int, header: Header, expected: int | None = None) -> str:
    names = header.meanings()
    count = len(names) if expected is None else expected
    return f"{found} columns, expected {count} of {header.label}: {', '.join(names[-count:])}"


def _row(number: int, cells: Sequence[str], header: Header, julian: bool, all_bound: bool) -> Row:
    """Return one row; one that lacks a number may do so in a table with separators."""
    identity: int | None = None
    name: str | None = None
    values: dict[str, float] = {}
    fault = "" if all_bound else _unbound(header, cells)
    unbound = bool(fault)
    for column, cell in zip(header.columns, cells, strict=True):
        meaning = column.meaning
        if meaning is None or (meaning in FURTHER and meaning in values):
            continue
        if meaning == "name":
            name = name or cell.strip("'\" ") or None
        elif meaning in FURTHER and meaning not in STRICT:
            values[meaning] = _further(cell)
        elif not cell and (header.separator or header.widths):
            if meaning in STRICT:
                values[meaning] = math.nan
            elif not fault:
                fault = f"without {WORDS.get(meaning, meaning)}"
        elif meaning == "id":
            identity = _identity(cell) if identity is None else identity
        elif not unbound:
            unit = "jd" if julian and meaning == "epoch" and not column.unit else column.unit
            values[meaning] = _number(meaning, unit, cell)
    if not fault:
        _complete(values)
        low, high = A_RANGE_AU
        fault = "" if low <= values["a"] <= high else TOO_WIDE
    return Row(number, identity, name, values, fault)


def _unbound(header: Header, cells: Sequence[str]) -> str:
    """Return the fault of an orbit that is no ellipse, or nearly none; empty for others."""
    value = {
        column.meaning: _float(cell)
        for column, cell in zip(header.columns, cells, strict=True)
        if column.meaning in ("a", "e")
    }
    e = value.get("e", math.nan)
    if 1.0 <= e < math.inf:
        return UNBOUND
    # A comet from far away, not a semi-major axis in another unit.
    return TOO_WIDE if e > _NEARLY_OPEN and value.get("a", 0.0) > _MAX_A_AU else ""


def _complete(values: dict[str, float]) -> None:
    """Add semi-major axis and mean anomaly where a row has its perihelion in their place."""
    if "a" not in values:
        values["a"] = float(a_of(values["q"], values["e"]))
    if "M" not in values:
        passage = values["tp"]
        if passage > _CALENDAR:
            passage = mjd_of_calendar(passage)
        elif JULIAN[0] <= passage <= JULIAN[1]:
            passage -= JD_MJD
        if not abs(passage) <= MAX_MJD:
            raise _RowError(
                f"tp is {values['tp']:.10g}; expected a time of perihelion: MJD, Julian date or "
                "YYYYMMDD.D"
            )
        values["M"] = float(mean_anomaly_of(passage, values["epoch"], values["a"]))


def _further(cell: str) -> float:
    """Return a number beside the orbit, NaN where there is none."""
    value = _TRUTH.get(cell, _float(cell))
    return value if math.isfinite(value) else math.nan


def _identity(word: str) -> int:
    if not (word.isascii() and word.isdigit() and len(word) < 19):
        raise _RowError(f"id is {word!r}; expected a whole number")
    return int(word)


def _float(word: str) -> float:
    """Return a number, NaN for what is none."""
    try:
        # Python reads 1_000 as a number; no table writes that on purpose.
        return math.nan if "_" in word else float(word)
    except ValueError:
        fortran = _FORTRAN.fullmatch(word)
        return math.nan if fortran is None else _float(f"{fortran[1]}e{fortran[2]}")


def _number(meaning: str, unit: str, word: str) -> float:
    within, expectation = _RANGES[meaning]
    value = _float(word)
    if unit in _OTHER_UNITS and math.isfinite(value):
        value = in_table_units(meaning, unit, value)
    if math.isfinite(value) and within(value):
        return value
    hint = ""
    if meaning == "epoch" and JULIAN[0] <= value <= JULIAN[1]:
        hint = f"; is it a Julian date? then it is MJD {value - JD_MJD:.10g}"
    elif re.fullmatch(r"[+-]?\d+,\d+", word):
        hint = ", with a decimal point"
    in_unit = f" ({unit} by the header)" if unit in _OTHER_UNITS else ""
    raise _RowError(f"{meaning} is {word!r}{in_unit}; expected {expectation}{hint}")
