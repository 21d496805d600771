"""JSON of JPL's Small-Body Database: its query service and its look-up of a single body.

Described in <https://ssd-api.jpl.nasa.gov/doc/sbdb_query.html> and
<https://ssd-api.jpl.nasa.gov/doc/sbdb.html>. Its CSV is a table with a header.
"""

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from feasibility.errors import InputError
from feasibility.orbits.readers.bodies import UNNUMBERED, BodyTable, sieved
from feasibility.orbits.readers.columns import FURTHER, NEEDED, column_of
from feasibility.orbits.readers.json_text import (
    EXPECTED,
    decoded,
    further_column,
    mjd_column,
    number_column,
)
from feasibility.orbits.readers.perihelion import a_of, mean_anomaly_of

QUERY: Final = "SBDB query"
LOOKUP: Final = "SBDB look-up"

_NUMBER: Final = re.compile(r"\s*(\d{1,9})(?=\s+\S|\s*$)")


class _Answer(msgspec.Struct):
    """What either service answers; all may be absent."""

    fields: list[str] | None = None
    data: list[list[Any]] | None = None
    count: int | str | None = None
    object: dict[str, Any] | None = None
    orbit: dict[str, Any] | None = None
    phys_par: list[dict[str, Any]] | None = None
    message: Any = None


def sbdb_bodies(file: Path, data: bytes) -> BodyTable:
    """Return the bodies of an answer.

    Ids are the ``spkid`` of a query that asked for it, else the number of a numbered body.

    Raises
    ------
    InputError
        It is no such answer, a field is missing, a cell is no number, or as `sieved`.
    """
    answer: _Answer = decoded(file, data, _Answer)
    if answer.object is not None and answer.orbit is not None:
        return _looked_up(file, answer.object, answer.orbit, answer.phys_par or [])
    if answer.fields is None or answer.data is None:
        if answer.message is not None:
            raise InputError(f"{file}: the service answered {str(answer.message)[:200]!r}")
        if answer.count in (0, "0"):
            raise InputError(f"{file}: the query found no bodies")
        raise InputError(f"{file}: is JSON, but has no fields and data; expected {EXPECTED}")
    count = answer.count
    if count is not None and str(count) != str(len(answer.data)):
        raise InputError(
            f"{file}: count is {count}, but data has {len(answer.data)} rows; expected all of them"
        )
    return _queried(file, answer.fields, answer.data)


def _queried(file: Path, fields: Sequence[str], rows: Sequence[Sequence[Any]]) -> BodyTable:
    for k, row in enumerate(rows):
        if len(row) != len(fields):
            raise InputError(
                f"{file}, row {k + 1}: {len(row)} cells, expected {len(fields)}: "
                f"{', '.join(fields)}"
            )
    if not rows:
        raise InputError(f"{file}: the query found no bodies")
    # Of epoch and epoch_mjd either will do.
    meaning = {field: column_of(field, None) for field in fields}
    place_of: dict[str, int] = {}
    for k, field in enumerate(fields):
        name = meaning[field].meaning
        if name is not None and (name not in place_of or meaning[field].unit == "mjd"):
            place_of[name] = k
    cells = dict(zip(fields, zip(*rows, strict=True), strict=True))

    def column(name: str) -> Sequence[Any]:
        return cells[fields[place_of[name]]]

    labels = _texts(cells, rows)
    names = [label or f"row {k + 1}" for k, label in enumerate(labels)]

    def place(row: int) -> str:
        return f"row {row + 1} ({names[row]})"

    numeric = {
        name: number_column(file, fields[place_of[name]], column(name), place)
        for name in (*NEEDED, "q", "tp")
        if name in place_of
    }
    if "epoch" in numeric and meaning[fields[place_of["epoch"]]].unit != "mjd":
        numeric["epoch"] = mjd_column(file, "epoch", numeric["epoch"], place)
    if "tp" in numeric:
        numeric["tp"] = mjd_column(file, "tp", numeric["tp"], place)
    orbits = _orbits(file, numeric, fields)
    if "id" in place_of:
        ids = number_column(file, fields[place_of["id"]], column("id"), place)
        if np.isnan(ids).any() or (ids != np.rint(ids)).any() or (np.abs(ids) > 2**53).any():
            raise InputError(f"{file}: {fields[place_of['id']]} is no whole number in each row")
        identities = ids.astype(np.int64)
    else:
        identities = numbers_of_names(names)
    extra = {
        name: further_column(column(name))
        for name in FURTHER
        if name in place_of and place_of[name] is not None
    }
    return sieved(file, QUERY, identities, names, orbits, extra, place)


def _texts(cells: dict[str, Any], rows: Sequence[Sequence[Any]]) -> list[str]:
    """Return names: full_name, or what else names bodies."""
    for field in ("full_name", "fullname", "pdes", "name", "spkid"):
        if field in cells:
            return ["" if cell is None else " ".join(str(cell).split()) for cell in cells[field]]
    return [""] * len(rows)


def _orbits(
    file: Path, numeric: dict[str, NDArray[np.float64]], fields: Sequence[str]
) -> NDArray[np.float64]:
    """Return (n, 7) the columns of orbits; a from q and M from tp where a query has those."""
    if "a" not in numeric and {"q", "e"} <= numeric.keys():
        numeric["a"] = a_of(numeric["q"], numeric["e"])
    if "M" not in numeric and {"tp", "epoch", "a"} <= numeric.keys():
        numeric["M"] = mean_anomaly_of(numeric["tp"], numeric["epoch"], numeric["a"])
    missing = [name for name in NEEDED if name not in numeric]
    if missing:
        raise InputError(
            f"{file}: no field {', '.join(missing)}; expected fields such as full_name, epoch, "
            f"a, e, i, om, w, ma, got {', '.join(fields)[:200]}"
        )
    return np.column_stack([numeric[name] for name in NEEDED])


def numbers_of_names(names: Sequence[str]) -> NDArray[np.int64]:
    """Return ids of bodies named as "1 Ceres (A801 AA)" or "(2010 AB12)".

    A number where the name begins with one; 50 000 000 more than the row's number for others, or
    that number alone where no body is numbered.
    """
    found = [_number_of(name) for name in names]
    more = UNNUMBERED if any(number is not None for number in found) else 0
    return np.array(
        [more + k + 1 if number is None else number for k, number in enumerate(found)], np.int64
    )


_PROVISIONAL: Final = re.compile(r"\s*(\d{4}\s+([A-Z]{2}\d*|P-L|T-[123])|\d+[PDCXAI]/)")


def _number_of(name: str) -> int | None:
    found = _NUMBER.match(name)
    # 2010 AB12 and 6344 P-L are no numbers.
    if found is None or _PROVISIONAL.match(name):
        return None
    return int(found[1])


def _looked_up(
    file: Path, body: dict[str, Any], orbit: dict[str, Any], physics: Sequence[dict[str, Any]]
) -> BodyTable:
    name = " ".join(str(body.get("fullname") or body.get("des") or "?").split())
    elements = orbit.get("elements")
    if not isinstance(elements, list) or not all(isinstance(part, dict) for part in elements):
        raise InputError(f"{file}: the orbit of {name} has no elements; expected a list of them")
    place: Callable[[int], str] = lambda row: f"body {name}"  # noqa: E731, ARG005
    given = {str(part.get("name")): part for part in elements}
    expected = {"a": "au", "e": None, "i": "deg", "om": "deg", "w": "deg", "ma": "deg"}
    for key, unit in expected.items():
        stated = given.get(key, {}).get("units")
        if stated is not None and unit is not None and str(stated).lower() != unit:
            raise InputError(f"{file}, body {name}: {key} is in {stated}; expected {unit}")
    epoch = number_column(file, "epoch", [orbit.get("epoch")], place)
    values = [
        number_column(file, key, [given.get(key, {}).get("value")], place) for key in expected
    ]
    orbits = np.column_stack([mjd_column(file, "epoch", epoch, place), *values])
    known = {str(part.get("name")): part.get("value") for part in physics}
    extra: dict[str, NDArray[np.float64]] = {
        name: further_column([known[name]])
        for name in ("H", "G", "diameter", "albedo")
        if name in known
    }
    extra |= {
        name: further_column([body[name]])
        for name in ("neo", "pha")
        if isinstance(body.get(name), bool)
    }
    return sieved(file, LOOKUP, np.array([_id_of(body)]), [name], orbits, extra, place)


def _id_of(body: dict[str, Any]) -> int:
    """Return the number of a numbered body, else its SPK id, else 1."""
    for text in (str(body.get("des", "")), str(body.get("spkid", ""))):
        if re.fullmatch(r"\d{1,15}", text):
            return int(text)
    return 1
