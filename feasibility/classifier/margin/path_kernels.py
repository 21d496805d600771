"""The smallest acceleration of a leg, estimated along a path through element space.

A leg is looked at in the equinoctial elements x = (n, ex, ey, h, k, l) of
`feasibility.sims_flanagan.fast.element_kernels`: mean motion, eccentricity and
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

from feasibility.classifier.margin.lanes.math_kernels import inverse_cube_root
from feasibility.runtime.jit import inner_kernel, kernel, lane_function, summing_kernel

_Array = NDArray[np.float64]
PathWork = tuple[_Array, _Array, _Array, _Array, _Array, _Array, _Array, _Array, _Array]

N_NODES = 20
"""Segments, as many as the legs have whose maximum initial mass is to be estimated."""

SATURATED = 1e3
"""Stands for an impulse of a segment that is beyond all use, or cannot be estimated."""

_TWO_OVER_PI = 2.0 / math.pi
_HALF_PI_HEAD = 1.5707963267341256
_HALF_PI_TAIL = 6.077100506506192e-11
_ROUND = 1.5 * 2.0**52
_LEAST_MOTION = 0.15
_LARGEST_ECCENTRICITY2 = 0.9**2


@lane_function
def sine_cosine(x: float) -> tuple[float, float]:
    """Return sine and cosine to 1e-13, in arithmetic alone, so that a loop becomes vectors.

    Series about the nearest multiple of a right angle, whose last bits Cody and Waite's two
    parts of pi / 2 keep; adding and subtracting _ROUND rounds to a whole number.
    """
    quarter = (x * _TWO_OVER_PI + _ROUND) - _ROUND
    r = (x - quarter * _HALF_PI_HEAD) - quarter * _HALF_PI_TAIL
    z = r * r
    s = 1.0 / 362880.0 - z * (1.0 / 39916800.0 - z * (1.0 / 6227020800.0))
    s = r * (1.0 - z * (1.0 / 6.0 - z * (1.0 / 120.0 - z * (1.0 / 5040.0 - z * s))))
    c = 1.0 / 40320.0 - z * (1.0 / 3628800.0 - z * (1.0 / 479001600.0))
    c = 1.0 - z * (0.5 - z * (1.0 / 24.0 - z * (1.0 / 720.0 - z * c)))
    # Which quarter, from -2 to 2.
    place = quarter - 4.0 * ((0.25 * quarter + _ROUND) - _ROUND)
    odd = abs(place) == 1.0
    sine = c if odd else s
    cosine = s if odd else c
    # Of five places these have the signs turned: sine -2, -1, 2; cosine -2, 1, 2.
    sine = -sine if abs(place - 0.25) > 1.0 else sine
    cosine = -cosine if abs(place + 0.25) > 1.0 else cosine
    return sine, cosine


@kernel
def impulse_effects(path: _Array, nodes: int, rows: _Array, anomaly: _Array) -> bool:
    """Write the 13 entries of C that are not zero, for each node; return False off the ellipses.

    One loop for each step of the way, as the compiler makes vectors of short loops alone.

    Parameters
    ----------
    path : (6 N_NODES,) float64
        n, ex, ey, h, k and mean longitude of the nodes.
    nodes : int
        How many there are.
    rows : (13 N_NODES,) float64
        Overwritten by the effects of a radial, transverse and normal impulse: n by r and t;
        ex, ey by r, t and n; h by n; k by n; l by r, t and n.
    anomaly : (6 N_NODES,) float64
        First the time that remains to arrival, the rest is scratch.
    """
    for i in range(min(nodes, N_NODES)):
        ex, ey = path[N_NODES + i], path[2 * N_NODES + i]
        if not (path[i] > _LEAST_MOTION and ex * ex + ey * ey < _LARGEST_ECCENTRICITY2):
            return False
    for i in range(min(nodes, N_NODES)):
        anomaly[N_NODES + i] = inverse_cube_root(path[i])
    # Kepler's equation l = F - ex sin F + ey cos F; the derivatives vanish nowhere (e < 1).
    for i in range(min(nodes, N_NODES)):
        ex, ey, longitude = path[N_NODES + i], path[2 * N_NODES + i], path[5 * N_NODES + i]
        s, c = sine_cosine(longitude)
        # Halley's step from the mean longitude: mostly one more is enough.
        slope, curve = 1.0 - ex * c - ey * s, ex * s - ey * c
        anomaly[2 * N_NODES + i] = longitude + curve / (slope + 0.5 * curve * curve / slope)
    for i in range(min(nodes, N_NODES)):
        s, c = sine_cosine(anomaly[2 * N_NODES + i])
        anomaly[3 * N_NODES + i] = s
        anomaly[4 * N_NODES + i] = c
    for _ in range(12):
        for i in range(min(nodes, N_NODES)):
            ex, ey = path[N_NODES + i], path[2 * N_NODES + i]
            s, c = anomaly[3 * N_NODES + i], anomaly[4 * N_NODES + i]
            slope = 1.0 - ex * c - ey * s
            curve = ex * s - ey * c
            gap = anomaly[2 * N_NODES + i] - curve - path[5 * N_NODES + i]
            newton = gap / slope
            step = min(1.0, max(-1.0, gap / (slope - 0.5 * newton * curve)))
            anomaly[2 * N_NODES + i] -= step
            anomaly[5 * N_NODES + i] = step
        for i in range(min(nodes, N_NODES)):
            s, c = sine_cosine(anomaly[2 * N_NODES + i])
            anomaly[3 * N_NODES + i] = s
            anomaly[4 * N_NODES + i] = c
        largest = 0.0
        for i in range(min(nodes, N_NODES)):
            largest = max(largest, abs(anomaly[5 * N_NODES + i]))
        if largest < 1e-3:
            break
    for i in range(min(nodes, N_NODES)):
        n, ex, ey = path[i], path[N_NODES + i], path[2 * N_NODES + i]
        h, k = path[3 * N_NODES + i], path[4 * N_NODES + i]
        remaining, root_a = anomaly[i], anomaly[N_NODES + i]
        s, c = anomaly[3 * N_NODES + i], anomaly[4 * N_NODES + i]
        eta = math.sqrt(1.0 - ex * ex - ey * ey)
        b = 1.0 / (1.0 + eta)
        a = root_a * root_a
        r_a = 1.0 - ex * c - ey * s
        cos_l = ((1.0 - ey * ey * b) * c + ex * ey * b * s - ex) / r_a
        sin_l = ((1.0 - ex * ex * b) * s + ex * ey * b * c - ey) / r_a
        p = a * eta * eta
        r = a * r_a
        w = p / r
        sigma = ex * sin_l - ey * cos_l
        chi = h * sin_l - k * cos_l
        root = root_a * eta
        over = root / w
        change_n = -3.0 * n * a / root
        n_r = change_n * sigma
        n_t = change_n * w
        rows[i] = n_r
        rows[N_NODES + i] = n_t
        rows[2 * N_NODES + i] = root * sin_l
        rows[3 * N_NODES + i] = over * ((w + 1.0) * cos_l + ex)
        rows[4 * N_NODES + i] = -over * chi * ey
        rows[5 * N_NODES + i] = -root * cos_l
        rows[6 * N_NODES + i] = over * ((w + 1.0) * sin_l + ey)
        rows[7 * N_NODES + i] = over * chi * ex
        tilt = 0.5 * over * (1.0 + h * h + k * k)
        rows[8 * N_NODES + i] = tilt * cos_l
        rows[9 * N_NODES + i] = tilt * sin_l
        rows[10 * N_NODES + i] = -(p * (w - 1.0) * b + 2.0 * eta * r) / root + remaining * n_r
        rows[11 * N_NODES + i] = (p + r) * sigma * b / root + remaining * n_t
        rows[12 * N_NODES + i] = over * chi
    return True


@inner_kernel
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
    for i in range(min(nodes, N_NODES)):
        s = (i + 0.5) / nodes
        path[i] = max(n0 + (n1 - n0) * s + 6.0 * excess / tof * s * (1.0 - s), bound)
        for j in range(1, 5):
            path[j * N_NODES + i] = x0[j] + (x1[j] - x0[j]) * s
        path[5 * N_NODES + i] = (
            x0[5] + tof * s * (n0 + 0.5 * (n1 - n0) * s) + excess * s * s * (3 - 2 * s)
        )


@inner_kernel
def gauss_rows(path: _Array, tof: float, nodes: int, rows: _Array, anomaly: _Array) -> bool:
    """Write the rows of all nodes of a path; return False if it leaves the ellipses."""
    for i in range(min(nodes, N_NODES)):
        anomaly[i] = tof * (1.0 - (i + 0.5) / nodes)
    return impulse_effects(path, nodes, rows, anomaly)


@inner_kernel
def duals(rows: _Array, p: _Array, nodes: int, g: _Array) -> None:
    """Write C_i^T p and its length, (4,) a node."""
    for i in range(min(nodes, N_NODES)):
        g0 = (
            rows[i] * p[0]
            + rows[2 * N_NODES + i] * p[1]
            + rows[5 * N_NODES + i] * p[2]
            + rows[10 * N_NODES + i] * p[5]
        )
        g1 = (
            rows[N_NODES + i] * p[0]
            + rows[3 * N_NODES + i] * p[1]
            + rows[6 * N_NODES + i] * p[2]
            + rows[11 * N_NODES + i] * p[5]
        )
        g2 = (
            rows[4 * N_NODES + i] * p[1]
            + rows[7 * N_NODES + i] * p[2]
            + rows[8 * N_NODES + i] * p[3]
            + rows[9 * N_NODES + i] * p[4]
            + rows[12 * N_NODES + i] * p[5]
        )
        g[i] = g0
        g[N_NODES + i] = g1
        g[2 * N_NODES + i] = g2
        g[3 * N_NODES + i] = math.sqrt(g0 * g0 + g1 * g1 + g2 * g2)


@summing_kernel
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
    for i in range(min(nodes, N_NODES)):
        w = weights[i]
        n0, n1 = w * rows[i], w * rows[N_NODES + i]
        a0, a1, a2 = (
            w * rows[2 * N_NODES + i],
            w * rows[3 * N_NODES + i],
            w * rows[4 * N_NODES + i],
        )
        b0, b1, b2 = (
            w * rows[5 * N_NODES + i],
            w * rows[6 * N_NODES + i],
            w * rows[7 * N_NODES + i],
        )
        h2, k2, l2 = (
            w * rows[8 * N_NODES + i],
            w * rows[9 * N_NODES + i],
            w * rows[12 * N_NODES + i],
        )
        g00 += n0 * rows[i] + n1 * rows[N_NODES + i]
        g01 += n0 * rows[2 * N_NODES + i] + n1 * rows[3 * N_NODES + i]
        g02 += n0 * rows[5 * N_NODES + i] + n1 * rows[6 * N_NODES + i]
        g05 += n0 * rows[10 * N_NODES + i] + n1 * rows[11 * N_NODES + i]
        g11 += a0 * rows[2 * N_NODES + i] + a1 * rows[3 * N_NODES + i] + a2 * rows[4 * N_NODES + i]
        g12 += a0 * rows[5 * N_NODES + i] + a1 * rows[6 * N_NODES + i] + a2 * rows[7 * N_NODES + i]
        g13 += a2 * rows[8 * N_NODES + i]
        g14 += a2 * rows[9 * N_NODES + i]
        g15 += (
            a0 * rows[10 * N_NODES + i] + a1 * rows[11 * N_NODES + i] + a2 * rows[12 * N_NODES + i]
        )
        g22 += b0 * rows[5 * N_NODES + i] + b1 * rows[6 * N_NODES + i] + b2 * rows[7 * N_NODES + i]
        g23 += b2 * rows[8 * N_NODES + i]
        g24 += b2 * rows[9 * N_NODES + i]
        g25 += (
            b0 * rows[10 * N_NODES + i] + b1 * rows[11 * N_NODES + i] + b2 * rows[12 * N_NODES + i]
        )
        g33 += h2 * rows[8 * N_NODES + i]
        g34 += h2 * rows[9 * N_NODES + i]
        g35 += h2 * rows[12 * N_NODES + i]
        g44 += k2 * rows[9 * N_NODES + i]
        g45 += k2 * rows[12 * N_NODES + i]
        g55 += (
            w
            * (
                rows[10 * N_NODES + i] * rows[10 * N_NODES + i]
                + rows[11 * N_NODES + i] * rows[11 * N_NODES + i]
            )
            + l2 * rows[12 * N_NODES + i]
        )
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


@summing_kernel
def balanced_impulse(
    value: float, g: _Array, exhaust_velocity: float, nodes: int, c: _Array
) -> float:
    """Return z with z sum_i c_i(z) |g_i| = value, and write c_i = m_0 / m_i.

    m_i = m_0 (1 - z k_i / v_e) after k_i segments at full thrust, to first order in one
    segment's propellant. The left side grows without bound as z approaches v_e / nodes,
    where nothing is left of the spacecraft, so there is one solution: Newton from below.
    """
    total = 0.0
    for i in range(min(nodes, N_NODES)):
        total += g[3 * N_NODES + i]
    largest = (1.0 - 1e-3) * exhaust_velocity / nodes
    # With every mass the initial one z is too large, with every mass the final one too small.
    z = value / total
    z = min(z / (1.0 + z * nodes / exhaust_velocity), largest)
    for _ in range(6):
        total = 0.0
        slope = 0.0
        for i in range(min(nodes, N_NODES)):
            ratio = 1.0 / (1.0 - z * spent_segments(i, nodes) / exhaust_velocity)
            c[i] = ratio
            total += ratio * g[3 * N_NODES + i]
            slope += ratio * ratio * g[3 * N_NODES + i]
        gap = value - z * total
        if abs(gap) <= 1e-6 * value or z >= largest:
            break
        z = min(z + gap / slope, largest)
    return z


@inner_kernel
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
        for i in range(min(nodes, N_NODES)):
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


@inner_kernel
def reweight(g: _Array, c: _Array, nodes: int, weights: _Array) -> None:
    """Write weights c_i / |g_i|, bounded where a dual nearly vanishes."""
    mean = 0.0
    for i in range(min(nodes, N_NODES)):
        mean += g[3 * N_NODES + i]
    least = 0.02 * mean / nodes
    for i in range(min(nodes, N_NODES)):
        weights[i] = c[i] / max(g[3 * N_NODES + i], least)


@inner_kernel
def flown_path(
    x0: _Array, rows: _Array, weights: _Array, g: _Array, tof: float, nodes: int, path: _Array
) -> None:
    """Write the elements at the nodes that the impulses w_i g_i lead to, half of its own each."""
    dt = tof / nodes
    n, ex, ey, h, k = x0[0], x0[1], x0[2], x0[3], x0[4]
    longitude = x0[5] + 0.5 * n * dt
    for i in range(min(nodes, N_NODES)):
        w = 0.5 * weights[i]
        r, t, o = w * g[i], w * g[N_NODES + i], w * g[2 * N_NODES + i]
        remaining = tof - (i + 0.5) * dt
        dn = rows[i] * r + rows[N_NODES + i] * t
        dex = rows[2 * N_NODES + i] * r + rows[3 * N_NODES + i] * t + rows[4 * N_NODES + i] * o
        dey = rows[5 * N_NODES + i] * r + rows[6 * N_NODES + i] * t + rows[7 * N_NODES + i] * o
        dh = rows[8 * N_NODES + i] * o
        dk = rows[9 * N_NODES + i] * o
        dl = (
            rows[10 * N_NODES + i] * r
            + rows[11 * N_NODES + i] * t
            + rows[12 * N_NODES + i] * o
            - remaining * dn
        )
        path[i] = n + dn
        path[N_NODES + i] = ex + dex
        path[2 * N_NODES + i] = ey + dey
        path[3 * N_NODES + i] = h + dh
        path[4 * N_NODES + i] = k + dk
        path[5 * N_NODES + i] = longitude + dl
        n += 2.0 * dn
        ex += 2.0 * dex
        ey += 2.0 * dey
        h += 2.0 * dh
        k += 2.0 * dk
        longitude += 2.0 * dl + n * dt


@inner_kernel
def workspace() -> PathWork:
    """Return scratch arrays: path, rows, p, weights, g, c, m, d, anomaly."""
    return (
        np.empty(6 * N_NODES),
        np.empty(13 * N_NODES),
        np.empty(6),
        np.empty(N_NODES),
        np.empty(4 * N_NODES),
        np.empty(N_NODES),
        np.empty((6, 6)),
        np.empty(6),
        np.empty(6 * N_NODES),
    )
