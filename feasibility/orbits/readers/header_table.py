"""Tables with a header line: its rows as a `BodyTable`, and what is odd about them."""

import datetime
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from feasibility.errors import InputError
from feasibility.orbits.readers.bodies import BodyTable, LeftOutCounts
from feasibility.orbits.readers.columns import ANGLES, FURTHER, NEEDED
from feasibility.orbits.readers.header import SEPARATORS, Header, find_header
from feasibility.orbits.readers.rows import Row, read_rows, takes_julian_dates
from feasibility.orbits.readers.sbdb import numbers_of_names

_MJD_1950: Final = 33_282.0
_LEAST_ROWS: Final = 3
"""Rows from which a table is asked about radians."""

_NUMBERED_NAMES: Final = ("full_name", "fullname", "pdes")
"""Columns of JPL's database that begin with a body's number, where it has one."""


def header_bodies(
    file: Path,
    lines: Sequence[str],
    *,
    known: Mapping[tuple[str, ...], str],
    quoted: Sequence[str],
    all_bound: Callable[[Header], bool],
    skipped: Callable[[Row], bool],
    units: Mapping[str, str],
    notes: tuple[str, ...] = (),
) -> BodyTable:
    """Return the bodies of a table with a header.

    Parameters
    ----------
    file, lines, known, quoted, units
        As for `find_header`.
    all_bound : callable
        Whether an orbit that is no ellipse is an error in such a table.
    skipped : callable
        Which rows are no bodies to visit.
    notes : tuple of str
        What is known of the file already.

    Raises
    ------
    InputError
        As `find_header` and `read_rows`, an id occurs twice, or there are no bodies.
    """
    header = find_header(file, lines, known, quoted, units)
    numbers = _numbers(file, lines, header, all_bound(header))
    line_of_id: dict[int, int] = {}
    left_out = LeftOutCounts()
    rows: list[Row] = []
    for row in read_rows(file, lines, header, all_bound(header)):
        if row.fault:
            left_out.add(row.fault, row.name or f"line {row.line}")
            continue
        if skipped(row):
            continue
        identity = numbers.get(row.line, row.identity)
        identity = len(line_of_id) + 1 if identity is None else identity
        if identity in line_of_id:
            raise InputError(
                f"{file}, line {row.line}: id {identity} was given to line "
                f"{line_of_id[identity]} already; expected different ids"
            )
        line_of_id[identity] = row.line
        rows.append(row)
    if not rows:
        out = ", ".join(map(str, left_out.counts()))
        raise InputError(
            f"{file}: the table is empty; expected rows of {header.label} after the header"
            + (f" that can be used, found {out}" if out else "")
        )
    orbits = np.array([[row.values[column] for column in NEEDED] for row in rows])
    ids = np.array(list(line_of_id), np.int64)
    plain = "table" if header.label not in known.values() else header.label
    return BodyTable(
        "CSV" if header.separator in SEPARATORS else plain,
        ids,
        tuple(row.name or str(identity) for identity, row in zip(line_of_id, rows, strict=True)),
        orbits,
        {
            column: np.array([row.values.get(column, np.nan) for row in rows])
            for column in FURTHER
            if column in rows[0].values
        },
        left_out.counts(),
        (*notes, *_oddities(lines, header, orbits)),
    )


def _numbers(file: Path, lines: Sequence[str], header: Header, all_bound: bool) -> dict[int, int]:
    """Return ids by lines where names of JPL's database tell them and no column does."""
    meanings = [column.meaning for column in header.columns]
    word = next((column.word for column in header.columns if column.meaning == "name"), "")
    if "id" in meanings or word.strip("'\" ").lower() not in _NUMBERED_NAMES:
        return {}
    rows = list(read_rows(file, lines, header, all_bound))
    ids = numbers_of_names([row.name or "" for row in rows])
    return {row.line: identity for row, identity in zip(rows, ids.tolist(), strict=True)}


def _date(mjd: float) -> str:
    return datetime.date.fromordinal(int(mjd) + 678_576).isoformat()


def _oddities(lines: Sequence[str], header: Header, table: NDArray[np.float64]) -> list[str]:
    """Return notes about what is odd, but not surely wrong."""
    notes = []
    degrees = any(column.unit for column in header.columns if column.meaning in ANGLES)
    angles = np.abs(table[:, 3:])
    if (
        not degrees
        and len(table) >= _LEAST_ROWS
        and angles.max() <= 2.0 * np.pi
        and angles.max() > 0.0
    ):
        notes.append(
            ": all angles are within 0 to 2 pi and are read as degrees; if they are radians, "
            "write i(rad), node(rad), argp(rad) and M(rad) in the header"
        )
    silent = any(column.meaning == "epoch" and not column.unit for column in header.columns)
    if silent and table[:, 0].min() < _MJD_1950:
        day = table[:, 0].min()
        notes.append(
            f": epoch {day:g} is read as MJD, {_date(day)}; if it is another count of days, "
            "write epoch(MJD2000) or epoch(JD) in the header"
        )
    if silent and takes_julian_dates(lines, header):
        notes.append(
            f": the epochs are read as Julian dates: {table[0, 0] + 2_400_000.5:.10g} is "
            f"MJD {table[0, 0]:.10g}"
        )
    return notes
