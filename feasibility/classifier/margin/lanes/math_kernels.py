"""Elementary functions in arithmetic and integer operations alone, so that loops become vectors.

Errors are about 1e-14 relative to the result or to 1, whichever is larger. Arguments are what the
quick features have: no NaN, infinities or denormals need a sensible answer.
"""

import math

from feasibility.runtime.float_bits import bits_of, float_of
from feasibility.runtime.jit import lane_function

_ROUND = 1.5 * 2.0**52
_ROUND_BITS = 0x4338000000000000
_ONE_BITS = 0x3FF0000000000000
_ROOT_HALF_BITS = 0x3FE6A09E667F3BCD
_LN2 = math.log(2.0)
_LN2_HEAD = 0.693147180369123816490
_LN2_TAIL = 1.90821492927058770002e-10
_TWO_OVER_PI = 2.0 / math.pi
_HALF_PI_HEAD = 1.5707963267341256
_HALF_PI_TAIL = 6.077100506506192e-11
_HALF_PI = 0.5 * math.pi
_QUARTER_PI = 0.25 * math.pi
_EIGHTH_TURN = math.tan(math.pi / 8.0)
# High word of the bits of an inverse cube root's first guess, for an argument without bits.
_CUBE_ROOT_WORD = float(0x553EF0FF)


@lane_function
def log(x: float) -> float:
    """Return the natural logarithm of a positive number."""
    bits = bits_of(x)
    exponent = (bits - _ROOT_HALF_BITS) >> 52
    m = float_of(bits - (exponent << 52))
    k = float_of(exponent + _ROUND_BITS) - _ROUND
    # 2 artanh(s), |s| <= 0.1716.
    s = (m - 1.0) / (m + 1.0)
    z = s * s
    t = 2.0 / 15.0 + z * (2.0 / 17.0 + z * (2.0 / 19.0))
    t = 2.0 / 9.0 + z * (2.0 / 11.0 + z * (2.0 / 13.0 + z * t))
    t = 2.0 / 3.0 + z * (2.0 / 5.0 + z * (2.0 / 7.0 + z * t))
    result: float = k * _LN2 + s * (2.0 + z * t)
    return result


@lane_function
def exp(x: float) -> float:
    """Return the exponential of a number of moderate size."""
    shifted = x * (1.0 / _LN2) + _ROUND
    k = shifted - _ROUND
    r = (x - k * _LN2_HEAD) - k * _LN2_TAIL
    t = 1.0 / 362880.0 + r * (1.0 / 3628800.0 + r * (1.0 / 39916800.0))
    t = 1.0 / 720.0 + r * (1.0 / 5040.0 + r * (1.0 / 40320.0 + r * t))
    t = 1.0 + r * (
        1.0 + r * (0.5 + r * (1.0 / 6.0 + r * (1.0 / 24.0 + r * (1.0 / 120.0 + r * t))))
    )
    result: float = t * float_of((bits_of(shifted) << 52) + _ONE_BITS)
    return result


@lane_function
def sine_cosine(x: float) -> tuple[float, float]:
    """Return sine and cosine to 1e-13, in arithmetic alone, so that a loop becomes vectors.

    Series about the nearest multiple of a right angle, whose last bits Cody and Waite's two
    parts of pi / 2 keep; adding and subtracting _ROUND rounds to a whole number.
    """
    quarter = (x * _TWO_OVER_PI + _ROUND) - _ROUND
    r = (x - quarter * _HALF_PI_HEAD) - quarter * _HALF_PI_TAIL
    z = r * r
    # Pairs of terms, not one after the other, as each waits for the one before.
    z2 = z * z
    s = (1.0 / 362880.0 - z * (1.0 / 39916800.0)) + z2 * (1.0 / 6227020800.0)
    s = (1.0 - z * (1.0 / 6.0)) + z2 * ((1.0 / 120.0 - z * (1.0 / 5040.0)) + z2 * s)
    s *= r
    c = (1.0 / 40320.0 - z * (1.0 / 3628800.0)) + z2 * (1.0 / 479001600.0)
    c = (1.0 - z * 0.5) + z2 * ((1.0 / 24.0 - z * (1.0 / 720.0)) + z2 * c)
    # Which quarter, from -2 to 2.
    place = quarter - 4.0 * ((0.25 * quarter + _ROUND) - _ROUND)
    odd = abs(place) == 1.0
    sine = c if odd else s
    cosine = s if odd else c
    # Of five places these have the signs turned: sine -2, -1, 2; cosine -2, 1, 2.
    sine = -sine if abs(place - 0.25) > 1.0 else sine
    cosine = -cosine if abs(place + 0.25) > 1.0 else cosine
    return sine, cosine


@lane_function
def small_sine_cosine(x: float) -> tuple[float, float]:
    """Return sine and cosine of an angle within 0.8."""
    z = x * x
    # Pairs of terms, not one after the other, as each waits for the one before.
    z2 = z * z
    s = (1.0 / 362880.0 - z * (1.0 / 39916800.0)) + z2 * (1.0 / 6227020800.0)
    s = (1.0 - z * (1.0 / 6.0)) + z2 * ((1.0 / 120.0 - z * (1.0 / 5040.0)) + z2 * s)
    s *= x
    c = (1.0 / 40320.0 - z * (1.0 / 3628800.0)) + z2 * (1.0 / 479001600.0)
    c = (1.0 - z * 0.5) + z2 * ((1.0 / 24.0 - z * (1.0 / 720.0)) + z2 * c)
    return s, c


@lane_function
def atan2(y: float, x: float) -> float:
    """Return the angle of a point that is not the origin."""
    size_x, size_y = abs(x), abs(y)
    steep = size_y > size_x
    small = size_x if steep else size_y
    large = size_y if steep else size_x
    # One division for the quotient and for its angle less a sixteenth of a turn.
    far = small > _EIGHTH_TURN * large
    t = (small - large if far else small) / (small + large if far else large)
    u = t * t
    # A Chebyshev fit of atan(t) / t, |t| <= tan(pi / 8), to 1e-14.
    p = 0.07563739054205398 + u * (-0.058746332836520795 + u * 0.03066431777306079)
    p = -0.14285690442562804 + u * (0.11110385467486143 + u * (-0.09078397250384831 + u * p))
    p = 0.9999999999999735 + u * (-0.33333333330806364 + u * (0.19999999605296376 + u * p))
    angle = t * p + (_QUARTER_PI if far else 0.0)
    angle = _HALF_PI - angle if steep else angle
    angle = math.pi - angle if x < 0.0 else angle
    return -angle if y < 0.0 else angle


@lane_function
def inverse_cube_root(x: float) -> float:
    """Return x^(-1/3) of a positive number."""
    word = float_of((bits_of(x) >> 32) + _ROUND_BITS) - _ROUND
    y: float = float_of(bits_of(_CUBE_ROOT_WORD - word * (1.0 / 3.0) + _ROUND) << 32)
    for _ in range(2):
        r = 1.0 - x * y * y * y
        y += y * r * (1.0 / 3.0 + r * (2.0 / 9.0 + r * (14.0 / 81.0)))
    return y
