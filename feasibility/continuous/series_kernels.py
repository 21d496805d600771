"""Motion under gravity and a constant thrust as power series in time, with all derivatives.

Units in which the Sun's gravitational parameter is 1; masses are shares of the initial mass of the
leg. The thrust vector is constant, so the mass falls linearly and the acceleration is

    a(t) = push * u / (m - burn * s * t),

with the throttle vector u, its size s, the acceleration `push` of the full thrust at mass 1 and
the mass flow `burn` of the full thrust. u and s are varied apart, because s alone burns mass.

The series of r follows from r'' = -r q + a with q = w^(-3/2), w = r.r, by the recurrences of
automatic differentiation (Jorba and Zou, "A software package for the numerical integration of
ODEs by means of high-order Taylor methods", 2005). A small change obeys d'' = G(t) d + da with the
gravity gradient G = 3 w^(-5/2) r r^T - q I, itself a series.
"""

import math

import numpy as np
from numpy.typing import NDArray

from feasibility.runtime.jit import inner_kernel

ORDER = 12
"""Terms of the series; with steps of `STEP` the first that is left out is below rounding."""

STEP = 0.05
"""Longest step in units of r^(3/2), the time scale of the motion at r."""

STATE, THROTTLE, MASS, SIZE, COLUMNS = 0, 6, 9, 10, 11
"""First columns of the derivatives: by the state, by u, by the mass, by s; and their number."""

_Array = NDArray[np.float64]


@inner_kernel
def power(w: _Array, exponent: float, out: _Array) -> None:
    """Write the series of w(t)^exponent."""
    out[0] = w[0] ** exponent
    for k in range(1, ORDER - 1):
        total = 0.0
        for j in range(k):
            total += (exponent * (k - j) - j) * w[k - j] * out[j]
        out[k] = total / (k * w[0])


@inner_kernel
def motion(
    x: _Array,
    mass: float,
    u: _Array,
    s: float,
    push: float,
    burn: float,
    w: _Array,
    q: _Array,
    r: _Array,
) -> None:
    """Write the series of r (ORDER + 1, 3), of w = r.r and of q = w^(-3/2)."""
    for i in range(3):
        r[0, i] = x[i]
        r[1, i] = x[3 + i]
    ratio = burn * s / mass
    thrust = push / mass
    for j in range(ORDER - 1):
        total = 0.0
        for k in range(j + 1):
            total += r[k, 0] * r[j - k, 0] + r[k, 1] * r[j - k, 1] + r[k, 2] * r[j - k, 2]
        w[j] = total
        if j == 0:
            q[0] = 1.0 / (w[0] * math.sqrt(w[0]))
        else:
            total = 0.0
            for k in range(j):
                total += (-1.5 * (j - k) - k) * w[j - k] * q[k]
            q[j] = total / (j * w[0])
        for i in range(3):
            total = thrust * u[i]
            for k in range(j + 1):
                total -= q[k] * r[j - k, i]
            r[j + 2, i] = total / ((j + 1) * (j + 2))
        thrust *= ratio


@inner_kernel
def end_of(series: _Array, dt: float, out: _Array, column: int) -> None:
    """Write position and velocity at dt of a series (ORDER + 1, 3) into a column of `out`."""
    for i in range(3):
        place, speed = 0.0, 0.0
        for j in range(ORDER, 0, -1):
            place = (place + series[j, i]) * dt
            speed = speed * dt + j * series[j, i]
        out[i, column] = series[0, i] + place
        out[3 + i, column] = speed


@inner_kernel
def gradient(w: _Array, q: _Array, r: _Array, five: _Array, square: _Array, g: _Array) -> None:
    """Write the series of the six different components of the gravity gradient."""
    power(w, -2.5, five)
    for j in range(ORDER - 1):
        for c in range(6):
            a = 0 if c < 3 else (1 if c < 5 else 2)
            b = c if c < 3 else (c - 2 if c < 5 else 2)
            total = 0.0
            for k in range(j + 1):
                total += r[k, a] * r[j - k, b]
            square[j, c] = total
            total = 0.0
            for k in range(j + 1):
                total += five[k] * square[j - k, c]
            g[j, c] = 3.0 * total - (q[j] if a == b else 0.0)


@inner_kernel
def variation(g: _Array, forcing: _Array, d: _Array) -> None:
    """Write the series of a small change, whose first two terms are in `d`."""
    for j in range(ORDER - 1):
        x, y, z = forcing[j, 0], forcing[j, 1], forcing[j, 2]
        for k in range(j + 1):
            dx, dy, dz = d[j - k, 0], d[j - k, 1], d[j - k, 2]
            x += g[k, 0] * dx + g[k, 1] * dy + g[k, 2] * dz
            y += g[k, 1] * dx + g[k, 3] * dy + g[k, 4] * dz
            z += g[k, 2] * dx + g[k, 4] * dy + g[k, 5] * dz
        share = 1.0 / ((j + 1) * (j + 2))
        d[j + 2, 0], d[j + 2, 1], d[j + 2, 2] = x * share, y * share, z * share


@inner_kernel
def force(
    column: int, mass: float, u: _Array, s: float, push: float, burn: float, forcing: _Array
) -> None:
    """Write the series of the change of the thrust's acceleration by u, by mass or by s."""
    ratio = burn * s / mass
    term, before = push / mass, 0.0
    for j in range(ORDER - 1):
        for i in range(3):
            forcing[j, i] = 0.0
            if column >= THROTTLE and column < MASS:
                forcing[j, i] = term if i == column - THROTTLE else 0.0
            elif column == MASS:
                # d(1/m)/dm = -1/m(t)^2 has the terms -(j + 1) ratio^j / m^2.
                forcing[j, i] = -(j + 1) * term / mass * u[i]
            elif column == SIZE:
                # d(1/m)/ds = burn t / m(t)^2 has the terms j ratio^(j - 1) burn / m^2.
                forcing[j, i] = j * before * burn / mass * u[i]
        before = term
        term *= ratio
