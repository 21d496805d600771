"""Numbers in columns of fixed places, read for thousands of lines at once.

The digits are gathered as an integer and divided by a power of ten. Both are exact in float64, so
the quotient is the float that is nearest to the decimal number, as Python's ``float`` has it.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

MAX_WIDTH: Final = 15
"""Digits that a float64 holds exactly."""

_BLANK, _POINT, _PLUS, _MINUS, _ZERO = b" .+-0"
_POWERS: Final = np.power(10.0, np.arange(MAX_WIDTH + 1))


def decimals(cells: NDArray[np.uint8]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return the decimal numbers of cells, and which cells can be read.

    Parameters
    ----------
    cells : (n, w) uint8
        One cell a row, w at most `MAX_WIDTH`, with blanks on either side.

    Returns
    -------
    values : (n,) float64
        NaN for a blank cell and for one that cannot be read.
    good : (n,) bool
        Whether a cell is blank or a decimal number without an exponent.
    """
    n = len(cells)
    value = np.zeros(n)
    digits = np.zeros(n, np.uint8)
    fraction = np.zeros(n, np.uint8)
    negative, begun, ended, pointed, bad = (np.zeros(n, bool) for _ in range(5))
    for letter in cells.T:
        digit = letter - np.uint8(_ZERO)
        is_digit = digit <= 9
        is_point = letter == _POINT
        blank = letter == _BLANK
        sign = (letter == _MINUS) | (letter == _PLUS)
        bad |= ~(is_digit | is_point | blank | sign)
        bad |= (ended & ~blank) | (sign & begun) | (is_point & pointed)
        negative |= letter == _MINUS
        pointed |= is_point
        ended |= blank & begun
        begun |= ~blank
        value = np.where(is_digit, value * 10.0 + digit, value)
        digits += is_digit
        fraction += is_digit & pointed
    bad |= begun & (digits == 0)
    value = value / _POWERS[fraction]
    value = np.where(negative, -value, value)
    value[~begun | bad] = np.nan
    return value, ~bad
