"""Closed-form and nearly closed-form estimates of the maximum initial mass of a leg.

Both replace the two impulses of a Lambert arc by two arcs of constant
acceleration, a1 until the time t1 and a2 from there to the time of flight T,
inertially fixed directions and equal magnitudes a, that have the same effect on
the final position and velocity:

- MIMA (Hennes, Izzo and Landau 2016, "Fast approximators for optimal low-thrust
  hops between main belt asteroids", IEEE SSCI) neglects gravity differences
  between the arcs and has a closed form;
- MIMA2 (Izzo et al. 2025, "Asteroid mining: ACT&Friends' results for the GTOC12
  problem", Astrodynamics 9, 19-40, arXiv 2410.20839) carries each acceleration
  to the end with the state-transition matrix of the Lambert arc, integrated by
  Simpson's rule over each of the two arcs, and has to search for t1.

The mass follows from the acceleration by the mass law of Hennes et al.,
m = 2 F / a / (1 + exp(-a T / v_e)): the mean of the acceleration at full thrust
is a.

Kernels: arrays must be contiguous float64; nothing is validated; nothing is
allocated except by `maximum_mass_batch`.
"""

import math

import numpy as np
from numpy.typing import NDArray

from feasibility.jit import kernel
from feasibility.orbits.kepler_kernels import propagate_position_stm
from feasibility.orbits.lambert_kernels import lambert

_Array = NDArray[np.float64]
_Scratch = tuple[_Array, _Array, _Array]

_MAX_EVALUATIONS = 80
_TOLERANCE = 1e-12
_SECANT_TOLERANCE = 1e-11
_PARABOLA_TOLERANCE = 1e-13


@kernel
def mass_from_acceleration(a: float, tof: float, thrust: float, exhaust_velocity: float) -> float:
    """Return the initial mass in kg whose mean acceleration at full thrust is `a` m/s2."""
    return 2.0 * thrust / (a * (1.0 + math.exp(-a * tof / exhaust_velocity)))


@kernel
def mima_acceleration(dv1: _Array, dv2: _Array, tof: float) -> tuple[float, float]:
    """Return the acceleration of MIMA in m/s2 for two impulses (3,) m/s, and t1 / T.

    With D = dv1 + dv2, E = dv1 - dv2 and x = t1 / T, the two conditions (same
    change of velocity and of position) give a1 T = D + E / x and
    a2 T = D - E / (1 - x); equal magnitudes make k x^2 + (2 - k) x - 1 = 0 with
    k = 2 D.E / E.E, whose root in (0, 1) is taken in the form without
    cancellation.
    """
    ee = 0.0
    de = 0.0
    dd = 0.0
    for i in range(3):
        d = dv1[i] + dv2[i]
        e = dv1[i] - dv2[i]
        dd += d * d
        de += d * e
        ee += e * e
    if ee == 0.0:
        return math.sqrt(dd) / tof, 0.5
    k = 2.0 * de / ee
    root = math.sqrt(k * k + 4.0)
    x = 2.0 / (2.0 + (4.0 / (root + k) if k > 0.0 else root - k))
    return math.sqrt(dd + 2.0 * de / x + ee / (x * x)) / tof, x


@kernel
def _mima_slope(dv1: _Array, dv2: _Array, x: float) -> float:
    """Return d/dx of (a1 - a2) / (a1 + a2) of MIMA at the switch x: MIMA2's, nearly."""
    ee = 0.0
    de = 0.0
    dd = 0.0
    for i in range(3):
        d = dv1[i] + dv2[i]
        e = dv1[i] - dv2[i]
        dd += d * d
        de += d * e
        ee += e * e
    y = 1.0 - x
    a1 = math.sqrt(dd + (2.0 * de + ee / x) / x)
    a2 = math.sqrt(dd - (2.0 * de - ee / y) / y)
    slope1 = -(de + ee / x) / (x * x * a1)
    slope2 = -(de - ee / y) / (y * y * a2)
    return 2.0 * (a2 * slope1 - a1 * slope2) / ((a1 + a2) * (a1 + a2))


@kernel
def _accelerations(
    x: float, rv: _Array, tof: float, mu: float, rhs: _Array, end: _Array, scratch: _Scratch
) -> tuple[float, float]:
    """Return |a1| T and |a2| T for a switch at x T.

    `rhs` (6,) and `end` (6, 3) are at epoch 0, positions divided by T.
    """
    work, state, stm = scratch
    for i in range(6):
        work[i, 6] = rhs[i]
        for j in range(6):
            work[i, j] = 0.0
    # Simpson on both arcs: nodes 0, t1/2, t1, (t1 + T)/2, T; the inverse of a
    # state-transition matrix is its symplectic transpose, so an acceleration at t
    # acts at epoch 0 through (-Phi_rv^T, Phi_rr^T).
    first = x / 6.0
    second = (1.0 - x) / 6.0
    for node in range(3):
        if node == 0:
            time, w1, w2 = 0.5 * x * tof, 4.0 * first, 0.0
        elif node == 1:
            time, w1, w2 = x * tof, first, second
        else:
            time, w1, w2 = 0.5 * (1.0 + x) * tof, 0.0, 4.0 * second
        propagate_position_stm(rv, time, mu, state, stm)
        for i in range(3):
            for j in range(3):
                position = -stm[j, 3 + i] / tof
                velocity = stm[j, i]
                work[i, j] += w1 * position
                work[3 + i, j] += w1 * velocity
                work[i, 3 + j] += w2 * position
                work[3 + i, 3 + j] += w2 * velocity
    for i in range(3):
        work[3 + i, i] += first
        for j in range(3):
            work[i, 3 + j] += second * end[i, j]
            work[3 + i, 3 + j] += second * end[3 + i, j]
    # Gaussian elimination with partial pivoting.
    for k in range(6):
        pivot = k
        for i in range(k + 1, 6):
            if abs(work[i, k]) > abs(work[pivot, k]):
                pivot = i
        if pivot != k:
            for j in range(k, 7):
                work[k, j], work[pivot, j] = work[pivot, j], work[k, j]
        inverse = 1.0 / work[k, k]
        for i in range(k + 1, 6):
            factor = work[i, k] * inverse
            for j in range(k + 1, 7):
                work[i, j] -= factor * work[k, j]
    for k in range(5, -1, -1):
        total = work[k, 6]
        for j in range(k + 1, 6):
            total -= work[k, j] * work[j, 6]
        work[k, 6] = total / work[k, k]
    a1 = math.sqrt(work[0, 6] ** 2 + work[1, 6] ** 2 + work[2, 6] ** 2)
    a2 = math.sqrt(work[3, 6] ** 2 + work[4, 6] ** 2 + work[5, 6] ** 2)
    return a1, a2


@kernel
def mima2_acceleration(
    rv: _Array,
    dv1: _Array,
    dv2: _Array,
    tof: float,
    mu: float,
    rhs: _Array,
    end: _Array,
    scratch: _Scratch,
) -> float:
    """Return the acceleration of MIMA2 in m/s2.

    The switching time is searched on the relative difference of the magnitudes,
    which falls from 1 to -1, from MIMA's on, by Chandrupatla's method (1997, "A new hybrid
    quadratic/bisection algorithm for finding the zero of a nonlinear function
    without using derivatives"). Several switching times may be right, mostly on
    long or expensive transfers; then another search, such as pykep's, may end
    at another one.

    Parameters
    ----------
    rv : (6,) float64, m and m/s
        State at departure on the Lambert arc.
    dv1, dv2 : (3,) float64, m/s
        Impulses at departure and arrival.
    tof : float, s
    mu : float, m3/s2
    rhs, end, scratch : (6,), (6, 3) and the three of (6, 7), (6,), (6, 6) float64
        Overwritten.

    Returns
    -------
    float
        NaN where the search meets a singular system.
    """
    _, state, stm = scratch
    propagate_position_stm(rv, tof, mu, state, stm)
    for i in range(3):
        rhs[i] = 0.0
        rhs[3 + i] = dv1[i]
        for j in range(3):
            end[i, j] = -stm[j, 3 + i] / tof
            end[3 + i, j] = stm[j, i]
            rhs[i] += end[i, j] * dv2[j]
            rhs[3 + i] += end[3 + i, j] * dv2[j]
    # At both ends one acceleration is unbounded, so that their relative difference is known.
    x1, f1 = 1.0, -1.0
    x2, f2 = 0.0, 1.0
    _, x = mima_acceleration(dv1, dv2, tof)
    t = 1.0 - min(max(x, 0.1), 0.9)
    slope = _mima_slope(dv1, dv2, 1.0 - t)
    f = np.nan
    mean = np.nan
    f_before = np.nan
    mean_before = np.nan
    for _ in range(_MAX_EVALUATIONS):
        x = x1 + t * (x2 - x1)
        a1, a2 = _accelerations(x, rv, tof, mu, rhs, end, scratch)
        f_first, mean_first = f_before, mean_before
        f_before, mean_before = f, mean
        f = (a1 - a2) / (a1 + a2)
        mean = 0.5 * (a1 + a2)
        if not (abs(f) > _TOLERANCE):
            break
        if abs(f * f_before) < _SECANT_TOLERANCE:
            # A secant step from here errs by the product of the two: evaluating it is not needed.
            mean += (mean - mean_before) * f / (f_before - f)
            break
        if abs(f * f_before * f_first) < _PARABOLA_TOLERANCE:
            # Nor is the next point where a parabola through the last three says enough.
            slope = (mean - mean_before) / (f - f_before)
            bend = (slope - (mean_before - mean_first) / (f_before - f_first)) / (f - f_first)
            mean += f * (f_before * bend - slope)
            break
        if (f > 0.0) == (f1 > 0.0):
            x3, f3 = x1, f1
        else:
            x3, f3 = x2, f2
            x2, f2 = x1, f1
        x1, f1 = x, f
        limit = _TOLERANCE / abs(x2 - x1)
        if limit > 0.5:
            break
        if math.isnan(f_before):
            # Only one point is known: MIMA's slope leads on from it.
            t = min(max(-f / (slope * (x2 - x1)), 0.01), 0.99)
            continue
        xi = (x1 - x2) / (x3 - x2)
        phi = (f1 - f2) / (f3 - f2)
        t = 0.5
        if phi * phi < xi and (1.0 - phi) * (1.0 - phi) < 1.0 - xi:
            t = f1 / (f2 - f1) * f3 / (f2 - f3)
            t += (x3 - x1) / (x2 - x1) * f1 / (f3 - f1) * f2 / (f3 - f2)
            t = min(max(t, limit), 1.0 - limit)
    return mean / tof


@kernel
def maximum_mass_batch(
    rv_dep: _Array,
    rv_arr: _Array,
    tof: _Array,
    thrust: _Array,
    exhaust_velocity: _Array,
    max_revs: int,
    mu: float,
    refined: bool,
) -> _Array:
    """Return (n, 1 + 2 max_revs) kg: MIMA, or MIMA2 if `refined`, on each Lambert branch.

    For n legs with `rv_dep`, `rv_arr` (n, 6), `tof`, `thrust`, `exhaust_velocity`
    (n,), SI. NaN where the branch does not exist.
    """
    n = rv_dep.shape[0]
    branches = 1 + 2 * max_revs
    out = np.full((n, branches), np.nan)
    v1 = np.empty((branches, 3))
    v2 = np.empty((branches, 3))
    dv1 = np.empty(3)
    dv2 = np.empty(3)
    rv = np.empty(6)
    rhs = np.empty(6)
    end = np.empty((6, 3))
    scratch = (np.empty((6, 7)), np.empty(6), np.empty((6, 6)))
    for i in range(n):
        lambert(rv_dep[i, :3], rv_arr[i, :3], tof[i], max_revs, mu, v1, v2)
        for b in range(branches):
            if math.isnan(v1[b, 0]):
                continue
            for j in range(3):
                dv1[j] = v1[b, j] - rv_dep[i, 3 + j]
                dv2[j] = rv_arr[i, 3 + j] - v2[b, j]
                rv[j] = rv_dep[i, j]
                rv[3 + j] = v1[b, j]
            if refined:
                a = mima2_acceleration(rv, dv1, dv2, tof[i], mu, rhs, end, scratch)
            else:
                a, _ = mima_acceleration(dv1, dv2, tof[i])
            out[i, b] = mass_from_acceleration(a, tof[i], thrust[i], exhaust_velocity[i])
    return out
