"""Tables of JPL Horizons between ``$$SOE`` and ``$$EOE``: osculating elements, and vectors.

Described in <https://ssd.jpl.nasa.gov/horizons/manual.html>. A file has one body at one or more
epochs, or several such tables one behind the other. Of each body the first epoch is read.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.constants import AU, DAY_S
from feasibility.errors import InputError
from feasibility.orbits.classical import cartesian_to_classical, classical_to_cartesian
from feasibility.orbits.readers.bodies import A_RANGE_AU, UNBOUND, BodyTable, LeftOut, sieved
from feasibility.orbits.readers.columns import JD_MJD
from feasibility.orbits.readers.sbdb import numbers_of_names

LABEL: Final = "Horizons"

_ELEMENTS: Final = ("A", "EC", "IN", "OM", "W", "MA")
_VECTOR: Final = ("X", "Y", "Z", "VX", "VY", "VZ")
_LENGTH_M: Final = {"AU": AU, "KM": 1e3}
_TIME_S: Final = {"D": DAY_S, "S": 1.0}
_OBLIQUITY: Final = np.radians(84381.448 / 3600.0)
"""Of the ecliptic of J2000 to the equator of the ICRF, as Horizons has it (IAU76)."""
_PAIR: Final = re.compile(r"([A-Za-z]+)\s*=\s*(-?\d*\.?\d+(?:[ED][+-]?\d+)?)(?=\s|$)")
_DAY: Final = re.compile(r"\s*(\d{7}\.\d+)\s*=")


def is_horizons(lines: Sequence[str]) -> bool:
    """Return whether a file is by Horizons."""
    return any(line.startswith("$$SOE") for line in lines)


@final
@dataclass(frozen=True)
class _Section:
    """One table of a file.

    Attributes
    ----------
    head : sequence of str
        The lines before it, from the end of the table before.
    first : int
        Index of its first row.
    rows : sequence of str
        Its lines.
    """

    head: Sequence[str]
    first: int
    rows: Sequence[str]

    def stated(self, what: str) -> str:
        """Return what the head says about something, empty where it is silent."""
        begins = (line.strip() for line in self.head)
        line = next((line for line in reversed(list(begins)) if line.startswith(what)), "")
        return line.partition(":")[2].strip()


def horizons_bodies(file: Path, lines: Sequence[str], notes: tuple[str, ...] = ()) -> BodyTable:
    """Return the bodies of a Horizons file, each at the first epoch of its table.

    Vectors become elements. A frame on the equator of the ICRF is turned to the ecliptic.

    Raises
    ------
    InputError
        There are no elements or vectors, not in units of AU or km and days or seconds, not about
        the Sun, in another frame, or as `sieved`.
    """
    names, orbits, places = [], [], []
    unbound: list[str] = []
    for section in _sections(file, lines):
        name = re.sub(r"\{.*", "", section.stated("Target body name")).strip() or "?"
        days = [day for day in map(_epoch_of, section.rows) if day is not None]
        if len(days) > 1:
            notes += (
                f": {len(days)} epochs of {name}, of which the first is read, "
                f"MJD {days[0] - JD_MJD:.10g}",
            )
        orbit = _orbit(file, section, len(days))
        if orbit is None:
            unbound.append(name)
            continue
        names.append(name)
        orbits.append(orbit)
        places.append(section.first)
    if not orbits:
        raise InputError(f"{file}: {', '.join(unbound)} {UNBOUND}; expected an ellipse")
    table = sieved(
        file,
        LABEL,
        numbers_of_names(names),
        tuple(names),
        np.array(orbits),
        {},
        lambda row: f"line {places[row] + 1} ({names[row]})",
        notes,
    )
    if not unbound:
        return table
    out = LeftOut(UNBOUND, len(unbound), tuple(unbound[:5]))
    return BodyTable(
        LABEL, table.ids, table.names, table.orbits, {}, (out, *table.left_out), notes
    )


def _sections(file: Path, lines: Sequence[str]) -> list[_Section]:
    sections = []
    after = 0
    begin: int | None = None
    for index, line in enumerate(lines):
        if line.startswith("$$SOE"):
            if begin is not None:
                raise InputError(f"{file}, line {index + 1}: $$SOE twice, expected $$EOE between")
            begin = index
        elif line.startswith("$$EOE"):
            if begin is None:
                raise InputError(
                    f"{file}, line {index + 1}: $$EOE before $$SOE, expected it behind"
                )
            sections.append(_Section(lines[after:begin], begin + 1, lines[begin + 1 : index]))
            after, begin = index + 1, None
    if begin is not None:
        raise InputError(f"{file}, line {len(lines)}: ends before $$EOE; is the file truncated?")
    for section in sections:
        if not any(row.strip() for row in section.rows):
            raise InputError(f"{file}, line {section.first}: no rows behind $$SOE; expected some")
    return sections


def _epoch_of(row: str) -> float | None:
    """Return the Julian date of a row that begins an epoch."""
    found = _DAY.match(row)
    word = found[1] if found is not None else row.partition(",")[0].strip()
    if found is None and "," not in row:
        return None
    try:
        return float(word)
    except ValueError:
        return None


def _orbit(file: Path, section: _Section, epochs: int) -> NDArray[np.float64] | None:
    """Return (7,) the orbit at the first epoch, None where it is unbound."""
    where = f"{file}, line {section.first + 1}"
    values = _values(where, section, epochs)
    length, second = _units(where, section, values)
    day = next((values[name] for name in ("JDTDB", "JDCT") if name in values), None)
    if day is None:
        raise InputError(f"{where}: no column JDTDB; expected epochs as JDTDB")
    if not 2e6 <= day <= 3e6:
        raise InputError(f"{where}: JDTDB is {day:.10g}; expected a Julian date")
    center = section.stated("Center body name")
    if center and "(10)" not in center:
        raise InputError(
            f"{where}: the centre is {center.split('{')[0].strip()}; expected Sun (10)"
        )
    equatorial = _is_equatorial(where, section)
    if all(name in values for name in _ELEMENTS):
        return _from_elements(where, values, day, length, equatorial)
    return _from_vector(where, section, values, day, (length, second), equatorial)


def _values(where: str, section: _Section, epochs: int) -> dict[str, float]:
    """Return the numbers of the first epoch by the names of their columns."""
    first = section.rows[0]
    day = _DAY.match(first)
    if day is not None:
        # Several lines an epoch, with names before the numbers.
        later = [k for k, row in enumerate(section.rows) if k and _DAY.match(row)]
        text = " ".join(section.rows[1 : later[0] if later else None])
        texts = {"JDTDB": day[1], **{found[1].upper(): found[2] for found in _PAIR.finditer(text)}}
    else:
        header = next((line for line in reversed(section.head) if line.strip("* ")), "")
        names = [name.strip().upper() for name in header.strip().rstrip(",").split(",")]
        cells = [cell.strip() for cell in first.strip().rstrip(",").split(",")]
        if len(names) < 7:
            raise InputError(
                f"{where}: a Horizons file without elements or vectors; expected ephemeris type "
                "ELEMENTS or VECTORS"
            )
        if len(cells) != len(names):
            raise InputError(
                f"{where}: {len(cells)} columns, expected {len(names)} as the header has "
                f"({epochs} epochs of one body, of which the first is read)"
            )
        texts = dict(zip(names, cells, strict=True))
    values = {}
    for name, word in texts.items():
        if name not in (*_ELEMENTS, *_VECTOR, "JDTDB", "JDCT"):
            continue
        try:
            values[name] = float(word.upper().replace("D", "E"))
        except ValueError:
            values[name] = np.nan
        if not np.isfinite(values[name]) or "_" in word:
            raise InputError(f"{where}: {name} is {word[:40]!r}; expected a number")
    if not any(all(name in values for name in kind) for kind in (_ELEMENTS, _VECTOR)):
        raise InputError(
            f"{where}: no {', '.join(_ELEMENTS)} and no {', '.join(_VECTOR)}; expected ephemeris "
            "type ELEMENTS or VECTORS"
        )
    return values


def _units(where: str, section: _Section, values: dict[str, float]) -> tuple[float, float]:
    """Return the units of length in m and of time in s."""
    stated = section.stated("Output units") or "AU-D"
    found = re.match(r"(AU|KM)-([DS])\b", stated)
    if found is None:
        raise InputError(f"{where}: output units are {stated!r}; expected AU-D, KM-D or KM-S")
    length, second = _LENGTH_M[found[1]], _TIME_S[found[2]]
    if "A" in values and values["A"] > 0.0:
        axis = values["A"] * length / AU
        low, high = A_RANGE_AU
        if not low <= axis <= high and values.get("EC", 0.0) < 1.0:
            raise InputError(
                f"{where}: A is {values['A']:.10g} in {found[0]}; expected AU-D, deg, or "
                f"{low:g} to {high:g} AU in that unit"
            )
    return length, second


def _is_equatorial(where: str, section: _Section) -> bool:
    """Return whether the frame is on the ICRF's equator; else it is on the ecliptic of J2000."""
    # Files before 2021 name the axes in a line of their own.
    frame = section.stated("Coordinate systm") or section.stated("Reference frame")
    if "B1950" in frame or "FK4" in frame:
        raise InputError(
            f"{where}: reference frame {frame!r}; expected Ecliptic of J2000.0 or ICRF"
        )
    if not frame or frame.startswith("Ecliptic"):
        return False
    if frame.startswith(("ICRF", "Earth Mean Equator")):
        return True
    raise InputError(f"{where}: reference frame {frame!r}; expected Ecliptic of J2000.0 or ICRF")


def _to_ecliptic(states: NDArray[np.float64]) -> NDArray[np.float64]:
    cos, sin = np.cos(_OBLIQUITY), np.sin(_OBLIQUITY)
    turn = np.array([[1.0, 0.0, 0.0], [0.0, cos, sin], [0.0, -sin, cos]])
    return np.concatenate([turn @ states[:3], turn @ states[3:]])


def _from_elements(
    where: str, values: dict[str, float], day: float, length: float, equatorial: bool
) -> NDArray[np.float64] | None:
    if values["EC"] >= 1.0:
        return None
    if values["A"] <= 0.0 or values["EC"] < 0.0:
        raise InputError(
            f"{where}: A is {values['A']:.10g} and EC {values['EC']:.10g}; expected an ellipse"
        )
    orbit = np.array([day - JD_MJD, *(values[name] for name in _ELEMENTS)])
    if length != AU:
        orbit[1] *= length / AU
    if equatorial:
        elements = np.array([orbit[1] * AU, orbit[2], *np.radians(orbit[3:])])
        turned = cartesian_to_classical(_to_ecliptic(classical_to_cartesian(elements)))
        # Size, shape and place on the orbit are not those of a frame.
        orbit[3:6] = np.degrees(turned[2:5])
    return orbit


def _from_vector(
    where: str,
    section: _Section,
    values: dict[str, float],
    day: float,
    units: tuple[float, float],
    equatorial: bool,
) -> NDArray[np.float64] | None:
    kind = section.stated("Output type")
    if kind and "GEOMETRIC" not in kind.upper():
        raise InputError(f"{where}: output type {kind!r}; expected GEOMETRIC states")
    length, second = units
    scale = np.repeat([length, length / second], 3)
    state = np.array([values[name] for name in _VECTOR]) * scale
    radius = float(np.linalg.norm(state[:3])) / AU
    if not 1e-4 <= radius <= 1e5:
        raise InputError(
            f"{where}: {radius:.3g} AU from the Sun by the units of the header; "
            "expected a body of the solar system"
        )
    try:
        elements = cartesian_to_classical(_to_ecliptic(state) if equatorial else state)
    except InputError:
        return None
    angles = np.degrees(elements[2:])
    return np.array([day - JD_MJD, elements[0] / AU, elements[1], *angles])
