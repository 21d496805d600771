"""JPL's Small-Body Database: the bodies that a query finds, as JSON or CSV."""

import csv
import json
import re
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from feasibility.errors import InputError
from seqsearch.fetching.contents import read_answer
from seqsearch.fetching.download import UnfitError, Wanted
from seqsearch.fetching.services import SBDB, address_of

FIELDS: Final = (
    "spkid", "full_name", "epoch", "a", "e", "i", "om", "w", "ma", "H", "diameter", "class",
)  # fmt: skip
"""What is asked for by default: enough for a catalogue, and to select by."""

_NEEDED: Final = ("epoch", "a", "e", "i", "om", "w", "ma")
_EXPECTED: Final = "fields and data of the Small-Body Database"

_SIGNS: Final = {"<=": "LE", ">=": "GE", "!=": "NE", "==": "EQ", "<": "LT", ">": "GT", "=": "EQ"}
_CONDITION: Final = re.compile(r"\s*([A-Za-z_]\w*)\s*(<=|>=|!=|==|<|>|=)\s*([^\s<>=!|]+)\s*")
_OWN: Final = re.compile(r"[A-Za-z_]\w*\|[A-Z]{2}(\|[^|]+){0,2}")
"""A condition in the service's own words, such as ``a|RG|2.2|3.2``."""


def sbdb(
    target: Path,
    *,
    orbit_class: str | None = None,
    where: Sequence[str] = (),
    query: Sequence[str] = (),
    fields: Sequence[str] = FIELDS,
    url: str | None = None,
    sha256: str | None = None,
) -> Wanted:
    """Return what to fetch: the bodies that fulfil all conditions.

    Parameters
    ----------
    target : Path
        The file, CSV if its name says so, else JSON as the service sends it.
    orbit_class : str, optional
        Codes of the service, parted by commas: ``MBA``, ``APO``, ``TJN``.
    where : sequence of str
        Conditions such as ``a < 3.2`` or ``a|RG|2.2|3.2``.
    query : sequence of str
        Further parameters of the service, ``KEY=VALUE``.
    fields : sequence of str
        Columns.
    url, sha256 : str, optional
        As for `Wanted`.

    Raises
    ------
    InputError
        A condition or a parameter is none, or a field that orbits need is missing.
    """
    missing = [name for name in _NEEDED if name not in fields]
    if missing:
        raise InputError(f"--fields: without {', '.join(missing)}, which an orbit needs")
    parameters = {"fields": ",".join(fields), "full-prec": "true"}
    if orbit_class is not None:
        parameters["sb-class"] = orbit_class
    if where:
        parameters["sb-cdata"] = json.dumps({"AND": [_condition(text) for text in where]})
    for text in query:
        key, equals, value = text.partition("=")
        if not (equals and key.strip()):
            raise InputError(f"--query {text!r}: expected KEY=VALUE, such as sb-group=neo")
        parameters[key.strip()] = value.strip()
    return Wanted(
        url=address_of(SBDB, "sbdb", url),
        parameters=parameters,
        target=target,
        what="bodies of JPL's Small-Body Database",
        make=_make_csv if target.suffix.lower() == ".csv" else _make_json,
        sha256=sha256,
    )


def _condition(text: str) -> str:
    """Return a condition in the service's own words."""
    if _OWN.fullmatch(text.strip()):
        return text.strip()
    match = _CONDITION.fullmatch(text)
    if match is None:
        raise InputError(f"--where {text!r}: expected a condition such as 'a < 3.2' or 'a|RG|2|3'")
    return f"{match[1]}|{_SIGNS[match[2]]}|{match[3]}"


def _make_json(came: Path, file: Path) -> None:
    _table(came)
    shutil.copyfile(came, file)


def _make_csv(came: Path, file: Path) -> None:
    fields, rows = _table(came)
    with file.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(fields)
        writer.writerows([["" if cell is None else cell for cell in row] for row in rows])


def _table(came: Path) -> tuple[list[str], list[list[Any]]]:
    answer = read_answer(came, _EXPECTED)
    fields, rows = answer.get("fields"), answer.get("data")
    if fields is None and "message" in answer:
        raise UnfitError(f"says: {' '.join(str(answer['message']).split())[:200]}")
    if not (isinstance(fields, list) and isinstance(rows, list)):
        raise UnfitError(f"answers with other JSON, expected {_EXPECTED}")
    count = answer.get("count", len(rows))
    if str(count) != str(len(rows)):
        raise UnfitError(f"sends {len(rows)} bodies, but says that there are {count}")
    if any(not isinstance(row, list) or len(row) != len(fields) for row in rows):
        raise UnfitError(f"sends a body without {len(fields)} values, one a field")
    if not rows:
        raise UnfitError("knows no body that fulfils the conditions, expected one at least")
    return [str(name) for name in fields], rows
