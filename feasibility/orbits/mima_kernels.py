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

from feasibility.orbits.kepler_kernels import kepler_secular, solve_kepler
from feasibility.orbits.lambert_kernels import lambert
from feasibility.runtime.jit import inner_kernel, kernel

_Array = NDArray[np.float64]
# Of the Lambert arc at departure: distance, radial and transverse velocity, 2 mu / r - v^2.
_Orbit = tuple[float, float, float, float]
_Effect = tuple[float, float, float, float, float, float, float, float, float, float]

_MAX_EVALUATIONS = 80
_TOLERANCE = 1e-12
_SECANT_TOLERANCE = 1e-11
_PARABOLA_TOLERANCE = 1e-13


@inner_kernel
def mass_from_acceleration(a: float, tof: float, thrust: float, exhaust_velocity: float) -> float:
    """Return the initial mass in kg whose mean acceleration at full thrust is `a` m/s2."""
    return 2.0 * thrust / (a * (1.0 + math.exp(-a * tof / exhaust_velocity)))


@inner_kernel
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


@inner_kernel
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


@inner_kernel
def _plane_stm(time: float, orbit: _Orbit, mu: float, tof: float) -> _Effect:
    """Return how an acceleration at `time` acts at epoch 0, in the plane of the orbit.

    The inverse of a state-transition matrix is its symplectic transpose, so it acts
    through (-Phi_rv^T / T, Phi_rr^T): four numbers each, by rows, then what moves out of
    the plane, -g / T and f. The matrix is that of `propagate_stm`, whose symbols these
    are, with the position at epoch 0 on the x axis.
    """
    r0, vr, vt, beta = orbit
    s, g1, g2, g3, turns = solve_kepler(time, r0, r0 * vr, beta, mu)
    c = mu * (mu * kepler_secular(s, g2, g3, turns, beta) - time * g2)
    one_f = mu * g2 / r0
    f = 1.0 - one_f
    g = r0 * g1 + r0 * vr * g2
    x = f * r0 + g * vr
    y = g * vt
    r = math.sqrt(x * x + y * y)
    ft = -mu * g1 / (r * r0)
    one_gt = mu * g2 / r
    dvx = ft * r0 - one_gt * vr
    dvy = -one_gt * vt
    vx = dvx + vr
    vy = dvy + vt
    bend = r0 * one_f
    along = 1.0 / (r0 * r0)
    rr_x = r / mu * dvx
    rr_y = r / mu * dvy
    rv_x = (bend * (x - r0) + c * vx) / mu
    rv_y = (bend * y + c * vy) / mu
    less = bend * r0 / mu
    k = -1.0 / tof
    return (
        k * (rv_x * vr - less * dvx + g),
        k * (rv_y * vr - less * dvy),
        k * rv_x * vt,
        k * (rv_y * vt + g),
        rr_x * dvx + (bend * x + c * vx) * along + f,
        rr_y * dvx + (bend * y + c * vy) * along,
        rr_x * dvy,
        rr_y * dvy + f,
        k * g,
        f,
    )


@inner_kernel
def _accelerations(
    x: float, orbit: _Orbit, tof: float, mu: float, rhs: _Array, end: _Effect
) -> tuple[float, float]:
    """Return |a1| T and |a2| T for a switch at x T.

    `rhs` (6,) is at epoch 0, positions divided by T, the two components out of the plane last.
    """
    # Simpson on both arcs: nodes 0, t1/2, t1, (t1 + T)/2, T.
    first = x / 6.0
    second = (1.0 - x) / 6.0
    early = _plane_stm(0.5 * x * tof, orbit, mu, tof)
    middle = _plane_stm(x * tof, orbit, mu, tof)
    late = _plane_stm(0.5 * (1.0 + x) * tof, orbit, mu, tof)
    a00 = first * (4.0 * early[0] + middle[0])
    a01 = first * (4.0 * early[1] + middle[1])
    a10 = first * (4.0 * early[2] + middle[2])
    a11 = first * (4.0 * early[3] + middle[3])
    a20 = first * (4.0 * early[4] + middle[4] + 1.0)
    a21 = first * (4.0 * early[5] + middle[5])
    a30 = first * (4.0 * early[6] + middle[6])
    a31 = first * (4.0 * early[7] + middle[7] + 1.0)
    a02 = second * (4.0 * late[0] + middle[0] + end[0])
    a03 = second * (4.0 * late[1] + middle[1] + end[1])
    a12 = second * (4.0 * late[2] + middle[2] + end[2])
    a13 = second * (4.0 * late[3] + middle[3] + end[3])
    a22 = second * (4.0 * late[4] + middle[4] + end[4])
    a23 = second * (4.0 * late[5] + middle[5] + end[5])
    a32 = second * (4.0 * late[6] + middle[6] + end[6])
    a33 = second * (4.0 * late[7] + middle[7] + end[7])
    # Cramer's rule by minors of the upper and the lower two rows.
    s01 = a00 * a11 - a10 * a01
    s02 = a00 * a12 - a10 * a02
    s03 = a00 * a13 - a10 * a03
    s12 = a01 * a12 - a11 * a02
    s13 = a01 * a13 - a11 * a03
    s23 = a02 * a13 - a12 * a03
    c01 = a20 * a31 - a30 * a21
    c02 = a20 * a32 - a30 * a22
    c03 = a20 * a33 - a30 * a23
    c12 = a21 * a32 - a31 * a22
    c13 = a21 * a33 - a31 * a23
    c23 = a22 * a33 - a32 * a23
    inverse = 1.0 / (s01 * c23 - s02 * c13 + s03 * c12 + s12 * c03 - s13 * c02 + s23 * c01)
    b0, b1, b2, b3 = rhs[0], rhs[1], rhs[2], rhs[3]
    # Minors of the right-hand side with each column.
    u0, u1, u2, u3 = (
        b0 * a10 - b1 * a00,
        b0 * a11 - b1 * a01,
        b0 * a12 - b1 * a02,
        b0 * a13 - b1 * a03,
    )
    d0, d1, d2, d3 = (
        b2 * a30 - b3 * a20,
        b2 * a31 - b3 * a21,
        b2 * a32 - b3 * a22,
        b2 * a33 - b3 * a23,
    )
    x0 = inverse * (u1 * c23 - u2 * c13 + u3 * c12 + s12 * d3 - s13 * d2 + s23 * d1)
    x1 = inverse * (-u0 * c23 + u2 * c03 - u3 * c02 - s02 * d3 + s03 * d2 - s23 * d0)
    x2 = inverse * (u0 * c13 - u1 * c03 + u3 * c01 + s01 * d3 - s03 * d1 + s13 * d0)
    x3 = inverse * (-u0 * c12 + u1 * c02 - u2 * c01 - s01 * d2 + s02 * d1 - s12 * d0)
    p1 = first * (4.0 * early[8] + middle[8])
    p2 = second * (4.0 * late[8] + middle[8] + end[8])
    v1 = first * (4.0 * early[9] + middle[9] + 1.0)
    v2 = second * (4.0 * late[9] + middle[9] + end[9])
    across = 1.0 / (p1 * v2 - p2 * v1)
    z1 = across * (rhs[4] * v2 - rhs[5] * p2)
    z2 = across * (rhs[5] * p1 - rhs[4] * v1)
    return math.sqrt(x0 * x0 + x1 * x1 + z1 * z1), math.sqrt(x2 * x2 + x3 * x3 + z2 * z2)


@inner_kernel
def _project(
    rv: _Array, dv1: _Array, dv2: _Array, tof: float, mu: float, rhs: _Array
) -> tuple[_Orbit, _Effect]:
    """Write the impulses' effect at epoch 0, in the arc's plane and across it; return the arc.

    In the plane and across it, motion is independent to first order. Parameters as for
    `mima2_acceleration`, `rhs` as for `_accelerations`.

    Returns
    -------
    orbit : tuple of float
        The arc at departure.
    end : tuple of float
        `_plane_stm` at arrival.
    """
    r0 = math.sqrt(rv[0] * rv[0] + rv[1] * rv[1] + rv[2] * rv[2])
    x, y, z = rv[0] / r0, rv[1] / r0, rv[2] / r0
    vr = x * rv[3] + y * rv[4] + z * rv[5]
    tx, ty, tz = rv[3] - vr * x, rv[4] - vr * y, rv[5] - vr * z
    vt = math.sqrt(tx * tx + ty * ty + tz * tz)
    tx, ty, tz = tx / vt, ty / vt, tz / vt
    hx, hy, hz = y * tz - z * ty, z * tx - x * tz, x * ty - y * tx
    orbit = (r0, vr, vt, 2.0 * mu / r0 - vr * vr - vt * vt)
    end = _plane_stm(tof, orbit, mu, tof)
    u = x * dv2[0] + y * dv2[1] + z * dv2[2]
    v = tx * dv2[0] + ty * dv2[1] + tz * dv2[2]
    w = hx * dv2[0] + hy * dv2[1] + hz * dv2[2]
    rhs[0] = end[0] * u + end[1] * v
    rhs[1] = end[2] * u + end[3] * v
    rhs[2] = end[4] * u + end[5] * v + x * dv1[0] + y * dv1[1] + z * dv1[2]
    rhs[3] = end[6] * u + end[7] * v + tx * dv1[0] + ty * dv1[1] + tz * dv1[2]
    rhs[4] = end[8] * w
    rhs[5] = end[9] * w + hx * dv1[0] + hy * dv1[1] + hz * dv1[2]
    return orbit, end


@inner_kernel
def mima2_acceleration(
    rv: _Array,
    dv1: _Array,
    dv2: _Array,
    tof: float,
    mu: float,
    rhs: _Array,
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
    rhs : (6,) float64
        Overwritten.

    Returns
    -------
    float
        NaN where the search meets a singular system.
    """
    orbit, end = _project(rv, dv1, dv2, tof, mu, rhs)
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
        a1, a2 = _accelerations(x, orbit, tof, mu, rhs, end)
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
                a = mima2_acceleration(rv, dv1, dv2, tof[i], mu, rhs)
            else:
                a, _ = mima_acceleration(dv1, dv2, tof[i])
            out[i, b] = mass_from_acceleration(a, tof[i], thrust[i], exhaust_velocity[i])
    return out
