"""Tours as files: ``sequence.json``, which is read back exactly, and ``sequence.csv``."""

import csv
import io
from importlib import metadata
from pathlib import Path
from typing import Any, Final

import msgspec
import numpy as np

from feasibility.constants import MJD2000_MJD
from feasibility.errors import InputError
from seqsearch.tours.checks import Check
from seqsearch.tours.events.make import make_event
from seqsearch.tours.events.protocol import TourEvent
from seqsearch.tours.scores.make import make_score
from seqsearch.tours.scores.protocol import ScoreRule
from seqsearch.tours.tour import FORMAT, Tour, TourRules
from seqsearch.tours.validation import check_numbers

FORMAT_1: Final = "seqsearch-tour-1"
"""The layout of version 0.1, in which a problem's own rules stood in a table of its name."""

UPGRADES: Final = "seqsearch.tour_upgrades"
"""Group of entry points that turn such a table into events, by the name of the table."""

_COLUMNS: Final = (
    "leg",
    "from_id",
    "from_name",
    "to_id",
    "to_name",
    "t_dep_mjd",
    "t_arr_mjd",
    "tof_days",
    "stay_before_days",
    "m0_kg",
    "m_final_kg",
    "m_star_kg",
    "margin",
    "dropped_kg",
    "dep_speed_m_s",
    "arr_speed_m_s",
)


class _Head(msgspec.Struct):
    """What every tour file begins with."""

    format: str


def read_tour(path: Path) -> Tour:
    """Read a ``sequence.json``.

    Raises
    ------
    InputError
        The file is missing, truncated, not such a file, of another version, or has numbers
        that no tour has.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    try:
        tour = _decoded(data)
    except (msgspec.DecodeError, KeyError, TypeError, AttributeError, RecursionError) as error:
        if isinstance(error.__cause__, InputError):
            raise InputError(f"{path}: {error.__cause__}") from None
        raise InputError(f"{path}: not a complete {FORMAT} file ({error})") from None
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    return tour


def _decoded(data: bytes) -> Tour:
    found = msgspec.json.decode(data, type=_Head).format
    if found not in (FORMAT, FORMAT_1):
        raise InputError(f"format {found!r}, expected {FORMAT!r}")
    plain = msgspec.json.decode(data)
    if found == FORMAT_1:
        plain = _upgraded(plain)
    tour = msgspec.convert(plain, type=Tour, dec_hook=_record)
    check_numbers(tour)
    return tour


def to_json(tour: Tour) -> str:
    """Return the tour as JSON text, indented; `read_tour` reads it back exactly."""
    return msgspec.json.format(msgspec.json.encode(tour), indent=1).decode() + "\n"


def to_csv(tour: Tour) -> str:
    """Return the legs as CSV, epochs in MJD, one row a leg."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(_COLUMNS)
    arrived: float | None = None
    for k, leg in enumerate(tour.legs, 1):
        stay = "" if arrived is None else f"{leg.t_dep_mjd2000 - arrived:.6f}"
        numbers = (
            leg.m0_kg,
            leg.m_final_kg,
            leg.m_star_kg,
            leg.margin,
            leg.dropped_kg,
            np.linalg.norm(leg.dep_velocity_m_s),
            np.linalg.norm(leg.arr_velocity_m_s),
        )
        writer.writerow(
            [
                k,
                leg.from_id,
                tour.body(leg.from_id).name,
                leg.to_id,
                tour.body(leg.to_id).name,
                f"{leg.t_dep_mjd2000 + MJD2000_MJD:.6f}",
                f"{leg.t_arr_mjd2000 + MJD2000_MJD:.6f}",
                f"{leg.tof_days:.6f}",
                stay,
                *(f"{number:.6f}" for number in numbers),
            ]
        )
        arrived = leg.t_arr_mjd2000
    return text.getvalue()


def check_csv(tour: Tour, path: Path) -> Check:
    """Check that a ``sequence.csv`` has the numbers of a tour; names may be written otherwise."""
    try:
        rows = list(csv.reader(path.read_text(encoding="utf-8").splitlines()))
    except (OSError, UnicodeDecodeError, csv.Error):
        rows = []
    expected = list(csv.reader(to_csv(tour).splitlines()))
    names = {_COLUMNS.index("from_name"), _COLUMNS.index("to_name")}
    numbers, ours = (
        [[cell for k, cell in enumerate(row) if k not in names] for row in table]
        for table in (rows, expected)
    )
    return Check(
        f"{path.name} has the same numbers",
        numbers == ours,
        "the same" if numbers == ours else "other numbers",
        "the same",
    )


def _record(kind: type, record: Any) -> Any:
    if kind is TourEvent:
        return make_event(record)
    if kind is ScoreRule:
        return make_score(record)
    raise TypeError(f"a tour file has no {kind.__name__}")


def _upgraded(record: Any) -> Any:
    """Return a tour of format 1 as one of the present format.

    Raises
    ------
    InputError
        It has no body, or its rules have a table that no installed package can turn into events.
    """
    if not record["bodies"]:
        raise InputError(f"of format {FORMAT_1} and without a body")
    known = {field.name for field in msgspec.structs.fields(TourRules)}
    rules = record["rules"]
    own = {name: table for name, table in rules.items() if name not in known and table is not None}
    upgraded = record | {
        "format": FORMAT,
        "score": float(len(record["bodies"])),
        "rules": {name: value for name, value in rules.items() if name in known},
    }
    for name, table in own.items():
        entries = metadata.entry_points(group=UPGRADES, name=name)
        if not entries:
            raise InputError(
                f"of format {FORMAT_1} (version 0.1) with rules {name!r}, "
                "which no installed package knows"
            )
        upgraded = next(iter(entries)).load()(upgraded, table)
    return upgraded
