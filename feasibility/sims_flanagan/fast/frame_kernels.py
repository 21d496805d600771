"""From SI to the scaled frame of the departure orbit and back, and throttles."""

import math

import numpy as np
from numpy.typing import NDArray

from feasibility.runtime.jit import inner_kernel

_Array = NDArray[np.float64]


@inner_kernel
def rotation(x: _Array, frame: _Array) -> None:
    """Write the rows of the frame: radial, along-track, normal of the state `x`."""
    r = math.sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2])
    for i in range(3):
        frame[0, i] = x[i] / r
    frame[2, 0] = x[1] * x[5] - x[2] * x[4]
    frame[2, 1] = x[2] * x[3] - x[0] * x[5]
    frame[2, 2] = x[0] * x[4] - x[1] * x[3]
    h = math.sqrt(frame[2, 0] ** 2 + frame[2, 1] ** 2 + frame[2, 2] ** 2)
    for i in range(3):
        frame[2, i] /= h
    frame[1, 0] = frame[2, 1] * frame[0, 2] - frame[2, 2] * frame[0, 1]
    frame[1, 1] = frame[2, 2] * frame[0, 0] - frame[2, 0] * frame[0, 2]
    frame[1, 2] = frame[2, 0] * frame[0, 1] - frame[2, 1] * frame[0, 0]


@inner_kernel
def scale_leg(
    rv0: _Array, rv1: _Array, mu: float, frame: _Array, x0: _Array, x1: _Array
) -> tuple[float, float]:
    """Write the end states in the departure frame, mu = 1; return the units of length and speed.

    The unit of length is the departure radius. The frame makes solutions the same
    however a leg is rotated, and keeps the elements clear of their singularity.
    """
    length = math.sqrt(rv0[0] ** 2 + rv0[1] ** 2 + rv0[2] ** 2)
    speed = math.sqrt(mu / length)
    rotation(rv0, frame)
    for i in range(3):
        x0[i] = x0[3 + i] = x1[i] = x1[3 + i] = 0.0
        for j in range(3):
            x0[i] += frame[i, j] * rv0[j] / length
            x0[3 + i] += frame[i, j] * rv0[3 + j] / speed
            x1[i] += frame[i, j] * rv1[j] / length
            x1[3 + i] += frame[i, j] * rv1[3 + j] / speed
    return length, speed


@inner_kernel
def write_throttles(
    dv: _Array, z: float, c: float, n: int, frame: _Array, throttles: _Array
) -> float:
    """Write the throttles (n, 3) of scaled impulses, in the outer frame; return m_final / m0.

    A throttle is dv m / (T dt) with the mass before the impulse in the forward half,
    after it in the backward half; z = T dt / (m0 c).
    """
    total = 0.0
    for i in range(n):
        y = math.sqrt(dv[i, 0] ** 2 + dv[i, 1] ** 2 + dv[i, 2] ** 2) / c
        if i >= n // 2:
            total += y
        scale = math.exp(-total) / (z * c)
        if i < n // 2:
            total += y
        for j in range(3):
            throttles[i, j] = scale * (
                frame[0, j] * dv[i, 0] + frame[1, j] * dv[i, 1] + frame[2, j] * dv[i, 2]
            )
    return math.exp(-total)


@inner_kernel
def backward_impulse(z: float) -> float:
    """Return y with y exp(-y) = z, at most 1: a backward segment's impulse over c.

    Beyond z = 1/e the mass convention sets a backward impulse no limit at all.
    """
    if z > 0.367:
        return 1.0
    y = z * (1.0 + z * (1.0 + 1.5 * z))
    for _ in range(20):
        step = (y - z * math.exp(y)) / (1.0 - y)
        y = min(y - step, 0.999)
        if abs(step) < 1e-15:
            break
    return y


@inner_kernel
def read_throttles(
    throttles: _Array, z: float, c: float, n: int, frame: _Array, dv: _Array
) -> None:
    """Write the scaled impulses of throttles: the inverse of `write_throttles`."""
    for i in range(n):
        size = 1e-300
        for j in range(3):
            size += throttles[i, j] ** 2
        size = math.sqrt(size)
        y = z * size if i < n // 2 else backward_impulse(z * size)
        z *= math.exp(y)
        for j in range(3):
            dv[i, j] = (
                c
                * y
                / size
                * (
                    frame[j, 0] * throttles[i, 0]
                    + frame[j, 1] * throttles[i, 1]
                    + frame[j, 2] * throttles[i, 2]
                )
            )
