"""Asteroid tables: those of the GTOC problems, of the MPC and JPL, and any with a header.

Formats of agencies have a reader each in `feasibility.orbits.readers`; `_read` asks them in turn.
Any other table is read by the names in its header line, whatever the file is called and in
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
names and orbits (group, mass, H, ...) is in the catalogue's `extra` by the column's name. Comets
may have ``q`` and ``tp`` (MJD, Julian date or YYYYMMDD.D) in place of a and M. Empty lines and
comments (``#``, ``%``) are skipped; files may be gzipped. Kernels are no tables, but are read too:
an SPK kernel, a folder of them or a meta-kernel, see `feasibility.orbits.spk.reading`.
"""

import warnings
from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Final

from feasibility.errors import InputError
from feasibility.orbits.catalogue import Catalogue
from feasibility.orbits.readers.astdys import astdys_bodies, is_astdys
from feasibility.orbits.readers.bodies import BodyTable
from feasibility.orbits.readers.cache import cached_table
from feasibility.orbits.readers.columns import ORBIT
from feasibility.orbits.readers.header import SEPARATORS
from feasibility.orbits.readers.header_table import header_bodies
from feasibility.orbits.readers.horizons import horizons_bodies, is_horizons
from feasibility.orbits.readers.json_text import is_json
from feasibility.orbits.readers.mpc_json import mpc_json_bodies
from feasibility.orbits.readers.mpcorb import is_mpcorb, mpcorb_bodies
from feasibility.orbits.readers.sbdb import sbdb_bodies
from feasibility.orbits.readers.text import read_bytes, text_lines, unpacked
from feasibility.orbits.selection import selected_bodies, selected_rows
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

_ALL_BOUND: Final = ("GTOC2", "GTOC4", "GTOC5", "GTOC7")
"""Tables of asteroids alone: an orbit that is no ellipse is damage there."""

_EARTH_GROUP: Final = 5.0


def read_catalogue(
    path: str | PathLike[str],
    *,
    units: Mapping[str, str] | None = None,
    select: str | None = None,
) -> Catalogue:
    """Read an asteroid table.

    What is odd, but not surely wrong, is warned about: angles that look like radians, names that
    are no UTF-8, Julian dates under a header that does not say so, rows that are left out as they
    lack an element or are no ellipse.

    Parameters
    ----------
    path : path-like
        The table, as its publishers wrote it (any line ends, also gzipped).
    units : mapping of str to str, optional
        Units of columns whose header does not tell them, such as ``{"i": "rad"}``.
    select : str, optional
        Which bodies are wanted, see `feasibility.orbits.selection.selected`; all by default.

    Returns
    -------
    Catalogue
        The asteroids in the order of the file; `source` is the path, `extra` has what else the
        table tells of them.

    Raises
    ------
    InputError
        The file cannot be read, is not text, is empty or in an unknown layout;
        or a line has a wrong number of columns, something that is not a
        finite number, a value out of range, or an id seen before; or the selection cannot be
        understood or is empty. The message names the file, the line and what was expected.
    """
    file = Path(path)
    if is_kernel(file):
        return _kernel_catalogue(file, dict(units or {}), select)
    bodies = read_bodies(file, units=units)
    for note in bodies.notes:
        warnings.warn(f"{file}{note}", stacklevel=2)
    if bodies.left_out:
        count = sum(part.count for part in bodies.left_out)
        warnings.warn(
            f"{file}: {count} of {bodies.total} rows lack an element of an ellipse and are left "
            f"out: {', '.join(map(str, bodies.left_out))}",
            stacklevel=2,
        )
    if select is not None:
        bodies = selected_bodies(bodies, select, str(file))
    return bodies.catalogue(str(file))


def read_bodies(path: str | PathLike[str], *, units: Mapping[str, str] | None = None) -> BodyTable:
    """Read an asteroid table as it is: in its own units, with what was left out and why.

    A large table is kept in the user's cache folder, from where it is read in a fraction of the
    time; see `feasibility.orbits.readers.cache`.

    Parameters
    ----------
    path, units
        As for `read_catalogue`.

    Raises
    ------
    InputError
        As `read_catalogue`.
    """
    file = Path(path)
    given = dict(units or {})
    if is_kernel(file):
        # Imported here: tables have no need of SPICE.
        from feasibility.orbits.spk.body_table import kernel_bodies

        return _of_fixed_units(file, kernel_bodies(file), given)
    data = read_bytes(file)
    with cached_table(data, given) as cached:
        if cached.table is None:
            cached.table = _read(file, unpacked(file, data), given)
        return cached.table


def _kernel_catalogue(file: Path, units: dict[str, str], select: str | None) -> Catalogue:
    # Imported here: tables have no need of SPICE.
    from feasibility.orbits.spk.reading import read_kernels

    if units:
        raise InputError(f"{file}: units are given, but SPK kernels have their own; expected none")
    catalogue = read_kernels(file)
    return catalogue if select is None else selected_rows(catalogue, select)


def _read(file: Path, data: bytes, units: dict[str, str]) -> BodyTable:
    """Read the content of a file by the first format that knows it."""
    if is_json(data):
        return _of_fixed_units(file, _read_json(file, data), units)
    if is_mpcorb(data):
        return _of_fixed_units(file, mpcorb_bodies(file, data), units)
    lines, notes = text_lines(file, data)
    begin = next(line.strip() for line in lines if line.strip())
    if begin.startswith("<"):
        raise InputError(f"{file}: is XML or a web page; expected a table as plain text")
    if is_horizons(lines):
        return _of_fixed_units(file, horizons_bodies(file, lines, notes), units)
    if is_astdys(lines):
        return _of_fixed_units(file, astdys_bodies(file, lines, notes), units)
    return header_bodies(
        file,
        lines,
        known=_KNOWN,
        quoted=_quoted(lines),
        all_bound=lambda header: header.label in _ALL_BOUND and header.separator not in SEPARATORS,
        skipped=lambda row: row.values.get("group") == _EARTH_GROUP,
        units=units,
        notes=notes,
    )


def _read_json(file: Path, data: bytes) -> BodyTable:
    if data.lstrip().startswith(b"["):
        return mpc_json_bodies(file, data)
    return sbdb_bodies(file, data)


def _of_fixed_units(file: Path, bodies: BodyTable, units: dict[str, str]) -> BodyTable:
    if units:
        raise InputError(
            f"{file}: units of {', '.join(map(repr, units))} are given, but {bodies.label} has "
            "units of its own; expected none"
        )
    return bodies


def _quoted(lines: Sequence[str]) -> tuple[str, ...]:
    """Return the layouts whose names are quoted: GTOC4, told from other tables by its header."""
    return ("GTOC4",) if any("arg. periap." in line.lower() for line in lines[:20]) else ()
