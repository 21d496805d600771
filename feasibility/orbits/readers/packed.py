"""Packed designations and dates of the Minor Planet Center.

Described in <https://www.minorplanetcenter.net/iau/info/PackedDes.html> and
<https://www.minorplanetcenter.net/iau/info/PackedDates.html>.
"""

import datetime
import re
import string
from typing import Final

import numpy as np
from numpy.typing import NDArray

_DIGITS: Final = string.digits + string.ascii_uppercase + string.ascii_lowercase
_HALF_MONTH_LETTERS: Final = "ABCDEFGHIJKLMNOPQRSTUVWXYZ".replace("I", "")
"""Letters that number the discoveries of a half-month: all but I."""
_TILDE: Final = 620_000
"""The first number that begins with a tilde."""
_LONG: Final = 620
"""Rounds of the alphabet from which designations are long."""
_MJD_OF_DAY_0: Final = -678_576

_PROVISIONAL: Final = re.compile(r"([IJKL])(\d\d)([A-HJ-Y])([0-9A-Za-z])(\d)([A-HJ-Z])")
_EXTENDED: Final = re.compile(r"_([0-9A-Za-z])([A-HJ-Y])([0-9A-Za-z]{4})")
_SURVEY: Final = re.compile(r"(PL|T1|T2|T3)S(\d{4})")

_VALUES: Final = np.full(256, 255, np.uint8)
"""What each letter counts in base 62; 255 for none."""
_VALUES[np.frombuffer(_DIGITS.encode(), np.uint8)] = np.arange(62)


def base_62(text: str) -> int:
    """Return a whole number in base 62 (0-9, A-Z, a-z)."""
    number = 0
    for letter in text:
        number = 62 * number + _DIGITS.index(letter)
    return number


def numbers_of(cells: NDArray[np.uint8]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return the numbers of numbered bodies, and which cells are designations at all.

    Parameters
    ----------
    cells : (n, 7) uint8
        Packed designations: 00001, A0001 (100001), ~0000 (620000), K19A01B.

    Returns
    -------
    numbers : (n,) int64
        -1 for a provisional designation.
    good : (n,) bool
        Whether a cell is one or the other.
    """
    values = _VALUES[cells]
    letters = values < 62
    digits = values < 10
    short = (cells[:, 5:] == ord(" ")).all(axis=1)
    plain = short & letters[:, 0] & digits[:, 1:5].all(axis=1)
    tilde = short & (cells[:, 0] == ord("~")) & letters[:, 1:5].all(axis=1)
    wide = values.astype(np.int64)
    number = wide[:, 0] * 10_000 + wide[:, 1:5] @ [1000, 100, 10, 1]
    above = _TILDE + wide[:, 1:5] @ [62**3, 62**2, 62, 1]
    numbers = np.where(plain, number, np.where(tilde, above, -1))
    first = letters[:, 0] | (cells[:, 0] == ord("_"))
    provisional = first & letters[:, 1:].all(axis=1)
    return numbers.astype(np.int64), plain | tilde | provisional


def designation(packed: str) -> str:
    """Return a provisional designation as people write it; as it is where it is of no known kind.

    Examples
    --------
    >>> designation("J95X00A"), designation("K07Tf8A"), designation("PLS2040")
    ('1995 XA', '2007 TA418', '2040 P-L')
    >>> designation("_QC0aEM")
    '2026 CZ6190'
    """
    plain = _PROVISIONAL.fullmatch(packed)
    if plain is not None:
        century, year, half, tens, ones, second = plain.groups()
        cycle = 10 * base_62(tens) + int(ones)
        return f"{_DIGITS.index(century)}{year} {half}{second}{cycle or ''}"
    long = _EXTENDED.fullmatch(packed)
    if long is not None:
        cycle, place = divmod(base_62(long[3]), len(_HALF_MONTH_LETTERS))
        letter = _HALF_MONTH_LETTERS[place]
        return f"{2000 + base_62(long[1])} {long[2]}{letter}{_LONG + cycle}"
    survey = _SURVEY.fullmatch(packed)
    if survey is not None:
        return f"{survey[2]} {survey[1][0]}-{survey[1][1]}"
    return packed


def mjd_of(packed: str) -> float:
    """Return a packed date such as K205V, 2020 May 31, as MJD; NaN for none.

    Examples
    --------
    >>> mjd_of("K205V"), mjd_of("I961A")
    (59000.0, 13573.0)
    """
    if re.fullmatch(r"[IJKL]\d\d[1-9A-C][1-9A-V]", packed) is None:
        return float("nan")
    year = 100 * _DIGITS.index(packed[0]) + int(packed[1:3])
    try:
        day = datetime.date(year, _DIGITS.index(packed[3]), _DIGITS.index(packed[4]))
    except ValueError:
        return float("nan")
    return float(day.toordinal() + _MJD_OF_DAY_0)
