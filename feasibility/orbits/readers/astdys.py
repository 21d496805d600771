"""Catalogues of AstDyS and NEODyS (``.cat``, ``OEF2.0``) with Keplerian elements.

A header of ``key = value`` lines ends at ``END_OF_HEADER``; then a line a body: its name in single
quotes, epoch [MJD, TDT], a [AU], e, i, node, argp, M [deg], H, G. Described in
<https://newton.spacedys.com/astdys/>.
"""

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from feasibility.errors import InputError
from feasibility.orbits.readers.bodies import BodyTable, sieved
from feasibility.orbits.readers.columns import NEEDED
from feasibility.orbits.readers.sbdb import numbers_of_names

LABEL: Final = "AstDyS"

_END: Final = "END_OF_HEADER"
_SNIFFED: Final = 60
_KEY: Final = re.compile(r"\s*(\w+)\s*=\s*'?([^'!]*?)'?\s*(?:!.*)?")
_BODY: Final = re.compile(r"\s*'\s*([^']+?)\s*'\s+(.*)")
_EXPECTED: Final = {"elem": "KEP", "refsys": "ECLM J2000"}


def is_astdys(lines: Sequence[str]) -> bool:
    """Return whether a file has the header of this format."""
    return any(line.strip() == _END for line in lines[:_SNIFFED])


def astdys_bodies(file: Path, lines: Sequence[str], notes: tuple[str, ...] = ()) -> BodyTable:
    """Return the bodies of a catalogue; ids are the numbers of numbered bodies.

    Raises
    ------
    InputError
        Other elements or another frame, a line that is no body, or as `sieved`.
    """
    end = next(k for k, line in enumerate(lines) if line.strip() == _END)
    for k, line in enumerate(lines[:end]):
        found = _KEY.fullmatch(line)
        expected = None if found is None else _EXPECTED.get(found[1])
        if found is not None and expected is not None and found[2].strip() != expected:
            raise InputError(
                f"{file}, line {k + 1}: {found[1]} is {found[2].strip()!r}; expected {expected!r}"
            )
    names: list[str] = []
    rows: list[list[float]] = []
    places: list[int] = []
    for k in range(end + 1, len(lines)):
        line = lines[k].strip()
        if not line or line.startswith("!"):
            continue
        body = _BODY.fullmatch(line)
        words = [] if body is None else body[2].split()
        if body is None or len(words) < len(NEEDED):
            cut = "; is the file truncated?" if k == len(lines) - 1 else ""
            raise InputError(
                f"{file}, line {k + 1}: {len(words)} numbers behind a name in quotes; expected "
                f"epoch, a, e, i, node, argp, M, H, G{cut}"
            )
        names.append(body[1])
        rows.append([_number(file, k, word) for word in words[: len(NEEDED)]])
        rows[-1] += [_further(words, len(NEEDED)), _further(words, len(NEEDED) + 1)]
        places.append(k)
    table = np.array(rows).reshape(len(rows), len(NEEDED) + 2)
    return sieved(
        file,
        LABEL,
        numbers_of_names(names),
        tuple(names),
        table[:, : len(NEEDED)],
        {"H": table[:, -2], "G": table[:, -1]},
        lambda row: f"line {places[row] + 1}",
        notes,
    )


def _number(file: Path, index: int, word: str) -> float:
    try:
        number = math.nan if "_" in word else float(word.upper().replace("D", "E"))
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise InputError(f"{file}, line {index + 1}: {word[:40]!r}; expected a number")
    return number


def _further(words: Sequence[str], place: int) -> float:
    try:
        number = float(words[place])
    except (IndexError, ValueError):
        return math.nan
    return number if math.isfinite(number) else math.nan
