"""Kernels that sort out the few legs whose transfer plane or sense of rotation needs care."""

import math

import numpy as np
from numpy.typing import NDArray

from feasibility.runtime.jit import kernel


@kernel
def sine_below(
    rv_dep: NDArray[np.float64], rv_arr: NDArray[np.float64], limit: float
) -> NDArray[np.bool_]:
    """Return (n,) whether the sine of the angle between two positions is below a limit.

    `rv_dep` and `rv_arr` are (n, 6), m and m/s.
    """
    n = len(rv_dep)
    below = np.empty(n, dtype=np.bool_)
    for i in range(n):
        x, y, z = rv_dep[i, 0], rv_dep[i, 1], rv_dep[i, 2]
        u, v, w = rv_arr[i, 0], rv_arr[i, 1], rv_arr[i, 2]
        a, b, c = y * w - z * v, z * u - x * w, x * v - y * u
        product = (x * x + y * y + z * z) * (u * u + v * v + w * w)
        below[i] = a * a + b * b + c * c < limit * limit * product
    return below


@kernel
def turns_against(
    rv_dep: NDArray[np.float64], rv_arr: NDArray[np.float64], clearly: float
) -> NDArray[np.bool_]:
    """Return (n,) whether arcs that are prograde go clearly against the departure orbit.

    That is where the cosine between the arc's plane and the orbit's is below ``-clearly``.
    `rv_dep` and `rv_arr` are (n, 6), m and m/s.
    """
    n = len(rv_dep)
    against = np.empty(n, dtype=np.bool_)
    for i in range(n):
        x, y, z = rv_dep[i, 0], rv_dep[i, 1], rv_dep[i, 2]
        u, v, w = rv_arr[i, 0], rv_arr[i, 1], rv_arr[i, 2]
        a, b, c = y * w - z * v, z * u - x * w, x * v - y * u
        p, q, s = rv_dep[i, 3], rv_dep[i, 4], rv_dep[i, 5]
        d, e, f = y * s - z * q, z * p - x * s, x * q - y * p
        forward = a * d + b * e + c * f
        if c < 0.0:
            forward = -forward
        size = math.sqrt((a * a + b * b + c * c) * (d * d + e * e + f * f))
        against[i] = forward < -clearly * size
    return against
