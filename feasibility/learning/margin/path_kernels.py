"""The smallest acceleration of a leg, estimated along a path through element space.

A leg is looked at in the equinoctial elements x = (n, ex, ey, h, k, l) of
`feasibility.sims_flanagan.fast_element_kernels`: mean motion, eccentricity and
inclination vectors, mean longitude. Only thrust changes the first five, and the
sixth grows by n dt. So for impulses u_i at the centres t_i of s segments

    sum_i C_i u_i = d,   C_i = B(x_i) with the row of l enlarged by (T - t_i) times that of n,
    d = (x_arr - x_dep; in l: the longitude to arrive at, minus l_dep + n_dep T),

where B is Gauss's matrix (Battin 1999, "An Introduction to the Mathematics and Methods of
Astrodynamics", section 10.2, rewritten for mean longitude and mean motion) on a path x(t)
that leads from one orbit to the other. Nothing is singular at transfer angles of 0 or 180
degrees, and every number of revolutions is a case of its own.

The smallest z for which impulses |u_i| <= z c_i exist (c_i = m_0 / m_i, as the spacecraft
gets lighter) is the largest value over p of

    p . d / sum_i c_i |C_i^T p|,

approached by reweighted least squares: p <- (sum_i w_i C_i C_i^T)^-1 d with
w_i = c_i / |C_i^T p| from the last p. Its impulses u_i = w_i C_i^T p close the path exactly;
adding them up gives a better path, on which all is repeated.

Units: gravitational parameter and semi-major axis of the departure orbit are 1.
"""

import math

import numpy as np
from numpy.typing import NDArray

from feasibility.jit import kernel

_Array = NDArray[np.float64]
PathWork = tuple[_Array, _Array, _Array, _Array, _Array, _Array, _Array, _Array]

N_NODES = 20
"""Segments, as many as the legs have whose maximum initial mass is to be estimated."""

SATURATED = 1e3
"""Stands for an impulse of a segment that is beyond all use, or cannot be estimated."""

_TWO_PI = 2.0 * math.pi
_LEAST_MOTION = 0.15
_LARGEST_ECCENTRICITY2 = 0.9**2


@kernel
def turned(s: float, c: float, change: float) -> tuple[float, float]:
    """Return sine and cosine of an angle that was changed: by their series where it suffices."""
    if abs(change) < 0.3:
        z = change * change
        sine = change * (1.0 - z / 6.0 * (1.0 - z / 20.0 * (1.0 - z / 42.0)))
        cosine = 1.0 - 0.5 * z * (1.0 - z / 12.0 * (1.0 - z / 30.0))
    else:
        sine = math.sin(change)
        cosine = math.cos(change)
    return s * cosine + c * sine, c * cosine - s * sine


@kernel
def gauss_row(x: _Array, i: int, longitude: float, remaining: float, out: _Array) -> bool:
    """Write the 13 entries of C that are not zero, for one node; return False off the ellipses.

    Parameters
    ----------
    x : (s, 5 or more) float64
        n, ex, ey, h, k of all nodes.
    i : int
        The node.
    longitude : float
        Mean longitude.
    remaining : float
        Time to arrival.
    out : (s, 13) float64
        Effects of a radial, transverse and normal impulse: n by r and t; ex, ey by r, t
        and n; h by n; k by n; l by r, t and n.
    """
    n, ex, ey, h, k = x[i, 0], x[i, 1], x[i, 2], x[i, 3], x[i, 4]
    e2 = ex * ex + ey * ey
    if not (n > _LEAST_MOTION and e2 < _LARGEST_ECCENTRICITY2):
        return False
    eta = math.sqrt(1.0 - e2)
    b = 1.0 / (1.0 + eta)
    # Kepler's equation l = F - ex sin F + ey cos F; the derivatives vanish nowhere (e < 1).
    s = math.sin(longitude)
    c = math.cos(longitude)
    change = (ex * s - ey * c) / (1.0 - 0.8 * (ex * c + ey * s))
    f = longitude + change
    s, c = turned(s, c, change)
    for _ in range(12):
        slope = 1.0 - ex * c - ey * s
        curve = ex * s - ey * c
        gap = f - curve - longitude
        newton = gap / slope
        step = min(1.0, max(-1.0, gap / (slope - 0.5 * newton * curve)))
        f -= step
        s, c = turned(s, c, -step)
        if abs(step) < 1e-3:
            break
    root_a = 1.0 / np.cbrt(n)
    a = root_a * root_a
    r_a = 1.0 - ex * c - ey * s
    cos_l = ((1.0 - ey * ey * b) * c + ex * ey * b * s - ex) / r_a
    sin_l = ((1.0 - ex * ex * b) * s + ex * ey * b * c - ey) / r_a
    p = a * eta * eta
    r = a * r_a
    w = p / r
    sigma = ex * sin_l - ey * cos_l
    chi = h * sin_l - k * cos_l
    root = math.sqrt(p)
    over = root / w
    change_n = -3.0 * n * a / root
    n_r = change_n * sigma
    n_t = change_n * w
    out[i, 0] = n_r
    out[i, 1] = n_t
    out[i, 2] = root * sin_l
    out[i, 3] = over * ((w + 1.0) * cos_l + ex)
    out[i, 4] = -over * chi * ey
    out[i, 5] = -root * cos_l
    out[i, 6] = over * ((w + 1.0) * sin_l + ey)
    out[i, 7] = over * chi * ex
    tilt = 0.5 * over * (1.0 + h * h + k * k)
    out[i, 8] = tilt * cos_l
    out[i, 9] = tilt * sin_l
    out[i, 10] = -(p * (w - 1.0) * b + 2.0 * eta * r) / root + remaining * n_r
    out[i, 11] = (p + r) * sigma * b / root + remaining * n_t
    out[i, 12] = over * chi
    return True


@kernel
def first_path(
    x0: _Array, x1: _Array, tof: float, excess: float, least: float, nodes: int, path: _Array
) -> None:
    """Write a path of elements at the nodes that leads from x0 to x1.

    The slow elements change linearly, but for a bump 6 s (1 - s) of the mean
    motion that makes up for the longitude `excess`, and the longitude is the
    integral of the mean motion. The mean motion itself is kept above `least` of the smaller of
    both ends, so that a short leg, on which the phase alone asks for more, has a path too.
    """
    n0, n1 = x0[0], x1[0]
    bound = least * min(n0, n1)
    for i in range(nodes):
        s = (i + 0.5) / nodes
        path[i, 0] = max(n0 + (n1 - n0) * s + 6.0 * excess / tof * s * (1.0 - s), bound)
        for j in range(1, 5):
            path[i, j] = x0[j] + (x1[j] - x0[j]) * s
        path[i, 5] = x0[5] + tof * s * (n0 + 0.5 * (n1 - n0) * s) + excess * s * s * (3 - 2 * s)


@kernel
def gauss_rows(path: _Array, tof: float, nodes: int, rows: _Array) -> bool:
    """Write the rows of all nodes of a path; return False if it leaves the ellipses."""
    for i in range(nodes):
        if not gauss_row(path, i, path[i, 5], tof * (1.0 - (i + 0.5) / nodes), rows):
            return False
    return True


@kernel
def duals(rows: _Array, p: _Array, nodes: int, g: _Array) -> None:
    """Write C_i^T p and its length, (4,) a node."""
    for i in range(nodes):
        g0 = rows[i, 0] * p[0] + rows[i, 2] * p[1] + rows[i, 5] * p[2] + rows[i, 10] * p[5]
        g1 = rows[i, 1] * p[0] + rows[i, 3] * p[1] + rows[i, 6] * p[2] + rows[i, 11] * p[5]
        g2 = (
            rows[i, 4] * p[1]
            + rows[i, 7] * p[2]
            + rows[i, 8] * p[3]
            + rows[i, 9] * p[4]
            + rows[i, 12] * p[5]
        )
        g[i, 0] = g0
        g[i, 1] = g1
        g[i, 2] = g2
        g[i, 3] = math.sqrt(g0 * g0 + g1 * g1 + g2 * g2)


@kernel
def weighted_solve(
    rows: _Array, weights: _Array, d: _Array, nodes: int, m: _Array, p: _Array
) -> bool:
    """Write p with (sum_i w_i C_i C_i^T) p = d; return False if the matrix is singular.

    Parameters
    ----------
    m : (6, 6) float64
        Overwritten by the Cholesky factor.
    """
    g00 = g01 = g02 = g05 = g11 = g12 = g13 = g14 = g15 = 0.0
    g22 = g23 = g24 = g25 = g33 = g34 = g35 = g44 = g45 = g55 = 0.0
    for i in range(nodes):
        w = weights[i]
        n0, n1 = w * rows[i, 0], w * rows[i, 1]
        a0, a1, a2 = w * rows[i, 2], w * rows[i, 3], w * rows[i, 4]
        b0, b1, b2 = w * rows[i, 5], w * rows[i, 6], w * rows[i, 7]
        h2, k2, l2 = w * rows[i, 8], w * rows[i, 9], w * rows[i, 12]
        g00 += n0 * rows[i, 0] + n1 * rows[i, 1]
        g01 += n0 * rows[i, 2] + n1 * rows[i, 3]
        g02 += n0 * rows[i, 5] + n1 * rows[i, 6]
        g05 += n0 * rows[i, 10] + n1 * rows[i, 11]
        g11 += a0 * rows[i, 2] + a1 * rows[i, 3] + a2 * rows[i, 4]
        g12 += a0 * rows[i, 5] + a1 * rows[i, 6] + a2 * rows[i, 7]
        g13 += a2 * rows[i, 8]
        g14 += a2 * rows[i, 9]
        g15 += a0 * rows[i, 10] + a1 * rows[i, 11] + a2 * rows[i, 12]
        g22 += b0 * rows[i, 5] + b1 * rows[i, 6] + b2 * rows[i, 7]
        g23 += b2 * rows[i, 8]
        g24 += b2 * rows[i, 9]
        g25 += b0 * rows[i, 10] + b1 * rows[i, 11] + b2 * rows[i, 12]
        g33 += h2 * rows[i, 8]
        g34 += h2 * rows[i, 9]
        g35 += h2 * rows[i, 12]
        g44 += k2 * rows[i, 9]
        g45 += k2 * rows[i, 12]
        g55 += w * (rows[i, 10] * rows[i, 10] + rows[i, 11] * rows[i, 11]) + l2 * rows[i, 12]
    m[0, 0], m[1, 0], m[2, 0], m[3, 0], m[4, 0], m[5, 0] = g00, g01, g02, 0.0, 0.0, g05
    m[1, 1], m[2, 1], m[3, 1], m[4, 1], m[5, 1] = g11, g12, g13, g14, g15
    m[2, 2], m[3, 2], m[4, 2], m[5, 2] = g22, g23, g24, g25
    m[3, 3], m[4, 3], m[5, 3] = g33, g34, g35
    m[4, 4], m[5, 4] = g44, g45
    m[5, 5] = g55
    for i in range(6):
        for j in range(i + 1):
            total = m[i, j]
            for q in range(j):
                total -= m[i, q] * m[j, q]
            if i == j:
                if not total > 1e-14 * m[i, i]:
                    return False
                m[i, i] = math.sqrt(total)
            else:
                m[i, j] = total / m[j, j]
    for i in range(6):
        total = d[i]
        for q in range(i):
            total -= m[i, q] * p[q]
        p[i] = total / m[i, i]
    for i in range(5, -1, -1):
        total = p[i]
        for q in range(i + 1, 6):
            total -= m[q, i] * p[q]
        p[i] = total / m[i, i]
    return True


@kernel
def spent_segments(i: int, nodes: int) -> int:
    """Return after how many segments' propellant the mass counts for segment i.

    pykep's leg takes the mass before the impulse in the first half and after it in the second.
    """
    return i if 2 * i < nodes else i + 1


@kernel
def balanced_impulse(
    value: float, g: _Array, exhaust_velocity: float, nodes: int, c: _Array
) -> float:
    """Return z with z sum_i c_i(z) |g_i| = value, and write c_i = m_0 / m_i.

    m_i = m_0 (1 - z k_i / v_e) after k_i segments at full thrust, to first order in one
    segment's propellant. The left side grows without bound as z approaches v_e / nodes,
    where nothing is left of the spacecraft, so there is one solution: Newton from below.
    """
    total = 0.0
    for i in range(nodes):
        total += g[i, 3]
    largest = (1.0 - 1e-3) * exhaust_velocity / nodes
    # With every mass the initial one z is too large, with every mass the final one too small.
    z = value / total
    z = min(z / (1.0 + z * nodes / exhaust_velocity), largest)
    for _ in range(6):
        total = 0.0
        slope = 0.0
        for i in range(nodes):
            ratio = 1.0 / (1.0 - z * spent_segments(i, nodes) / exhaust_velocity)
            c[i] = ratio
            total += ratio * g[i, 3]
            slope += ratio * ratio * g[i, 3]
        gap = value - z * total
        if abs(gap) <= 1e-6 * value or z >= largest:
            break
        z = min(z + gap / slope, largest)
    return z


@kernel
def smallest_impulse(
    rows: _Array,
    d: _Array,
    exhaust_velocity: float,
    z: float,
    nodes: int,
    steps: int,
    p: _Array,
    weights: _Array,
    g: _Array,
    c: _Array,
    m: _Array,
) -> float:
    """Return z: the least impulse of the first segment with which the path can be followed.

    Begins with `p` and `c` of another path, from scratch where z is 0. 0 where
    the problem is singular. `weights` and `g` hold the impulses w_i g_i afterwards.
    """
    if z == 0.0:
        for i in range(nodes):
            weights[i] = 1.0
            c[i] = 1.0
    else:
        duals(rows, p, nodes, g)
        reweight(g, c, nodes, weights)
    for step in range(steps):
        if not weighted_solve(rows, weights, d, nodes, m, p):
            return 0.0
        duals(rows, p, nodes, g)
        value = 0.0
        for j in range(6):
            value += p[j] * d[j]
        if not value > 0.0:
            return 0.0
        z = balanced_impulse(value, g, exhaust_velocity, nodes, c)
        if step < steps - 1:
            reweight(g, c, nodes, weights)
    return z


@kernel
def reweight(g: _Array, c: _Array, nodes: int, weights: _Array) -> None:
    """Write weights c_i / |g_i|, bounded where a dual nearly vanishes."""
    mean = 0.0
    for i in range(nodes):
        mean += g[i, 3]
    least = 0.02 * mean / nodes
    for i in range(nodes):
        weights[i] = c[i] / max(g[i, 3], least)


@kernel
def flown_path(
    x0: _Array, rows: _Array, weights: _Array, g: _Array, tof: float, nodes: int, path: _Array
) -> None:
    """Write the elements at the nodes that the impulses w_i g_i lead to, half of its own each."""
    dt = tof / nodes
    n, ex, ey, h, k = x0[0], x0[1], x0[2], x0[3], x0[4]
    longitude = x0[5] + 0.5 * n * dt
    for i in range(nodes):
        w = 0.5 * weights[i]
        r, t, o = w * g[i, 0], w * g[i, 1], w * g[i, 2]
        remaining = tof - (i + 0.5) * dt
        dn = rows[i, 0] * r + rows[i, 1] * t
        dex = rows[i, 2] * r + rows[i, 3] * t + rows[i, 4] * o
        dey = rows[i, 5] * r + rows[i, 6] * t + rows[i, 7] * o
        dh = rows[i, 8] * o
        dk = rows[i, 9] * o
        dl = rows[i, 10] * r + rows[i, 11] * t + rows[i, 12] * o - remaining * dn
        path[i, 0] = n + dn
        path[i, 1] = ex + dex
        path[i, 2] = ey + dey
        path[i, 3] = h + dh
        path[i, 4] = k + dk
        path[i, 5] = longitude + dl
        n += 2.0 * dn
        ex += 2.0 * dex
        ey += 2.0 * dey
        h += 2.0 * dh
        k += 2.0 * dk
        longitude += 2.0 * dl + n * dt


@kernel
def workspace() -> PathWork:
    """Return scratch arrays: path, rows, p, weights, g, c, m, d."""
    return (
        np.empty((N_NODES, 6)),
        np.empty((N_NODES, 13)),
        np.empty(6),
        np.empty(N_NODES),
        np.empty((N_NODES, 4)),
        np.empty(N_NODES),
        np.empty((6, 6)),
        np.empty(6),
    )
