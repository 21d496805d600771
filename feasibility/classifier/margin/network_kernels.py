"""The steps of a net between its matrix products, each in one go over the numbers.

Nothing here depends on where in an array a number stands: there are no sums, and no operation is
joined with another one.
"""

import numpy as np
from numpy.typing import NDArray

from feasibility.runtime.float_bits import bits_of_single, single_of
from feasibility.runtime.jit import kernel

_Doubles = NDArray[np.float64]
_Singles = NDArray[np.float32]

_ONE = np.float32(1.0)
_MOST = np.float32(80.0)
_OVER_LN2 = np.float32(1.4426950408889634)
_LN2_HEAD = np.float32(0.693359375)
_LN2_TAIL = np.float32(-2.12194440e-4)
_ROUND = np.float32(1.5 * 2.0**23)
_ONE_BITS = 0x3F800000
_C2, _C3, _C4 = np.float32(1.0 / 2.0), np.float32(1.0 / 6.0), np.float32(1.0 / 24.0)
_C5, _C6, _C7 = np.float32(1.0 / 120.0), np.float32(1.0 / 720.0), np.float32(1.0 / 5040.0)


@kernel
def standardise(X: _Doubles, mean: _Doubles, scale: _Doubles, limit: float, out: _Singles) -> None:
    """Write (X - mean) scale, kept within the limit: (n, k), with more rows in `out`."""
    n, k = X.shape
    for i in range(n):
        for j in range(k):
            out[i, j] = min(max((X[i, j] - mean[j]) * scale[j], -limit), limit)


@kernel
def add_and_activate(x: _Singles, bias: _Singles) -> None:
    """Add the bias (k,) to each row of x (n, k); then SiLU, x / (1 + exp(-x))."""
    n, k = x.shape
    for i in range(n):
        for j in range(k):
            value = x[i, j] + bias[j]
            # The exponential must not overflow.
            power = min(max(-value, -_MOST), _MOST)
            shifted = power * _OVER_LN2 + _ROUND
            whole = shifted - _ROUND
            r = (power - whole * _LN2_HEAD) - whole * _LN2_TAIL
            t = _C4 + r * (_C5 + r * (_C6 + r * _C7))
            t = _ONE + r * (_ONE + r * (_C2 + r * (_C3 + r * t)))
            two_power = single_of((bits_of_single(shifted) << 23) + _ONE_BITS)
            x[i, j] = value / (_ONE + t * two_power)
