"""The linear problem of a path through element space, of eight legs at a time.

As `feasibility.classifier.margin.path_kernels`, which says what all of it means, does for one leg.
What is out of the ordinary marks a leg as ODD: its features are then computed alone. Nothing of a
leg depends on the others: where one has converged, its numbers stay.
"""

import math

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.margin.lanes.layout_kernels import (
    ANGLE,
    COSINE,
    DONE,
    DUALS,
    GAP,
    IMPULSE,
    LANES,
    MATRIX,
    MOST,
    NEAR,
    NODES,
    ODD,
    PATH,
    RATIO,
    REMAINING,
    ROOT,
    ROWS,
    S0,
    SINE,
    SIZE,
    TOF,
    VALUE,
    VE,
    WEIGHTS,
    X0,
    X1,
    D,
    P,
    at,
)
from feasibility.classifier.margin.lanes.math_kernels import (
    atan2,
    inverse_cube_root,
    sine_cosine,
    small_sine_cosine,
)
from feasibility.classifier.margin.path_kernels import spent_segments
from feasibility.runtime.jit import lane_kernel

_Array = NDArray[np.float64]

_TWO_PI = 2.0 * math.pi
_ROUND = 1.5 * 2.0**52
_LARGEST_ECCENTRICITY2 = 0.9**2
_LEAST_MOTION = 0.15
_LEAST_OF_ENDS = 0.3
_FIRST_CORRECTION = 0.8
_CORRECTION = 0.5
_CONVERGED = 1e-3
_CORRECTIONS = 4
_BALANCE_STEPS = 6
_SINGULAR = 1e-12


@lane_kernel
def all_done(W: _Array) -> bool:
    """Return whether all legs are DONE."""
    least = 1.0
    for lane in range(LANES):
        least = min(least, W[at(DONE, lane)])
    return least > 0.0


@lane_kernel
def elements(W: _Array) -> None:
    """Write the elements X0 and X1 of the states S0 and S1; see `to_elements`."""
    for end in range(2):
        s = S0 + 6 * end
        e = X0 + 6 * end
        for lane in range(LANES):
            x, y, z = W[at(s, lane)], W[at(s + 1, lane)], W[at(s + 2, lane)]
            u, v, w = W[at(s + 3, lane)], W[at(s + 4, lane)], W[at(s + 5, lane)]
            r = 1.0 / math.sqrt(x * x + y * y + z * z)
            hx, hy, hz = y * w - z * v, z * u - x * w, x * v - y * u
            hh = math.sqrt(hx * hx + hy * hy + hz * hz)
            alpha = 2.0 * r - (u * u + v * v + w * w)
            tilt = 1.0 / (hh + hz)
            h, k = -hy * tilt, hx * tilt
            over = 1.0 / (1.0 + h * h + k * k)
            f0, f1 = (1.0 + h * h - k * k) * over, 2.0 * h * k * over
            f2 = -2.0 * k * over
            g1, g2 = (1.0 - h * h + k * k) * over, 2.0 * h * over
            cx = v * hz - w * hy - x * r
            cy = w * hx - u * hz - y * r
            cz = u * hy - v * hx - z * r
            ex = cx * f0 + cy * f1 + cz * f2
            ey = cx * f1 + cy * g1 + cz * g2
            px = x * f0 + y * f1 + z * f2
            py = x * f1 + y * g1 + z * g2
            eta2 = 1.0 - ex * ex - ey * ey
            fine = (alpha > 1e-6) & (hh + hz > 1e-6 * hh) & (eta2 > 1e-3)
            eta = math.sqrt(max(eta2, 1e-3))
            b = 1.0 / (1.0 + eta)
            scale = alpha / eta
            cos_f = ex + ((1.0 - ex * ex * b) * px - ex * ey * b * py) * scale
            sin_f = ey + ((1.0 - ey * ey * b) * py - ex * ey * b * px) * scale
            W[at(e, lane)] = alpha * math.sqrt(max(alpha, 0.0))
            W[at(e + 1, lane)] = ex
            W[at(e + 2, lane)] = ey
            W[at(e + 3, lane)] = h
            W[at(e + 4, lane)] = k
            W[at(e + 5, lane)] = atan2(sin_f, cos_f) - ex * sin_f + ey * cos_f
            W[at(ODD, lane)] = W[at(ODD, lane)] if fine else 1.0


@lane_kernel
def first_path(W: _Array) -> None:
    """Write the path of the nearest number of revolutions, D, NEAR and the arrival's longitude."""
    for lane in range(LANES):
        n0, n1, tof = W[at(X0, lane)], W[at(X1, lane)], W[at(TOF, lane)]
        mean = 0.5 * tof * (n0 + n1)
        near = W[at(X1 + 5, lane)] - W[at(X0 + 5, lane)] - mean
        near -= _TWO_PI * ((near * (1.0 / _TWO_PI) + _ROUND) - _ROUND)
        W[at(NEAR, lane)] = near
        W[at(D + 5, lane)] = mean + near - n0 * tof
        W[at(X1 + 5, lane)] = W[at(X0 + 5, lane)] + mean + near
        # Scratch: the bump of the mean motion, and its least value.
        W[at(GAP, lane)] = 6.0 * near / tof
        W[at(SIZE, lane)] = _LEAST_OF_ENDS * min(n0, n1)
        for j in range(5):
            W[at(D + j, lane)] = W[at(X1 + j, lane)] - W[at(X0 + j, lane)]
    for i in range(NODES):
        s = (i + 0.5) / NODES
        bump = s * (1.0 - s)
        turn = s * s * (3.0 - 2.0 * s)
        for lane in range(LANES):
            tof = W[at(TOF, lane)]
            n0, change = W[at(X0, lane)], W[at(D, lane)]
            n = n0 + change * s + W[at(GAP, lane)] * bump
            W[at(PATH + i, lane)] = max(n, W[at(SIZE, lane)])
            for j in range(1, 5):
                W[at(PATH + j * MOST + i, lane)] = W[at(X0 + j, lane)] + W[at(D + j, lane)] * s
            W[at(PATH + 5 * MOST + i, lane)] = (
                W[at(X0 + 5, lane)] + tof * s * (n0 + 0.5 * change * s) + W[at(NEAR, lane)] * turn
            )
            W[at(REMAINING + i, lane)] = tof * (1.0 - s)


@lane_kernel
def impulse_effects(nodes: int, W: _Array) -> None:
    """Write the ROWS of all nodes of the path."""
    for i in range(min(nodes, MOST)):
        for lane in range(LANES):
            n, ex, ey = (
                W[at(PATH + i, lane)],
                W[at(PATH + MOST + i, lane)],
                W[at(PATH + 2 * MOST + i, lane)],
            )
            longitude = W[at(PATH + 5 * MOST + i, lane)]
            s, c = sine_cosine(longitude)
            slope, curve = 1.0 - ex * c - ey * s, ex * s - ey * c
            step = curve * slope / (slope * slope + 0.5 * curve * curve)
            fine = (n > _LEAST_MOTION) & (ex * ex + ey * ey < _LARGEST_ECCENTRICITY2)
            fine &= abs(step) < _FIRST_CORRECTION
            sine, cosine = small_sine_cosine(step)
            W[at(ROOT + i, lane)] = inverse_cube_root(max(n, _LEAST_MOTION))
            W[at(ANGLE + i, lane)] = step
            W[at(SINE + i, lane)] = s * cosine + c * sine
            W[at(COSINE + i, lane)] = c * cosine - s * sine
            W[at(ODD, lane)] = W[at(ODD, lane)] if fine else 1.0
    for lane in range(LANES):
        W[at(DONE, lane)] = W[at(ODD, lane)]
    for _ in range(_CORRECTIONS):
        correct(nodes, W)
        if all_done(W):
            break
    for lane in range(LANES):
        W[at(ODD, lane)] = W[at(ODD, lane)] if W[at(DONE, lane)] > 0.0 else 1.0
    gauss_rows(nodes, W)


@lane_kernel
def correct(nodes: int, W: _Array) -> None:
    """Take one step of Halley's in Kepler's equation; ANGLE is what is beyond the longitude."""
    for lane in range(LANES):
        W[at(GAP, lane)] = 0.0
    for i in range(min(nodes, MOST)):
        for lane in range(LANES):
            ex, ey = W[at(PATH + MOST + i, lane)], W[at(PATH + 2 * MOST + i, lane)]
            s, c, angle = W[at(SINE + i, lane)], W[at(COSINE + i, lane)], W[at(ANGLE + i, lane)]
            slope, curve = 1.0 - ex * c - ey * s, ex * s - ey * c
            gap = angle - curve
            step = gap * slope / (slope * slope - 0.5 * gap * curve)
            step = 0.0 if W[at(DONE, lane)] > 0.0 else step
            sine, cosine = small_sine_cosine(step)
            W[at(ANGLE + i, lane)] = angle - step
            W[at(SINE + i, lane)] = s * cosine - c * sine
            W[at(COSINE + i, lane)] = c * cosine + s * sine
            W[at(GAP, lane)] = max(W[at(GAP, lane)], abs(step))
    for lane in range(LANES):
        done = W[at(DONE, lane)] > 0.0
        far = (not done) & (not W[at(GAP, lane)] < _CORRECTION)
        W[at(ODD, lane)] = 1.0 if far else W[at(ODD, lane)]
        W[at(DONE, lane)] = 1.0 if done | far | (W[at(GAP, lane)] < _CONVERGED) else 0.0


@lane_kernel
def gauss_rows(nodes: int, W: _Array) -> None:
    """Write the ROWS of all nodes, whose SINE, COSINE and ROOT are known."""
    for i in range(min(nodes, MOST)):
        for lane in range(LANES):
            n, ex, ey = (
                W[at(PATH + i, lane)],
                W[at(PATH + MOST + i, lane)],
                W[at(PATH + 2 * MOST + i, lane)],
            )
            h, k = W[at(PATH + 3 * MOST + i, lane)], W[at(PATH + 4 * MOST + i, lane)]
            remaining, root_a = W[at(REMAINING + i, lane)], W[at(ROOT + i, lane)]
            s, c = W[at(SINE + i, lane)], W[at(COSINE + i, lane)]
            eta2 = 1.0 - ex * ex - ey * ey
            eta = math.sqrt(eta2)
            over_eta = 1.0 / eta
            b = 1.0 / (1.0 + eta)
            a = root_a * root_a
            r_a = 1.0 - ex * c - ey * s
            over_r = 1.0 / r_a
            cos_l = ((1.0 - ey * ey * b) * c + ex * ey * b * s - ex) * over_r
            sin_l = ((1.0 - ex * ex * b) * s + ex * ey * b * c - ey) * over_r
            p = a * eta2
            r = a * r_a
            w = eta2 * over_r
            sigma = ex * sin_l - ey * cos_l
            chi = h * sin_l - k * cos_l
            root = root_a * eta
            # n a = 1 / root_a.
            over_root = over_eta * n * a
            over = root_a * r_a * over_eta
            change_n = -3.0 * n * a * over_root
            n_r = change_n * sigma
            n_t = change_n * w
            tilt = 0.5 * over * (1.0 + h * h + k * k)
            o = ROWS + i
            W[at(o, lane)] = n_r
            W[at(o + MOST, lane)] = n_t
            W[at(o + 2 * MOST, lane)] = root * sin_l
            W[at(o + 3 * MOST, lane)] = over * ((w + 1.0) * cos_l + ex)
            W[at(o + 4 * MOST, lane)] = -over * chi * ey
            W[at(o + 5 * MOST, lane)] = -root * cos_l
            W[at(o + 6 * MOST, lane)] = over * ((w + 1.0) * sin_l + ey)
            W[at(o + 7 * MOST, lane)] = over * chi * ex
            W[at(o + 8 * MOST, lane)] = tilt * cos_l
            W[at(o + 9 * MOST, lane)] = tilt * sin_l
            W[at(o + 10 * MOST, lane)] = (
                -(p * (w - 1.0) * b + 2.0 * eta * r) * over_root + remaining * n_r
            )
            W[at(o + 11 * MOST, lane)] = (p + r) * sigma * b * over_root + remaining * n_t
            W[at(o + 12 * MOST, lane)] = over * chi


@lane_kernel
def clear_matrix(W: _Array) -> None:
    """Set the sums of `weighted_solve` to zero."""
    for j in range(36 * LANES):
        W[MATRIX * LANES + j] = 0.0


@lane_kernel
def weighted_solve(nodes: int, W: _Array) -> None:
    """Write P with (sum_i w_i C_i C_i^T) P = D, by Cholesky's factors in MATRIX."""
    clear_matrix(W)
    m = MATRIX
    for i in range(min(nodes, MOST)):
        o = ROWS + i
        for lane in range(LANES):
            w = W[at(WEIGHTS + i, lane)]
            r0, r1 = W[at(o, lane)], W[at(o + MOST, lane)]
            x0, x1 = W[at(o + 2 * MOST, lane)], W[at(o + 3 * MOST, lane)]
            x2 = W[at(o + 4 * MOST, lane)]
            y0, y1 = W[at(o + 5 * MOST, lane)], W[at(o + 6 * MOST, lane)]
            y2 = W[at(o + 7 * MOST, lane)]
            h2, k2 = W[at(o + 8 * MOST, lane)], W[at(o + 9 * MOST, lane)]
            l0, l1 = W[at(o + 10 * MOST, lane)], W[at(o + 11 * MOST, lane)]
            l2 = W[at(o + 12 * MOST, lane)]
            n0, n1 = w * r0, w * r1
            a0, a1, a2 = w * x0, w * x1, w * x2
            b0, b1, b2 = w * y0, w * y1, w * y2
            W[at(m, lane)] += n0 * r0 + n1 * r1
            W[at(m + 6, lane)] += n0 * x0 + n1 * x1
            W[at(m + 12, lane)] += n0 * y0 + n1 * y1
            W[at(m + 30, lane)] += n0 * l0 + n1 * l1
            W[at(m + 7, lane)] += a0 * x0 + a1 * x1 + a2 * x2
            W[at(m + 13, lane)] += a0 * y0 + a1 * y1 + a2 * y2
            W[at(m + 19, lane)] += a2 * h2
            W[at(m + 25, lane)] += a2 * k2
            W[at(m + 31, lane)] += a0 * l0 + a1 * l1 + a2 * l2
            W[at(m + 14, lane)] += b0 * y0 + b1 * y1 + b2 * y2
            W[at(m + 20, lane)] += b2 * h2
            W[at(m + 26, lane)] += b2 * k2
            W[at(m + 32, lane)] += b0 * l0 + b1 * l1 + b2 * l2
            W[at(m + 21, lane)] += w * h2 * h2
            W[at(m + 27, lane)] += w * h2 * k2
            W[at(m + 33, lane)] += w * h2 * l2
            W[at(m + 28, lane)] += w * k2 * k2
            W[at(m + 34, lane)] += w * k2 * l2
            W[at(m + 35, lane)] += w * (l0 * l0 + l1 * l1 + l2 * l2)
    factor(W)


@lane_kernel
def factor(W: _Array) -> None:
    """Write P, by Cholesky's factors of MATRIX, and VALUE, P . D; nearly singular ones are ODD."""
    m = MATRIX
    for lane in range(LANES):
        a00, a10, a20, a50 = (
            W[at(m, lane)],
            W[at(m + 6, lane)],
            W[at(m + 12, lane)],
            W[at(m + 30, lane)],
        )
        a11, a21, a31 = W[at(m + 7, lane)], W[at(m + 13, lane)], W[at(m + 19, lane)]
        a41, a51, a22 = W[at(m + 25, lane)], W[at(m + 31, lane)], W[at(m + 14, lane)]
        a32, a42, a52 = W[at(m + 20, lane)], W[at(m + 26, lane)], W[at(m + 32, lane)]
        a33, a43, a53 = W[at(m + 21, lane)], W[at(m + 27, lane)], W[at(m + 33, lane)]
        a44, a54, a55 = W[at(m + 28, lane)], W[at(m + 34, lane)], W[at(m + 35, lane)]
        # n is bound up with neither h nor k: a30 and a40 are 0.
        fine = a00 > 0.0
        i0 = 1.0 / math.sqrt(a00)
        l10, l20, l50 = a10 * i0, a20 * i0, a50 * i0
        rest = a11 - l10 * l10
        fine &= rest > _SINGULAR * a11
        i1 = 1.0 / math.sqrt(rest)
        l21 = (a21 - l20 * l10) * i1
        l31, l41 = a31 * i1, a41 * i1
        l51 = (a51 - l50 * l10) * i1
        rest = a22 - l20 * l20 - l21 * l21
        fine &= rest > _SINGULAR * a22
        i2 = 1.0 / math.sqrt(rest)
        l32, l42 = (a32 - l31 * l21) * i2, (a42 - l41 * l21) * i2
        l52 = (a52 - l50 * l20 - l51 * l21) * i2
        rest = a33 - l31 * l31 - l32 * l32
        fine &= rest > _SINGULAR * a33
        i3 = 1.0 / math.sqrt(rest)
        l43 = (a43 - l41 * l31 - l42 * l32) * i3
        l53 = (a53 - l51 * l31 - l52 * l32) * i3
        rest = a44 - l41 * l41 - l42 * l42 - l43 * l43
        fine &= rest > _SINGULAR * a44
        i4 = 1.0 / math.sqrt(rest)
        l54 = (a54 - l51 * l41 - l52 * l42 - l53 * l43) * i4
        rest = a55 - l50 * l50 - l51 * l51 - l52 * l52 - l53 * l53 - l54 * l54
        fine &= rest > _SINGULAR * a55
        i5 = 1.0 / math.sqrt(rest)
        p0 = W[at(D, lane)] * i0
        p1 = (W[at(D + 1, lane)] - l10 * p0) * i1
        p2 = (W[at(D + 2, lane)] - l20 * p0 - l21 * p1) * i2
        p3 = (W[at(D + 3, lane)] - l31 * p1 - l32 * p2) * i3
        p4 = (W[at(D + 4, lane)] - l41 * p1 - l42 * p2 - l43 * p3) * i4
        p5 = (W[at(D + 5, lane)] - l50 * p0 - l51 * p1 - l52 * p2 - l53 * p3 - l54 * p4) * i5 * i5
        p4 = (p4 - l54 * p5) * i4
        p3 = (p3 - l43 * p4 - l53 * p5) * i3
        p2 = (p2 - l32 * p3 - l42 * p4 - l52 * p5) * i2
        p1 = (p1 - l21 * p2 - l31 * p3 - l41 * p4 - l51 * p5) * i1
        p0 = (p0 - l10 * p1 - l20 * p2 - l50 * p5) * i0
        W[at(P, lane)] = p0
        W[at(P + 1, lane)] = p1
        W[at(P + 2, lane)] = p2
        W[at(P + 3, lane)] = p3
        W[at(P + 4, lane)] = p4
        W[at(P + 5, lane)] = p5
        value = p0 * W[at(D, lane)] + p1 * W[at(D + 1, lane)] + p2 * W[at(D + 2, lane)]
        W[at(VALUE, lane)] = value + (
            p3 * W[at(D + 3, lane)] + p4 * W[at(D + 4, lane)] + p5 * W[at(D + 5, lane)]
        )
        W[at(ODD, lane)] = W[at(ODD, lane)] if fine else 1.0


@lane_kernel
def duals(nodes: int, W: _Array) -> None:
    """Write C_i^T P and its length."""
    for i in range(min(nodes, MOST)):
        o = ROWS + i
        for lane in range(LANES):
            g0 = (
                W[at(o, lane)] * W[at(P, lane)]
                + W[at(o + 2 * MOST, lane)] * W[at(P + 1, lane)]
                + W[at(o + 5 * MOST, lane)] * W[at(P + 2, lane)]
                + W[at(o + 10 * MOST, lane)] * W[at(P + 5, lane)]
            )
            g1 = (
                W[at(o + MOST, lane)] * W[at(P, lane)]
                + W[at(o + 3 * MOST, lane)] * W[at(P + 1, lane)]
                + W[at(o + 6 * MOST, lane)] * W[at(P + 2, lane)]
                + W[at(o + 11 * MOST, lane)] * W[at(P + 5, lane)]
            )
            g2 = (
                W[at(o + 4 * MOST, lane)] * W[at(P + 1, lane)]
                + W[at(o + 7 * MOST, lane)] * W[at(P + 2, lane)]
                + W[at(o + 8 * MOST, lane)] * W[at(P + 3, lane)]
                + W[at(o + 9 * MOST, lane)] * W[at(P + 4, lane)]
                + W[at(o + 12 * MOST, lane)] * W[at(P + 5, lane)]
            )
            W[at(DUALS + i, lane)] = g0
            W[at(DUALS + MOST + i, lane)] = g1
            W[at(DUALS + 2 * MOST + i, lane)] = g2
            W[at(DUALS + 3 * MOST + i, lane)] = math.sqrt(g0 * g0 + g1 * g1 + g2 * g2)


@lane_kernel
def balanced_impulse(W: _Array) -> None:
    """Write IMPULSE, z with z sum_i c_i(z) |g_i| = VALUE, and the RATIO c_i = m_0 / m_i."""
    g = DUALS + 3 * MOST
    for lane in range(LANES):
        total, late = 0.0, 0.0
        for i in range(NODES):
            dual = W[at(g + i, lane)]
            total += dual
            late += spent_segments(i, NODES) * dual
        # As if all propellant were spent at once, at the mean time: nearly right, and a bit too
        # much. As if at once at the start it is too little, from where Newton never fails.
        ve, z = W[at(VE, lane)], W[at(VALUE, lane)] / total
        above = ve * z / (ve + late * z / total)
        below = min(ve * z / (ve + z * NODES), (1.0 - 1e-3) * ve / NODES)
        W[at(IMPULSE, lane)] = above if above * NODES < 0.5 * ve else below
        W[at(DONE, lane)] = W[at(ODD, lane)]
    for _ in range(_BALANCE_STEPS):
        for lane in range(LANES):
            ve, z, value = W[at(VE, lane)], W[at(IMPULSE, lane)], W[at(VALUE, lane)]
            used = z / ve
            total, slope = 0.0, 0.0
            for i in range(NODES):
                ratio = 1.0 / (1.0 - used * spent_segments(i, NODES))
                W[at(RATIO + i, lane)] = ratio
                part = ratio * W[at(g + i, lane)]
                total += part
                slope += ratio * part
            largest = (1.0 - 1e-3) * ve / NODES
            gap = value - z * total
            done = (W[at(DONE, lane)] > 0.0) | (abs(gap) <= 1e-9 * value) | (z >= largest)
            W[at(DONE, lane)] = 1.0 if done else 0.0
            W[at(IMPULSE, lane)] = z if done else min(z + gap / slope, largest)
        if all_done(W):
            break
