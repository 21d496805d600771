"""The Minor Planet Center's orbits in the format of ``MPCORB.DAT``.

Columns have fixed places and may be blank but for the orbit's; the format is described in
<https://www.minorplanetcenter.net/iau/info/MPOrbitFormat.html>, packed designations and dates in
<https://www.minorplanetcenter.net/iau/info/PackedDates.html>.
"""

import datetime
import re
import string
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

from feasibility.errors import InputError
from feasibility.orbits.readers.rows import Row

_LINE: Final = re.compile(
    r"(?P<id>[0-9A-Za-z~]{5,7}) +.{0,12}? (?P<epoch>[IJK]\d\d[1-9A-C][1-9A-V]) +"
    r"(?P<M>\d+\.\d+) +(?P<argp>\d+\.\d+) +(?P<node>\d+\.\d+) +(?P<i>\d+\.\d+) +(?P<e>\d\.\d+) "
)
_A: Final = slice(92, 103)
_NAME: Final = slice(166, 194)
_DIGITS: Final = string.digits + string.ascii_uppercase + string.ascii_lowercase
_MJD_OF_DAY_0: Final = -678_576
_SNIFFED: Final = 200
"""Lines before the first orbit: the file has a preamble of 43."""
_UNNUMBERED: Final = 50_000_000
"""Added to the row's number where only some bodies have a number of their own."""


def is_mpcorb(lines: Sequence[str]) -> bool:
    """Return whether a table is in this format."""
    return any(_LINE.match(line) for line in lines[:_SNIFFED])


def mpcorb_rows(file: Path, lines: Sequence[str]) -> Iterator[Row | None]:
    """Yield the bodies, None for one whose orbit cannot be used.

    Raises
    ------
    InputError
        A line below the first orbit is no orbit.
    """
    begun = False
    numbers = [_number(line[:7].strip()) for line in lines if _LINE.match(line)]
    any_number = any(number is not None for number in numbers)
    count = 0
    for index, line in enumerate(lines):
        if not line.strip():
            continue
        found = _LINE.match(line)
        if found is None:
            if begun:
                raise InputError(
                    f"{file}, line {index + 1}: no orbit in the format of MPCORB; "
                    "expected designation, H, G, epoch, M, argp, node, i, e, n, a"
                )
            continue
        begun = True
        count += 1
        number = _number(found["id"].strip())
        if number is None:
            number = _UNNUMBERED + count if any_number else count
        yield _row(index + 1, line, found, number)


def _row(number: int, line: str, found: re.Match[str], identity: int) -> Row | None:
    try:
        values = {name: float(found[name]) for name in ("e", "i", "node", "argp", "M")}
        values |= {"a": float(line[_A]), "epoch": _mjd(found["epoch"])}
    except ValueError:
        return None
    if not (1e-3 <= values["a"] <= 1e4 and values["e"] < 1.0 and values["i"] <= 180.0):
        return None
    name = re.sub(r"^\(\d+\) *", "", line[_NAME].strip()) or found["id"]
    numbered = line[_NAME].strip().startswith("(")
    return Row(number, identity, f"{identity} {name}" if numbered else name, values)


def _number(packed: str) -> int | None:
    """Return the number of a numbered body, None for a provisional designation."""
    if len(packed) != 5:
        return None
    if packed[0] == "~":
        number = 0
        for letter in packed[1:]:
            number = 62 * number + _DIGITS.index(letter)
        return 620_000 + number
    if not packed[1:].isdigit():
        return None
    return 10_000 * _DIGITS.index(packed[0]) + int(packed[1:])


def _mjd(packed: str) -> float:
    """Return a packed date such as K205V, 2020 May 31, as MJD."""
    year = 100 * (10 + _DIGITS.index(packed[0].upper()) - 10) + int(packed[1:3])
    day = datetime.date(year, _DIGITS.index(packed[3]), _DIGITS.index(packed[4]))
    return float(day.toordinal() + _MJD_OF_DAY_0)
