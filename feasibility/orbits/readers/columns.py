"""Names and units that people give to the columns of tables of orbits."""

import math
import re
from dataclasses import dataclass, replace
from typing import Final, final

from feasibility.constants import AU, MJD2000_MJD

ORBIT: Final[tuple[str, ...]] = ("a", "e", "i", "node", "argp", "M")
ANGLES: Final = ("i", "node", "argp", "M")
NEEDED: Final[tuple[str, ...]] = ("epoch", *ORBIT)
INSTEAD: Final = {"a": "q", "M": "tp"}
"""What comets have in place of a column: perihelion distance and time."""
STRICT: Final[tuple[str, ...]] = ("group", "mass")
"""Columns that are not part of the orbit, but are numbers in each row."""
FURTHER: Final[tuple[str, ...]] = (
    *STRICT,
    "H",
    "G",
    "diameter",
    "albedo",
    "moid",
    "U",
    "n_obs",
    "neo",
    "pha",
)
"""Columns that are not part of the orbit: `Catalogue.extra`."""

JD_MJD: Final = 2_400_000.5
"""Julian date of MJD 0."""

_NAMES: Final = {
    "id": "id spkid num number no nr n# body_id asteroid_id index",
    "name": "name full_name fullname object designation desig pdes asteroid body target",
    "epoch": "epoch t0 epoch_tdb epoch_tt",
    "a": "a sma semimajor_axis semi_major_axis semimajoraxis",
    "e": "e ec ecc eccentricity",
    "i": "i in inc incl inclin inclination",
    "node": "node om raan lan omega_upper longnode long_node asc_node ascending_node "
    "long_asc_node longitude_of_ascending_node longitude_of_the_ascending_node",
    "argp": "w argp peri argperi arg_peri aop omega_lower arg_per arg_periap arg_peric "
    "arg_perihelion argument_of_perihelion argument_of_periapsis argument_of_pericenter",
    "M": "m ma mean_anomaly mean_anom meananomaly",
    "q": "q qr perihelion_distance",
    "tp": "tp time_of_perihelion time_of_perihelion_passage",
    "mass": "mass",
    "group": "group",
    "H": "h absmag abs_mag h_mag absolute_magnitude",
    "G": "g slope slope_param slope_parameter magnitude_slope",
    "diameter": "diameter diam",
    "albedo": "albedo pv geometric_albedo",
    "moid": "moid",
    "U": "condition_code",
    "n_obs": "n_obs n_obs_used",
    "neo": "neo",
    "pha": "pha",
}
_DATES: Final = {"mjd": "mjd", "jd": "jd", "jdtdb": "jd", "mjd2000": "mjd2000"}
"""Names of columns of epochs that tell the unit too."""
_MEANING: Final = {name: column for column, names in _NAMES.items() for name in names.split()}

_DEGREES: Final = ("deg", "degree", "degrees", "°")
_RADIANS: Final = ("rad", "radian", "radians")
_UNITS: Final[dict[str, dict[str, str]]] = {
    **{name: {"au": "au", "ua": "au", "km": "km", "m": "m"} for name in ("a", "q")},
    "epoch": {
        **dict.fromkeys(("mjd", "mjd_tdb", "mjd_tt"), "mjd"),
        **dict.fromkeys(("jd", "jd_tdb", "jdtdb", "jd_tt"), "jd"),
        "mjd2000": "mjd2000",
        # Time scales: none is another count of days.
        **dict.fromkeys(("tdb", "tt", "utc", "d", "day", "days"), ""),
    },
    "mass": {"kg": "kg"},
    "diameter": {"km": "km"},
    **{angle: dict.fromkeys(_DEGREES, "deg") | dict.fromkeys(_RADIANS, "rad") for angle in ANGLES},
}
_NO_UNIT: Final = ("", "-", "1", "none")

_PER_UNIT: Final = {"au": 1.0, "km": 1e3 / AU, "m": 1.0 / AU}
_DAYS_TO_MJD: Final = {"mjd": 0.0, "": 0.0, "jd": -JD_MJD, "mjd2000": MJD2000_MJD}


@final
class UnitError(Exception):
    """A unit that is not known; the caller knows file and line."""


@final
@dataclass(frozen=True)
class Column:
    """One column of a table.

    Attributes
    ----------
    meaning : str, optional
        "id", "name", "epoch", "q", "tp", one of `ORBIT` or of `FURTHER`; None for a column that
        is skipped.
    unit : str
        Such as "rad"; empty where the header does not tell.
    word : str
        As the header has it.
    """

    meaning: str | None
    unit: str
    word: str


def column_of(word: str, unit: str | None) -> Column:
    """Return what a header's word and the unit in parentheses behind it mean.

    Raises
    ------
    UnitError
        The unit is not known: reading the column as if it had none would be worse.
    """
    name = re.sub(r"[\s.\-/]+", "_", word.strip().strip("#'\".,;:")).strip("_")
    for sign, case in (("Omega", "omega_upper"), ("Ω", "omega_upper"), ("OMEGA", "omega_upper")):
        name = case if name == sign else name
    name = "omega_lower" if name in ("omega", "ω") else name.lower()
    meaning, suffix = _MEANING.get(name), ""
    if meaning is None and "_" in name:
        # epoch_mjd, a_au, inc_deg
        stem, _, suffix = name.rpartition("_")
        stem = "omega_lower" if stem == "omega" else stem
        known = _MEANING.get(stem)
        if known in _UNITS and suffix in _UNITS[known]:
            meaning = known
        else:
            suffix = ""
    if name in _DATES:
        meaning, suffix = "epoch", _DATES[name]
    given = "" if unit is None else unit.strip()
    return Column(meaning, _known_unit(word, meaning, given or suffix), word)


def with_unit(column: Column, unit: str) -> Column:
    """Return a column in a unit that its header does not tell.

    Raises
    ------
    UnitError
        The unit is not known, or the header tells another.
    """
    known = _known_unit(column.word, column.meaning, unit)
    if not known:
        units = _UNITS.get(column.meaning or "", {})
        expected = ", ".join(dict.fromkeys(filter(None, units.values()))) or "none"
        raise UnitError(f"unit {unit!r} of column {column.word} is not known; expected {expected}")
    if column.unit not in ("", known):
        raise UnitError(f"column {column.word} is in {column.unit} by the header, not in {unit}")
    return replace(column, unit=known)


def _known_unit(word: str, meaning: str | None, unit: str) -> str:
    plain = unit.lower().rstrip(".")
    known = None if meaning is None else _UNITS.get(meaning)
    if known is None or plain in _NO_UNIT:
        return ""
    if re.search(r"[,;\s]", plain):
        # A remark, such as "(JD, TDB)" or "(osculating, epoch in MJD)", may have a unit in it.
        parts = [known.get(part.rstrip(".")) for part in re.split(r"[,;\s]+", plain)]
        return next(filter(None, parts), "")
    if plain not in known:
        expected = ", ".join(dict.fromkeys(filter(None, known.values())))
        raise UnitError(f"unit ({unit}) of column {word} is not known; expected {expected}")
    return known[plain]


def in_table_units(meaning: str, unit: str, value: float) -> float:
    """Return a number in AU, degrees or MJD, as its column means it."""
    if meaning in ("a", "q"):
        return value * _PER_UNIT[unit or "au"]
    if meaning == "epoch":
        return value + _DAYS_TO_MJD[unit]
    if unit == "rad":
        return math.degrees(value)
    return value
