"""Equinoctial elements with the mean motion, in scaled units (mu = 1).

The elements (n, e cos, e sin, h, k, l) are the equinoctial ones of Broucke and Cefola
1972 ("On the equinoctial orbit elements") with the mean motion n in place of the
semi-major axis, h + i k = tan(i/2) exp(i node) and the mean longitude l. Under
Kepler motion only l changes, by n dt: exactly linear, which is what makes them the
coordinates of choice for closing an arc over a revolution or two.

Ellipses only, and no orbit exactly retrograde to the reference plane, which is that of
the departure orbit.
"""

import math

import numpy as np
from numpy.typing import NDArray

from feasibility.runtime.jit import inner_kernel, kernel

_TWO_PI = 2.0 * math.pi
_STEP = 1e-5

_Array = NDArray[np.float64]


@inner_kernel
def wrap(angle: float) -> float:
    """Return the angle moved by whole turns into [-pi, pi]."""
    return angle - _TWO_PI * float(np.rint(angle / _TWO_PI))


@kernel
def to_elements(x: _Array, e: _Array) -> bool:
    """Write the elements (n, ex, ey, h, k, l) of the state `x`; return False if not elliptic.

    Equinoctial elements (Broucke and Cefola 1972) with the mean motion n in
    place of the semi-major axis; h + ik = tan(i/2) exp(i node).
    """
    r = math.sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2])
    hx = x[1] * x[5] - x[2] * x[4]
    hy = x[2] * x[3] - x[0] * x[5]
    hz = x[0] * x[4] - x[1] * x[3]
    hh = math.sqrt(hx * hx + hy * hy + hz * hz)
    alpha = 2.0 / r - (x[3] * x[3] + x[4] * x[4] + x[5] * x[5])
    if not alpha > 1e-6 or not hh + hz > 1e-6 * hh:
        return False
    a = 1.0 / alpha
    h = -hy / (hh + hz)
    k = hx / (hh + hz)
    s2 = 1.0 + h * h + k * k
    f0 = (1.0 + h * h - k * k) / s2
    f1 = 2.0 * h * k / s2
    f2 = -2.0 * k / s2
    g1 = (1.0 - h * h + k * k) / s2
    g2 = 2.0 * h / s2
    ecx = x[4] * hz - x[5] * hy - x[0] / r
    ecy = x[5] * hx - x[3] * hz - x[1] / r
    ecz = x[3] * hy - x[4] * hx - x[2] / r
    ex = ecx * f0 + ecy * f1 + ecz * f2
    ey = ecx * f1 + ecy * g1 + ecz * g2
    px = x[0] * f0 + x[1] * f1 + x[2] * f2
    py = x[0] * f1 + x[1] * g1 + x[2] * g2
    eta2 = 1.0 - ex * ex - ey * ey
    if not eta2 > 1e-10:
        return False
    eta = math.sqrt(eta2)
    b = 1.0 / (1.0 + eta)
    cos_f = ex + ((1.0 - ex * ex * b) * px - ex * ey * b * py) / (a * eta)
    sin_f = ey + ((1.0 - ey * ey * b) * py - ex * ey * b * px) / (a * eta)
    e[0] = alpha * math.sqrt(alpha)
    e[1] = ex
    e[2] = ey
    e[3] = h
    e[4] = k
    e[5] = math.atan2(sin_f, cos_f) - ex * sin_f + ey * cos_f
    return True


@kernel
def from_elements(e: _Array, x: _Array) -> None:
    """Write the state of the elements (n, ex, ey, h, k, l)."""
    ex, ey, h, k = e[1], e[2], e[3], e[4]
    f = e[5]
    for _ in range(20):
        s = math.sin(f)
        c = math.cos(f)
        step = (e[5] - f - ey * c + ex * s) / (1.0 - ex * c - ey * s)
        f += min(1.0, max(-1.0, step))
        if abs(step) < 1e-13 * (1.0 + abs(f)):
            break
    s = math.sin(f)
    c = math.cos(f)
    a = e[0] ** (-2.0 / 3.0)
    b = 1.0 / (1.0 + math.sqrt(1.0 - ex * ex - ey * ey))
    na_r = e[0] * a / (1.0 - ex * c - ey * s)
    px = a * ((1.0 - ey * ey * b) * c + ex * ey * b * s - ex)
    py = a * ((1.0 - ex * ex * b) * s + ex * ey * b * c - ey)
    vx = na_r * (ex * ey * b * c - (1.0 - ey * ey * b) * s)
    vy = na_r * ((1.0 - ex * ex * b) * c - ex * ey * b * s)
    s2 = 1.0 + h * h + k * k
    f0 = (1.0 + h * h - k * k) / s2
    f1 = 2.0 * h * k / s2
    f2 = -2.0 * k / s2
    g1 = (1.0 - h * h + k * k) / s2
    g2 = 2.0 * h / s2
    x[0] = px * f0 + py * f1
    x[1] = px * f1 + py * g1
    x[2] = px * f2 + py * g2
    x[3] = vx * f0 + vy * f1
    x[4] = vx * f1 + vy * g1
    x[5] = vx * f2 + vy * g2


@inner_kernel
def element_gap(x: _Array, target: _Array, gap: _Array) -> bool:
    """Write elements of `x` minus `target`, longitude wrapped; return False if not elliptic."""
    if not to_elements(x, gap):
        return False
    for i in range(6):
        gap[i] -= target[i]
    gap[5] = wrap(gap[5])
    return True


@inner_kernel
def element_derivatives(x: _Array, first: int, columns: _Array, scratch: _Array) -> bool:
    """Write d(elements)/dx for the components `first`, ... of x; return False if not elliptic.

    Central differences: their error of 1e-10 only slows a Newton iteration.

    Parameters
    ----------
    x : (6,) float64
        State.
    first : int
        0 for all columns, 3 for those of the velocity.
    columns : (6, 6 - first or more) float64
        Receives the derivatives.
    scratch : (3, 6) float64
    """
    plus, minus, shifted = scratch[0], scratch[1], scratch[2]
    for i in range(6):
        shifted[i] = x[i]
    for j in range(first, 6):
        shifted[j] = x[j] + _STEP
        if not to_elements(shifted, plus):
            return False
        shifted[j] = x[j] - _STEP
        if not to_elements(shifted, minus):
            return False
        shifted[j] = x[j]
        for i in range(5):
            columns[i, j - first] = (plus[i] - minus[i]) / (2.0 * _STEP)
        columns[5, j - first] = wrap(plus[5] - minus[5]) / (2.0 * _STEP)
    return True
