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

from feasibility.classifier.margin.lanes.math_kernels import inverse_cube_root, sine_cosine
from feasibility.runtime.jit import inner_kernel, kernel, lane_function, summing_kernel

_Array = NDArray[np.float64]
PathWork = tuple[_Array, _Array, _Array, _Array, _Array, _Array, _Array, _Array]

N_NODES = 20
"""Segments, as many as the legs have whose maximum initial mass is to be estimated."""

STRIDE = 24
"""Places for the nodes of a path in an array: a multiple of what vectors hold."""

SATURATED = 1e3
"""Stands for an impulse of a segment that is beyond all use, or cannot be estimated."""

_LEAST_MOTION = 0.15
_LARGEST_ECCENTRICITY2 = 0.9**2
_SINGULAR = 1e-14


@lane_function
def whole_vectors(nodes: int) -> int:
    """Return how many nodes fill vectors of eight, so that a loop over them has no rest."""
    return min((nodes + 7) >> 3, STRIDE >> 3) << 3


@summing_kernel
def impulse_effects(path: _Array, nodes: int, rows: _Array, anomaly: _Array) -> bool:
    """Write the 13 entries of C that are not zero, for each node; return False off the ellipses.

    One loop for each step of the way, as the compiler makes vectors of short loops alone.

    Parameters
    ----------
    path : (6 STRIDE,) float64
        n, ex, ey, h, k and mean longitude of the nodes.
    nodes : int
        How many there are.
    rows : (13 STRIDE,) float64
        Overwritten by the effects of a radial, transverse and normal impulse: n by r and t;
        ex, ey by r, t and n; h by n; k by n; l by r, t and n.
    anomaly : (6 STRIDE,) float64
        First the time that remains to arrival, the rest is scratch.
    """
    padded = whole_vectors(nodes)
    for i in range(nodes, padded):
        for j in range(6):
            path[j * STRIDE + i] = path[j * STRIDE]
        anomaly[i] = anomaly[0]
    for i in range(padded):
        ex, ey = path[STRIDE + i], path[2 * STRIDE + i]
        if not (path[i] > _LEAST_MOTION and ex * ex + ey * ey < _LARGEST_ECCENTRICITY2):
            return False
    for i in range(padded):
        anomaly[STRIDE + i] = inverse_cube_root(path[i])
    # Kepler's equation l = F - ex sin F + ey cos F; the derivatives vanish nowhere (e < 1).
    for i in range(padded):
        ex, ey, longitude = path[STRIDE + i], path[2 * STRIDE + i], path[5 * STRIDE + i]
        s, c = sine_cosine(longitude)
        # Halley's step from the mean longitude: mostly one more is enough.
        slope, curve = 1.0 - ex * c - ey * s, ex * s - ey * c
        anomaly[2 * STRIDE + i] = longitude + curve / (slope + 0.5 * curve * curve / slope)
    for i in range(padded):
        s, c = sine_cosine(anomaly[2 * STRIDE + i])
        anomaly[3 * STRIDE + i] = s
        anomaly[4 * STRIDE + i] = c
    for _ in range(12):
        for i in range(padded):
            ex, ey = path[STRIDE + i], path[2 * STRIDE + i]
            s, c = anomaly[3 * STRIDE + i], anomaly[4 * STRIDE + i]
            slope = 1.0 - ex * c - ey * s
            curve = ex * s - ey * c
            gap = anomaly[2 * STRIDE + i] - curve - path[5 * STRIDE + i]
            newton = gap / slope
            step = min(1.0, max(-1.0, gap / (slope - 0.5 * newton * curve)))
            anomaly[2 * STRIDE + i] -= step
            anomaly[5 * STRIDE + i] = step
        for i in range(padded):
            s, c = sine_cosine(anomaly[2 * STRIDE + i])
            anomaly[3 * STRIDE + i] = s
            anomaly[4 * STRIDE + i] = c
        largest = 0.0
        for i in range(padded):
            largest = max(largest, abs(anomaly[5 * STRIDE + i]))
        if largest < 1e-3:
            break
    for i in range(padded):
        n, ex, ey = path[i], path[STRIDE + i], path[2 * STRIDE + i]
        h, k = path[3 * STRIDE + i], path[4 * STRIDE + i]
        remaining, root_a = anomaly[i], anomaly[STRIDE + i]
        s, c = anomaly[3 * STRIDE + i], anomaly[4 * STRIDE + i]
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
        rows[STRIDE + i] = n_t
        rows[2 * STRIDE + i] = root * sin_l
        rows[3 * STRIDE + i] = over * ((w + 1.0) * cos_l + ex)
        rows[4 * STRIDE + i] = -over * chi * ey
        rows[5 * STRIDE + i] = -root * cos_l
        rows[6 * STRIDE + i] = over * ((w + 1.0) * sin_l + ey)
        rows[7 * STRIDE + i] = over * chi * ex
        tilt = 0.5 * over * (1.0 + h * h + k * k)
        rows[8 * STRIDE + i] = tilt * cos_l
        rows[9 * STRIDE + i] = tilt * sin_l
        rows[10 * STRIDE + i] = -(p * (w - 1.0) * b + 2.0 * eta * r) / root + remaining * n_r
        rows[11 * STRIDE + i] = (p + r) * sigma * b / root + remaining * n_t
        rows[12 * STRIDE + i] = over * chi
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
    for i in range(min(nodes, STRIDE)):
        s = (i + 0.5) / nodes
        path[i] = max(n0 + (n1 - n0) * s + 6.0 * excess / tof * s * (1.0 - s), bound)
        for j in range(1, 5):
            path[j * STRIDE + i] = x0[j] + (x1[j] - x0[j]) * s
        path[5 * STRIDE + i] = (
            x0[5] + tof * s * (n0 + 0.5 * (n1 - n0) * s) + excess * s * s * (3 - 2 * s)
        )


@inner_kernel
def gauss_rows(path: _Array, tof: float, nodes: int, rows: _Array, anomaly: _Array) -> bool:
    """Write the rows of all nodes of a path; return False if it leaves the ellipses."""
    for i in range(min(nodes, STRIDE)):
        anomaly[i] = tof * (1.0 - (i + 0.5) / nodes)
    return impulse_effects(path, nodes, rows, anomaly)


@inner_kernel
def duals(rows: _Array, p: _Array, nodes: int, g: _Array) -> None:
    """Write C_i^T p and its length, (4,) a node."""
    padded = whole_vectors(nodes)
    for i in range(padded):
        g0 = (
            rows[i] * p[0]
            + rows[2 * STRIDE + i] * p[1]
            + rows[5 * STRIDE + i] * p[2]
            + rows[10 * STRIDE + i] * p[5]
        )
        g1 = (
            rows[STRIDE + i] * p[0]
            + rows[3 * STRIDE + i] * p[1]
            + rows[6 * STRIDE + i] * p[2]
            + rows[11 * STRIDE + i] * p[5]
        )
        g2 = (
            rows[4 * STRIDE + i] * p[1]
            + rows[7 * STRIDE + i] * p[2]
            + rows[8 * STRIDE + i] * p[3]
            + rows[9 * STRIDE + i] * p[4]
            + rows[12 * STRIDE + i] * p[5]
        )
        g[i] = g0
        g[STRIDE + i] = g1
        g[2 * STRIDE + i] = g2
        g[3 * STRIDE + i] = math.sqrt(g0 * g0 + g1 * g1 + g2 * g2)


@summing_kernel
def weighted_solve(rows: _Array, weights: _Array, d: _Array, nodes: int, p: _Array) -> bool:
    """Write p with (sum_i w_i C_i C_i^T) p = d; return False if the matrix is singular."""
    g00 = g01 = g02 = g05 = g11 = g12 = g13 = g14 = g15 = 0.0
    g22 = g23 = g24 = g25 = g33 = g34 = g35 = g44 = g45 = g55 = 0.0
    padded = whole_vectors(nodes)
    for i in range(nodes, padded):
        weights[i] = 0.0
    for i in range(padded):
        w = weights[i]
        n0, n1 = w * rows[i], w * rows[STRIDE + i]
        a0, a1, a2 = (
            w * rows[2 * STRIDE + i],
            w * rows[3 * STRIDE + i],
            w * rows[4 * STRIDE + i],
        )
        b0, b1, b2 = (
            w * rows[5 * STRIDE + i],
            w * rows[6 * STRIDE + i],
            w * rows[7 * STRIDE + i],
        )
        h2, k2, l2 = (
            w * rows[8 * STRIDE + i],
            w * rows[9 * STRIDE + i],
            w * rows[12 * STRIDE + i],
        )
        g00 += n0 * rows[i] + n1 * rows[STRIDE + i]
        g01 += n0 * rows[2 * STRIDE + i] + n1 * rows[3 * STRIDE + i]
        g02 += n0 * rows[5 * STRIDE + i] + n1 * rows[6 * STRIDE + i]
        g05 += n0 * rows[10 * STRIDE + i] + n1 * rows[11 * STRIDE + i]
        g11 += a0 * rows[2 * STRIDE + i] + a1 * rows[3 * STRIDE + i] + a2 * rows[4 * STRIDE + i]
        g12 += a0 * rows[5 * STRIDE + i] + a1 * rows[6 * STRIDE + i] + a2 * rows[7 * STRIDE + i]
        g13 += a2 * rows[8 * STRIDE + i]
        g14 += a2 * rows[9 * STRIDE + i]
        g15 += a0 * rows[10 * STRIDE + i] + a1 * rows[11 * STRIDE + i] + a2 * rows[12 * STRIDE + i]
        g22 += b0 * rows[5 * STRIDE + i] + b1 * rows[6 * STRIDE + i] + b2 * rows[7 * STRIDE + i]
        g23 += b2 * rows[8 * STRIDE + i]
        g24 += b2 * rows[9 * STRIDE + i]
        g25 += b0 * rows[10 * STRIDE + i] + b1 * rows[11 * STRIDE + i] + b2 * rows[12 * STRIDE + i]
        g33 += h2 * rows[8 * STRIDE + i]
        g34 += h2 * rows[9 * STRIDE + i]
        g35 += h2 * rows[12 * STRIDE + i]
        g44 += k2 * rows[9 * STRIDE + i]
        g45 += k2 * rows[12 * STRIDE + i]
        g55 += (
            w
            * (
                rows[10 * STRIDE + i] * rows[10 * STRIDE + i]
                + rows[11 * STRIDE + i] * rows[11 * STRIDE + i]
            )
            + l2 * rows[12 * STRIDE + i]
        )
    # L D L^T, written out, as roots would be waited for; n is bound up with neither h nor k.
    i0 = 1.0 / g00
    l10, l20, l50 = g01 * i0, g02 * i0, g05 * i0
    rest1 = g11 - l10 * g01
    i1 = 1.0 / rest1
    m21, m51 = g12 - l20 * g01, g15 - l50 * g01
    l21, l31, l41, l51 = m21 * i1, g13 * i1, g14 * i1, m51 * i1
    rest2 = g22 - l20 * g02 - l21 * m21
    i2 = 1.0 / rest2
    m32, m42 = g23 - l31 * m21, g24 - l41 * m21
    m52 = g25 - l50 * g02 - l51 * m21
    l32, l42, l52 = m32 * i2, m42 * i2, m52 * i2
    rest3 = g33 - l31 * g13 - l32 * m32
    i3 = 1.0 / rest3
    m43, m53 = g34 - l41 * g13 - l42 * m32, g35 - l51 * g13 - l52 * m32
    l43, l53 = m43 * i3, m53 * i3
    rest4 = g44 - l41 * g14 - l42 * m42 - l43 * m43
    i4 = 1.0 / rest4
    m54 = g45 - l51 * g14 - l52 * m42 - l53 * m43
    l54 = m54 * i4
    rest5 = g55 - l50 * g05 - l51 * m51 - l52 * m52 - l53 * m53 - l54 * m54
    i5 = 1.0 / rest5
    if not (
        g00 > 0.0
        and rest1 > _SINGULAR * g11
        and rest2 > _SINGULAR * g22
        and rest3 > _SINGULAR * g33
        and rest4 > _SINGULAR * g44
        and rest5 > _SINGULAR * g55
    ):
        return False
    p0 = d[0]
    p1 = d[1] - l10 * p0
    p2 = d[2] - l20 * p0 - l21 * p1
    p3 = d[3] - l31 * p1 - l32 * p2
    p4 = d[4] - l41 * p1 - l42 * p2 - l43 * p3
    p5 = (d[5] - l50 * p0 - l51 * p1 - l52 * p2 - l53 * p3 - l54 * p4) * i5
    p4 = p4 * i4 - l54 * p5
    p3 = p3 * i3 - l43 * p4 - l53 * p5
    p2 = p2 * i2 - l32 * p3 - l42 * p4 - l52 * p5
    p1 = p1 * i1 - l21 * p2 - l31 * p3 - l41 * p4 - l51 * p5
    p0 = p0 * i0 - l10 * p1 - l20 * p2 - l50 * p5
    p[0], p[1], p[2], p[3], p[4], p[5] = p0, p1, p2, p3, p4, p5
    return True


@kernel
def spent_segments(i: int, nodes: int) -> int:
    """Return after how many segments' propellant the mass counts for segment i.

    pykep's leg takes the mass before the impulse in the first half and after it in the second.
    """
    return i if 2 * i < nodes else i + 1


@lane_function
def spent_before(i: int, nodes: int) -> float:
    """Return `spent_segments`, and of nodes that fill a vector no more than of the last one."""
    return min(float(i) + (0.0 if 2 * i < nodes else 1.0), float(nodes))


@summing_kernel
def balanced_impulse(
    value: float, g: _Array, exhaust_velocity: float, nodes: int, c: _Array
) -> float:
    """Return z with z sum_i c_i(z) |g_i| = value, and write c_i = m_0 / m_i.

    m_i = m_0 (1 - z k_i / v_e) after k_i segments at full thrust, to first order in one
    segment's propellant. The left side grows without bound as z approaches v_e / nodes,
    where nothing is left of the spacecraft, so there is one solution, by Newton's method.
    """
    padded = whole_vectors(nodes)
    total, late = 0.0, 0.0
    for i in range(padded):
        dual = g[3 * STRIDE + i] if i < nodes else 0.0
        total += dual
        late += spent_before(i, nodes) * dual
    largest = (1.0 - 1e-3) * exhaust_velocity / nodes
    # As if all propellant were spent at once, at the mean time: nearly right, and a bit too much.
    # As if at once at the start it is too little, from where Newton never fails.
    least = value / total
    z = exhaust_velocity * least / (exhaust_velocity + late * least / total)
    if not z * nodes < 0.5 * exhaust_velocity:
        z = min(least / (1.0 + least * nodes / exhaust_velocity), largest)
    for _ in range(6):
        total = 0.0
        slope = 0.0
        used = z / exhaust_velocity
        for i in range(padded):
            dual = g[3 * STRIDE + i] if i < nodes else 0.0
            ratio = 1.0 / (1.0 - used * spent_before(i, nodes))
            c[i] = ratio
            total += ratio * dual
            slope += ratio * ratio * dual
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
) -> float:
    """Return z: the least impulse of the first segment with which the path can be followed.

    Begins with `p` and `c` of another path, from scratch where z is 0. 0 where
    the problem is singular. `weights` and `g` hold the impulses w_i g_i afterwards.
    """
    if z == 0.0:
        for i in range(min(nodes, STRIDE)):
            weights[i] = 1.0
            c[i] = 1.0
    else:
        duals(rows, p, nodes, g)
        reweight(g, c, nodes, weights)
    for step in range(steps):
        if not weighted_solve(rows, weights, d, nodes, p):
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
    for i in range(min(nodes, STRIDE)):
        mean += g[3 * STRIDE + i]
    least = 0.02 * mean / nodes
    for i in range(min(nodes, STRIDE)):
        weights[i] = c[i] / max(g[3 * STRIDE + i], least)


@inner_kernel
def flown_path(
    x0: _Array, rows: _Array, weights: _Array, g: _Array, tof: float, nodes: int, path: _Array
) -> None:
    """Write the elements at the nodes that the impulses w_i g_i lead to, half of its own each."""
    dt = tof / nodes
    n, ex, ey, h, k = x0[0], x0[1], x0[2], x0[3], x0[4]
    longitude = x0[5] + 0.5 * n * dt
    for i in range(min(nodes, STRIDE)):
        w = 0.5 * weights[i]
        r, t, o = w * g[i], w * g[STRIDE + i], w * g[2 * STRIDE + i]
        remaining = tof - (i + 0.5) * dt
        dn = rows[i] * r + rows[STRIDE + i] * t
        dex = rows[2 * STRIDE + i] * r + rows[3 * STRIDE + i] * t + rows[4 * STRIDE + i] * o
        dey = rows[5 * STRIDE + i] * r + rows[6 * STRIDE + i] * t + rows[7 * STRIDE + i] * o
        dh = rows[8 * STRIDE + i] * o
        dk = rows[9 * STRIDE + i] * o
        dl = (
            rows[10 * STRIDE + i] * r
            + rows[11 * STRIDE + i] * t
            + rows[12 * STRIDE + i] * o
            - remaining * dn
        )
        path[i] = n + dn
        path[STRIDE + i] = ex + dex
        path[2 * STRIDE + i] = ey + dey
        path[3 * STRIDE + i] = h + dh
        path[4 * STRIDE + i] = k + dk
        path[5 * STRIDE + i] = longitude + dl
        n += 2.0 * dn
        ex += 2.0 * dex
        ey += 2.0 * dey
        h += 2.0 * dh
        k += 2.0 * dk
        longitude += 2.0 * dl + n * dt


@inner_kernel
def workspace() -> PathWork:
    """Return scratch arrays: path, rows, p, weights, g, c, d, anomaly."""
    return (
        np.empty(6 * STRIDE),
        np.empty(13 * STRIDE),
        np.empty(6),
        np.zeros(STRIDE),
        np.zeros(4 * STRIDE),
        np.zeros(STRIDE),
        np.empty(6),
        np.empty(6 * STRIDE),
    )
