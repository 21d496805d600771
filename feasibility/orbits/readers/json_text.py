"""JSON of agencies: told apart, decoded, and its cells as columns of numbers."""

import math
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from feasibility.errors import InputError
from feasibility.orbits.readers.columns import JD_MJD

EXPECTED: Final = (
    "a response of JPL's small-body database (query or look-up) or the MPC's extended JSON"
)
JULIAN: Final = (2_000_000.0, 3_000_000.0)
"""Numbers of days that can only be Julian dates."""

_TRUTH: Final = {"Y": 1.0, "N": 0.0, "T": 1.0, "F": 0.0, "true": 1.0, "false": 0.0}


def is_json(data: bytes) -> bool:
    """Return whether a file can only be JSON."""
    begin = data[:200].lstrip()
    return begin.startswith((b"{", b"[{")) or re.match(rb"\[\s*[{\"\[\d]", begin) is not None


def decoded(file: Path, data: bytes, kind: Any) -> Any:
    """Return JSON as a type of msgspec.

    Raises
    ------
    InputError
        It is no JSON, cut off, or of another kind.
    """
    try:
        return msgspec.json.decode(data, type=kind)
    except msgspec.ValidationError as error:
        raise InputError(f"{file}: is JSON, but {error}; expected {EXPECTED}") from None
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        cut = "is it cut off?" if "truncated" in str(error) else "expected all of it"
        raise InputError(f"{file}: is damaged JSON ({error}); {cut}") from None


def number_column(
    file: Path, name: str, cells: Sequence[Any], place: Callable[[int], str]
) -> NDArray[np.float64]:
    """Return (n,) numbers, which may be texts; NaN for null and for an empty text.

    Raises
    ------
    InputError
        A cell is something else, or not finite.
    """
    numbers = np.full(len(cells), np.nan)
    for row, cell in enumerate(cells):
        if cell is None or cell == "":
            continue
        try:
            number = math.nan if isinstance(cell, bool) or "_" in str(cell) else float(cell)
        except (TypeError, ValueError, OverflowError):
            number = math.nan
        if not math.isfinite(number):
            raise InputError(f"{file}, {place(row)}: {name} is {_short(cell)}; expected a number")
        numbers[row] = number
    return numbers


def further_column(cells: Sequence[Any]) -> NDArray[np.float64]:
    """Return (n,) numbers, 1 and 0 for yes and no; NaN for what is neither."""
    numbers = np.full(len(cells), np.nan)
    for row, cell in enumerate(cells):
        try:
            number = _TRUTH[cell] if isinstance(cell, str) and cell in _TRUTH else float(cell)
        except (TypeError, ValueError, OverflowError):
            continue
        numbers[row] = number if math.isfinite(number) else math.nan
    return numbers


def mjd_column(
    file: Path, name: str, days: NDArray[np.float64], place: Callable[[int], str]
) -> NDArray[np.float64]:
    """Return Julian dates as MJD.

    Raises
    ------
    InputError
        A number is no Julian date of our times.
    """
    with np.errstate(invalid="ignore"):
        strange = (days < JULIAN[0]) | (days > JULIAN[1])
    if strange.any():
        row = int(np.argmax(strange))
        raise InputError(
            f"{file}, {place(row)}: {name} is {days[row]:.10g}; expected a Julian date, "
            f"{JULIAN[0]:.0f} to {JULIAN[1]:.0f}"
        )
    return days - JD_MJD


def _short(cell: object) -> str:
    text = repr(cell)
    return text if len(text) < 40 else text[:40] + "..."
