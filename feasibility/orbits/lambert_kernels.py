"""Lambert's problem for 0 to N revolutions.

The method, its variables x, y, lambda, T and the equation numbers below are
those of Izzo 2015, "Revisiting Lambert's problem", Celestial Mechanics and
Dynamical Astronomy 121, 1-15. Two things differ, for the sake of near-singular
geometry and of certainty:

- lambda and 1 - lambda^2 are computed each on its own, from the half angle and
  from the chord, so that transfer angles near 0 and 180 degrees cost no digits
  beyond those that the geometry itself loses;
- Householder's iteration runs inside a bracket and falls back to bisection, so
  that it always ends.

Kernels: arrays must be contiguous float64; nothing is validated; nothing is
allocated except by `lambert_batch`.
"""

import math

import numpy as np
from numpy.typing import NDArray

from feasibility.runtime.jit import inner_kernel, kernel

_Array = NDArray[np.float64]

_MAX_ITERATIONS = 60
# Householder's iteration is of fourth order: after a step this small, relative to the distance
# from the ends of the interval, the remaining error is far below rounding.
_STEP_TOLERANCE = 1e-7
# Two multi-revolution branches meet in a double root, where convergence is slower.
_STEP_TOLERANCE_MULTI = 1e-10
# Distance from the parabola within which the time of flight is summed as a series.
_PARABOLIC = 0.1
# ... and within which its derivatives are replaced by their limit.
_VERY_PARABOLIC = 1e-5


@inner_kernel
def _time_of_flight(x: float, lam: float, q: float, turns: float) -> tuple[float, float]:
    """Return T(x) and y; `q` is 1 - lambda^2, `turns` the number of revolutions times pi."""
    y = math.sqrt(lam * lam * x * x + q)
    # eta = y - lambda x without cancellation (y^2 - lambda^2 x^2 = q).
    eta = q / (y + lam * x) if lam * x > 0.0 else y - lam * x
    e = (1.0 - x) * (1.0 + x)
    if turns == 0.0 and abs(x - 1.0) < _PARABOLIC:
        # Battin's series, equation 20: 4/3 F(3, 1; 5/2; S1).
        s1 = 0.5 * (1.0 - lam - x * eta)
        term = 4.0 / 3.0
        series = term
        for k in range(60):
            term *= s1 * (3.0 + k) / (2.5 + k)
            series += term
            if abs(term) < 1e-17 * series:
                break
        return 0.5 * (eta * eta * eta * series + 4.0 * lam * eta), y
    # Equation 18 with x - lambda y written as x q - lambda eta.
    if e > 0.0:
        root = math.sqrt(e)
        psi = math.atan2(eta * root, x * y + lam * e) + turns
    else:
        root = math.sqrt(-e)
        psi = math.asinh(eta * root)
    return (psi / root - x * q + lam * eta) / e, y


@inner_kernel
def _solve(
    x: float,
    low: float,
    high: float,
    rising: bool,
    target: float,
    lam: float,
    q: float,
    turns: float,
    tolerance: float,
) -> float:
    """Return x with T(x) = `target` on a branch that is monotonic between `low` and `high`."""
    lam2 = lam * lam
    lam3 = lam2 * lam
    for _ in range(_MAX_ITERATIONS):
        if not (low < x < high):
            x = 0.5 * (low + high) if high < np.inf else low + max(1.0, abs(low))
        time, y = _time_of_flight(x, lam, q, turns)
        gap = time - target
        if gap == 0.0:
            return x
        if (gap > 0.0) == rising:
            high = x
        else:
            low = x
        e = (1.0 - x) * (1.0 + x)
        if abs(e) < _VERY_PARABOLIC:
            # All three derivatives are 0/0 at x = 1; the first one's limit is enough.
            step = gap / (0.4 * (lam2 * lam3 - 1.0))
        else:
            # Equation 22 and Householder's step of order 3.
            d1 = (3.0 * time * x - 2.0 + 2.0 * lam3 * x / y) / e
            d2 = (3.0 * time + 5.0 * x * d1 + 2.0 * q * lam3 / (y * y * y)) / e
            d3 = (7.0 * x * d2 + 8.0 * d1 - 6.0 * q * lam2 * lam3 * x / (y * y * y * y * y)) / e
            step = (
                gap
                * (d1 * d1 - 0.5 * gap * d2)
                / (d1 * (d1 * d1 - gap * d2) + d3 * gap * gap / 6.0)
            )
        inside = low < x - step < high
        x = x - step
        if inside and abs(step) <= tolerance * min(1.0 + x, max(abs(1.0 - x), tolerance)):
            return x
        if high < np.inf and high - low <= 4.5e-16 * abs(high):
            return 0.5 * (low + high)
    return x


@inner_kernel
def _least_time(lam: float, q: float, turns: float) -> tuple[float, float]:
    """Return x and T where T(x) is least, for one revolution or more (Halley on T' = 0)."""
    lam3 = lam * lam * lam
    low = 0.0
    high = 1.0
    x = 0.1
    time = 0.0
    for _ in range(_MAX_ITERATIONS):
        time, y = _time_of_flight(x, lam, q, turns)
        e = (1.0 - x) * (1.0 + x)
        d1 = (3.0 * time * x - 2.0 + 2.0 * lam3 * x / y) / e
        d2 = (3.0 * time + 5.0 * x * d1 + 2.0 * q * lam3 / (y * y * y)) / e
        d3 = (7.0 * x * d2 + 8.0 * d1 - 6.0 * q * lam * lam * lam3 * x / (y**5)) / e
        if d1 > 0.0:
            high = x
        else:
            low = x
        previous = x
        x = x - d1 * d2 / (d2 * d2 - 0.5 * d1 * d3)
        if not (low < x < high):
            x = 0.5 * (low + high)
        if abs(x - previous) <= 1e-9 or high - low <= 1e-15:
            break
    time, _ = _time_of_flight(x, lam, q, turns)
    return x, time


@inner_kernel
def _direct_guess(target: float, direct: float, lam: float, q: float) -> float:
    """Return the first x of the direct transfer, equation 30; `direct` is T(0)."""
    one_lam = q / (1.0 + lam) if lam > 0.0 else 1.0 - lam
    parabolic = 2.0 / 3.0 * one_lam * (1.0 + lam + lam * lam)
    if target >= direct:
        return float((direct / target) ** (2.0 / 3.0) - 1.0)
    if target <= parabolic:
        lam5 = one_lam * (1.0 + lam * (1.0 + lam * (1.0 + lam * (1.0 + lam))))
        return 2.5 * parabolic * (parabolic - target) / (target * lam5) + 1.0
    power = math.log(2.0) / math.log(direct / parabolic)
    return float((direct / target) ** power - 1.0)


@kernel
def lambert(
    r1: _Array, r2: _Array, tof: float, max_revs: int, mu: float, v1: _Array, v2: _Array
) -> None:
    """Solve Lambert's problem, prograde (angular momentum with z >= 0), for all branches.

    Parameters
    ----------
    r1, r2 : (3,) float64, m
        Positions at departure and arrival.
    tof : float, s
        Time of flight.
    max_revs : int
        Largest number of complete revolutions.
    mu : float, m3/s2
    v1, v2 : (1 + 2 max_revs, 3) float64, m/s
        Receive the velocities at both ends: the direct transfer first, then
        for each number of revolutions the branch of smaller and of larger x.
        NaN where a branch does not exist or the plane of the transfer is
        undefined.
    """
    for b in range(1 + 2 * max_revs):
        for i in range(3):
            v1[b, i] = np.nan
            v2[b, i] = np.nan
    n1 = math.sqrt(r1[0] * r1[0] + r1[1] * r1[1] + r1[2] * r1[2])
    n2 = math.sqrt(r2[0] * r2[0] + r2[1] * r2[1] + r2[2] * r2[2])
    cx = r2[0] - r1[0]
    cy = r2[1] - r1[1]
    cz = r2[2] - r1[2]
    chord = math.sqrt(cx * cx + cy * cy + cz * cz)
    hx = r1[1] * r2[2] - r1[2] * r2[1]
    hy = r1[2] * r2[0] - r1[0] * r2[2]
    hz = r1[0] * r2[1] - r1[1] * r2[0]
    h = math.sqrt(hx * hx + hy * hy + hz * hz)
    if not (h > 0.0 and tof > 0.0):
        return
    sign = 1.0 if hz >= 0.0 else -1.0
    hx *= sign / h
    hy *= sign / h
    hz *= sign / h
    ux, uy, uz = r1[0] / n1, r1[1] / n1, r1[2] / n1
    wx, wy, wz = r2[0] / n2, r2[1] / n2, r2[2] / n2
    # Transverse directions, along the motion.
    t1x, t1y, t1z = hy * uz - hz * uy, hz * ux - hx * uz, hx * uy - hy * ux
    t2x, t2y, t2z = hy * wz - hz * wy, hz * wx - hx * wz, hx * wy - hy * wx
    semi = 0.5 * (n1 + n2 + chord)
    mean = math.sqrt(n1 * n2)
    sx, sy, sz = ux + wx, uy + wy, uz + wz
    dx, dy, dz = ux - wx, uy - wy, uz - wz
    lam = 0.5 * sign * mean * math.sqrt(sx * sx + sy * sy + sz * sz) / semi
    sigma = mean * math.sqrt(dx * dx + dy * dy + dz * dz) / chord
    rho = (n1 - n2) / chord
    gamma = math.sqrt(0.5 * mu * semi)
    q = chord / semi
    target = math.sqrt(2.0 * mu / (semi * semi * semi)) * tof
    direct = math.atan2(math.sqrt(q), lam) + lam * math.sqrt(q)
    for revs in range(max_revs + 1):
        turns = math.pi * revs
        if target <= turns:
            return
        least_x = 0.0
        if revs > 0 and target < direct + turns:
            least_x, least_time = _least_time(lam, q, turns)
            if target < least_time:
                return
        for side in range(1 if revs == 0 else 2):
            if revs == 0:
                x = _direct_guess(target, direct, lam, q)
                x = _solve(x, -1.0, np.inf, False, target, lam, q, turns, _STEP_TOLERANCE)
            elif side == 0:
                # Equation 31, left and right.
                guess = ((turns + math.pi) / (8.0 * target)) ** (2.0 / 3.0)
                x = (guess - 1.0) / (guess + 1.0)
                x = _solve(x, -1.0, least_x, False, target, lam, q, turns, _STEP_TOLERANCE_MULTI)
            else:
                guess = (8.0 * target / turns) ** (2.0 / 3.0)
                x = (guess - 1.0) / (guess + 1.0)
                x = _solve(x, least_x, 1.0, True, target, lam, q, turns, _STEP_TOLERANCE_MULTI)
            y = math.sqrt(lam * lam * x * x + q)
            # Algorithm 1: radial and transverse components at both ends.
            difference = gamma * (lam * y - x)
            total = gamma * rho * (lam * y + x)
            transverse = gamma * sigma * (y + lam * x)
            vr1 = (difference - total) / n1
            vr2 = -(difference + total) / n2
            vt1 = transverse / n1
            vt2 = transverse / n2
            b = 0 if revs == 0 else 2 * revs - 1 + side
            v1[b, 0] = vr1 * ux + vt1 * t1x
            v1[b, 1] = vr1 * uy + vt1 * t1y
            v1[b, 2] = vr1 * uz + vt1 * t1z
            v2[b, 0] = vr2 * wx + vt2 * t2x
            v2[b, 1] = vr2 * wy + vt2 * t2y
            v2[b, 2] = vr2 * wz + vt2 * t2z


@kernel
def lambert_batch(
    r1: _Array, r2: _Array, tof: _Array, max_revs: int, mu: float
) -> tuple[_Array, _Array]:
    """Return v1, v2 (n, 1 + 2 max_revs, 3) for r1, r2 (n, 3) and tof (n,); see `lambert`."""
    n = r1.shape[0]
    v1 = np.empty((n, 1 + 2 * max_revs, 3))
    v2 = np.empty((n, 1 + 2 * max_revs, 3))
    for i in range(n):
        lambert(r1[i], r2[i], tof[i], max_revs, mu, v1[i], v2[i])
    return v1, v2
