"""Asteroid tables: those of the GTOC problems, of the MPC and JPL, and any with a header.

A table is read by the names in its header line, whatever the file is called and in
whatever order the columns stand, parted by commas, semicolons, bars, tabs or blanks:

=========  =====================================================================
column     names (capitals do not matter, but for Omega and omega)
=========  =====================================================================
epoch      epoch, epoch_mjd, epoch.mjd, epoch_jd, epoch_mjd2000, t0, jdtdb
a, e       a, sma, semi-major axis; e, ecc, ec, eccentricity
i          i, inc, incl, in, inclination
node       node, om, raan, LAN, Omega, longitude of ascending node
argp       w, argp, peri, argperi, aop, omega, argument of perihelion
M          M, ma, mean anomaly
id         id, spkid, num, number; the row's number, from 1, where there is none
name       name, full_name, object, designation, pdes; the id where there is none
=========  =====================================================================

Units stand in parentheses behind a name or after an underscore: ``a(km)``, ``i_rad``,
``epoch(MJD2000)``. Without any they are AU, degrees and MJD; Julian dates are known by their
size. A unit that is not known is an error. A table of one's own is best written as::

    ID epoch(MJD) a(AU) e i(deg) LAN(deg) argperi(deg) M(deg)
    1 64328 2.3614601 0.0886122 7.14049 103.85129 151.21722 326.5320247

Of the GTOC problems mind that 3, 5 and 7 give the argument of perihelion before the node, 4
has names in single quotes, and 2 lists the Earth as group 5 after its 910 asteroids, which is left
out: a table is read for its asteroids, and `earth` has the Earth. What a table has beside ids,
names and orbits (group, mass) is in the catalogue's `extra` by the column's name. The MPC's
``MPCORB.DAT`` and elements of JPL Horizons are read too. Empty lines and comments (``#``, ``%``)
are skipped; files may be gzipped.
"""

import datetime
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from feasibility.constants import AU, MJD2000_MJD
from feasibility.errors import InputError
from feasibility.orbits.catalogue import Catalogue
from feasibility.orbits.readers.columns import ANGLES, FURTHER, NEEDED, ORBIT
from feasibility.orbits.readers.header import Header, find_header
from feasibility.orbits.readers.horizons import horizons_table
from feasibility.orbits.readers.mpcorb import is_mpcorb, mpcorb_rows
from feasibility.orbits.readers.rows import Row, read_rows, takes_julian_dates
from feasibility.orbits.readers.text import read_lines
from feasibility.orbits.spk.files import is_kernel

_NODE_LAST: Final = ("epoch", "a", "e", "i", "argp", "node", "M")
_KNOWN: Final = {
    ("id", *ORBIT, "epoch", "group"): "GTOC2",
    ("name", "epoch", *ORBIT): "GTOC4",
    (*_NODE_LAST, "name"): "GTOC5",
    ("id", *_NODE_LAST, "name"): "GTOC7",
    ("id", "epoch", *ORBIT, "mass"): "GTOC11",
    ("id", "epoch", *ORBIT): "GTOC12",
}
"""Layouts by their columns, for messages."""

_EARTH_GROUP: Final = 5.0
_MJD_1950: Final = 33_282.0
_LEAST_ROWS: Final = 3
"""Rows from which a table is asked about radians."""


def read_catalogue(path: str | PathLike[str]) -> Catalogue:
    """Read an asteroid table.

    What is odd, but not surely wrong, is warned about: angles that look like radians, names that
    are no UTF-8, Julian dates under a header that does not say so, rows that are left out as they
    lack an element.

    Parameters
    ----------
    path : path-like
        The table, as its publishers wrote it (any line ends, also gzipped).

    Returns
    -------
    Catalogue
        The asteroids in the order of the file; `source` is the path, `extra` has the
        columns ``group`` and ``mass`` in kg, where the table has them.

    Raises
    ------
    InputError
        The file cannot be read, is not text, is empty or in an unknown layout;
        or a line has a wrong number of columns, something that is not a
        finite number, a value out of range, or an id seen before. The message
        names the file, the line and what was expected.
    """
    file = Path(path)
    if is_kernel(file):
        # Imported here: tables have no need of it.
        from feasibility.orbits.spk.reading import read_kernels

        return read_kernels(file)
    lines: Sequence[str] = read_lines(file)
    header = None
    name = None
    if is_mpcorb(lines):
        rows, label = mpcorb_rows(file, lines), "MPCORB"
    else:
        _check_other(file, lines)
        horizons = horizons_table(file, lines)
        if horizons is not None:
            lines, name = horizons
        header = find_header(file, lines, _KNOWN, quoted=_quoted(lines))
        rows, label = read_rows(file, lines, header), header.label
    kept = list(_kept(file, rows, name))
    bodies = [row for _, row in kept]
    if not bodies:
        raise InputError(f"{file}: the table is empty; expected rows of {label} after the header")
    table = np.array([[row.values[column] for column in NEEDED] for row in bodies])
    if header is not None:
        _warn(file, lines, header, table)
    elements = np.column_stack([table[:, 1] * AU, table[:, 2], np.radians(table[:, 3:])])
    return Catalogue(
        [identity for identity, _ in kept],
        [row.name or str(identity) for identity, row in kept],
        table[:, 0] - MJD2000_MJD,
        elements,
        source=str(file),
        extra={
            column: [row.values[column] for row in bodies]
            for column in FURTHER
            if column in bodies[0].values
        },
    )


def _quoted(lines: Sequence[str]) -> tuple[str, ...]:
    """Return the layouts whose names are quoted: GTOC4, told from other tables by its header."""
    return ("GTOC4",) if any("arg. periap." in line.lower() for line in lines[:20]) else ()


def _check_other(file: Path, lines: Sequence[str]) -> None:
    """Name formats that are known, but not read."""
    begin = next(line.strip() for line in lines if line.strip())
    if begin.startswith(("{", "[{", "[")) and not begin.startswith("[]"):
        raise InputError(f"{file}: is JSON; expected a table, such as the MPC's MPCORB.DAT")
    if begin.startswith("<"):
        raise InputError(f"{file}: is XML or a web page; expected a table as plain text")


def _kept(file: Path, rows: Iterator[Row | None], name: str | None) -> Iterator[tuple[int, Row]]:
    """Yield the asteroids, each with an id of its own; tell how many rows were left out."""
    line_of_id: dict[int, int] = {}
    left_out = 0
    for row in rows:
        if row is None:
            left_out += 1
            continue
        if row.values.get("group") == _EARTH_GROUP:
            continue
        identity = len(line_of_id) + 1 if row.identity is None else row.identity
        if identity in line_of_id:
            raise InputError(
                f"{file}, line {row.line}: id {identity} was given to line "
                f"{line_of_id[identity]} already; expected different ids"
            )
        line_of_id[identity] = row.line
        yield identity, row if name is None else replace(row, name=name)
    if left_out:
        warnings.warn(
            f"{file}: {left_out} of {left_out + len(line_of_id)} rows lack an element of an "
            "ellipse and are left out",
            stacklevel=4,
        )


def _date(mjd: float) -> str:
    return datetime.date.fromordinal(int(mjd) + 678_576).isoformat()


def _warn(file: Path, lines: Sequence[str], header: Header, table: NDArray[np.float64]) -> None:
    degrees = any(column.unit for column in header.columns if column.meaning in ANGLES)
    angles = np.abs(table[:, 3:])
    if (
        not degrees
        and len(table) >= _LEAST_ROWS
        and angles.max() <= 2.0 * np.pi
        and angles.max() > 0.0
    ):
        warnings.warn(
            f"{file}: all angles are within 0 to 2 pi and are read as degrees; if they are "
            "radians, write i(rad), node(rad), argp(rad) and M(rad) in the header",
            stacklevel=3,
        )
    silent = any(column.meaning == "epoch" and not column.unit for column in header.columns)
    if silent and table[:, 0].min() < _MJD_1950:
        day = table[:, 0].min()
        warnings.warn(
            f"{file}: epoch {day:g} is read as MJD, {_date(day)}; if it is another count of days, "
            "write epoch(MJD2000) or epoch(JD) in the header",
            stacklevel=3,
        )
    if silent and takes_julian_dates(lines, header):
        warnings.warn(
            f"{file}: the epochs are read as Julian dates: {table[0, 0] + 2_400_000.5:.10g} is "
            f"MJD {table[0, 0]:.10g}",
            stacklevel=3,
        )
