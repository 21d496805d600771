"""Lambert's problem without complete revolutions, and MIMA, of eight legs at a time.

As `feasibility.orbits.lambert_kernels`, whose symbols these are (Izzo 2015), for ellipses that are
not nearly parabolas. The others are marked as LOOSE, to be solved alone.
"""

import math

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.margin.lanes.layout_kernels import (
    ARC,
    DIRECT,
    DONE,
    LAM,
    LANES,
    LOOSE,
    S0,
    S1,
    TARGET,
    TOF,
    V1,
    V2,
    Q,
    X,
    at,
)
from feasibility.classifier.margin.lanes.math_kernels import atan2, exp, log
from feasibility.classifier.margin.lanes.path_kernels import all_done
from feasibility.runtime.jit import lane_kernel

_Array = NDArray[np.float64]

_ITERATIONS = 6
_STEP_TOLERANCE = 1e-5
_PARABOLIC = 0.9
_THIRD = 1.0 / 3.0
_LN2 = math.log(2.0)
# Rows of ARC: directions of the positions and along the motion there, sizes, chord and more.
_U, _T, _W, _R = 0, 3, 6, 9
_N1, _N2, _GAMMA, _RHO, _SIGMA = 12, 13, 14, 15, 16


@lane_kernel
def lambert(W: _Array) -> None:
    """Write V1 and V2 of the direct transfer between the positions of S0 and S1."""
    lay_arc(W)
    guess(W)
    for _ in range(_ITERATIONS):
        improve(W)
        if all_done(W):
            break
    for lane in range(LANES):
        W[at(LOOSE, lane)] = W[at(LOOSE, lane)] if W[at(DONE, lane)] > 0.0 else 1.0
    for lane in range(LANES):
        x, lam, q = W[at(X, lane)], W[at(LAM, lane)], W[at(Q, lane)]
        y = math.sqrt(lam * lam * x * x + q)
        gamma = W[at(ARC + _GAMMA, lane)]
        difference = gamma * (lam * y - x)
        total = gamma * W[at(ARC + _RHO, lane)] * (lam * y + x)
        transverse = gamma * W[at(ARC + _SIGMA, lane)] * (y + lam * x)
        over1, over2 = 1.0 / W[at(ARC + _N1, lane)], 1.0 / W[at(ARC + _N2, lane)]
        r1, r2 = (difference - total) * over1, -(difference + total) * over2
        t1, t2 = transverse * over1, transverse * over2
        W[at(V1, lane)] = r1 * W[at(ARC + _U, lane)] + t1 * W[at(ARC + _T, lane)]
        W[at(V1 + 1, lane)] = r1 * W[at(ARC + _U + 1, lane)] + t1 * W[at(ARC + _T + 1, lane)]
        W[at(V1 + 2, lane)] = r1 * W[at(ARC + _U + 2, lane)] + t1 * W[at(ARC + _T + 2, lane)]
        W[at(V2, lane)] = r2 * W[at(ARC + _W, lane)] + t2 * W[at(ARC + _R, lane)]
        W[at(V2 + 1, lane)] = r2 * W[at(ARC + _W + 1, lane)] + t2 * W[at(ARC + _R + 1, lane)]
        W[at(V2 + 2, lane)] = r2 * W[at(ARC + _W + 2, lane)] + t2 * W[at(ARC + _R + 2, lane)]


@lane_kernel
def lay_arc(W: _Array) -> None:
    """Write what Lambert's problem looks like without units."""
    for lane in range(LANES):
        x1, y1, z1 = W[at(S0, lane)], W[at(S0 + 1, lane)], W[at(S0 + 2, lane)]
        x2, y2, z2 = W[at(S1, lane)], W[at(S1 + 1, lane)], W[at(S1 + 2, lane)]
        n1 = math.sqrt(x1 * x1 + y1 * y1 + z1 * z1)
        n2 = math.sqrt(x2 * x2 + y2 * y2 + z2 * z2)
        cx, cy, cz = x2 - x1, y2 - y1, z2 - z1
        chord = math.sqrt(cx * cx + cy * cy + cz * cz)
        hx, hy, hz = y1 * z2 - z1 * y2, z1 * x2 - x1 * z2, x1 * y2 - y1 * x2
        h = math.sqrt(hx * hx + hy * hy + hz * hz)
        sign = 1.0 if hz >= 0.0 else -1.0
        turned = sign / h
        hx, hy, hz = hx * turned, hy * turned, hz * turned
        over1, over2 = 1.0 / n1, 1.0 / n2
        ux, uy, uz = x1 * over1, y1 * over1, z1 * over1
        wx, wy, wz = x2 * over2, y2 * over2, z2 * over2
        semi = 0.5 * (n1 + n2 + chord)
        mean = math.sqrt(n1 * n2)
        sx, sy, sz = ux + wx, uy + wy, uz + wz
        dx, dy, dz = ux - wx, uy - wy, uz - wz
        over = 1.0 / semi
        lam = 0.5 * sign * mean * math.sqrt(sx * sx + sy * sy + sz * sz) * over
        q = chord * over
        target = math.sqrt(2.0 * over) * over * W[at(TOF, lane)]
        root = math.sqrt(q)
        # Transfers of nearly half a turn and of next to nothing lose digits.
        fine = (h > 1e-6 * n1 * n2) & (q > 1e-6)
        W[at(LOOSE, lane)] = 0.0 if fine else 1.0
        W[at(LAM, lane)] = lam
        W[at(Q, lane)] = q
        W[at(TARGET, lane)] = target
        W[at(DIRECT, lane)] = atan2(root, lam) + lam * root
        W[at(DONE, lane)] = 0.0 if fine else 1.0
        o = ARC
        W[at(o + _U, lane)] = ux
        W[at(o + _U + 1, lane)] = uy
        W[at(o + _U + 2, lane)] = uz
        W[at(o + _T, lane)] = hy * uz - hz * uy
        W[at(o + _T + 1, lane)] = hz * ux - hx * uz
        W[at(o + _T + 2, lane)] = hx * uy - hy * ux
        W[at(o + _W, lane)] = wx
        W[at(o + _W + 1, lane)] = wy
        W[at(o + _W + 2, lane)] = wz
        W[at(o + _R, lane)] = hy * wz - hz * wy
        W[at(o + _R + 1, lane)] = hz * wx - hx * wz
        W[at(o + _R + 2, lane)] = hx * wy - hy * wx
        W[at(o + _N1, lane)] = n1
        W[at(o + _N2, lane)] = n2
        W[at(o + _GAMMA, lane)] = math.sqrt(0.5 * semi)
        W[at(o + _RHO, lane)] = (n1 - n2) / chord
        W[at(o + _SIGMA, lane)] = mean * math.sqrt(dx * dx + dy * dy + dz * dz) / chord


@lane_kernel
def guess(W: _Array) -> None:
    """Write the first x, equation 30; hyperbolas are LOOSE."""
    for lane in range(LANES):
        lam, q = W[at(LAM, lane)], W[at(Q, lane)]
        target, direct = W[at(TARGET, lane)], W[at(DIRECT, lane)]
        one_lam = q / (1.0 + lam) if lam > 0.0 else 1.0 - lam
        parabolic = (2.0 / 3.0) * one_lam * (1.0 + lam + lam * lam)
        fine = target > parabolic
        ratio = log(direct / (target if fine else direct))
        long = target >= direct
        power = (2.0 / 3.0) if long else _LN2 / log(direct / parabolic)
        x = exp(ratio * power) - 1.0
        W[at(X, lane)] = min(x, _PARABOLIC)
        W[at(LOOSE, lane)] = W[at(LOOSE, lane)] if fine else 1.0
        W[at(DONE, lane)] = W[at(DONE, lane)] if fine else 1.0


@lane_kernel
def improve(W: _Array) -> None:
    """Take one of Householder's steps."""
    for lane in range(LANES):
        x, lam, q = W[at(X, lane)], W[at(LAM, lane)], W[at(Q, lane)]
        lam2 = lam * lam
        lam3 = lam2 * lam
        y = math.sqrt(lam2 * x * x + q)
        eta = q / (y + lam * x) if lam * x > 0.0 else y - lam * x
        e = (1.0 - x) * (1.0 + x)
        root = math.sqrt(e)
        psi = atan2(eta * root, x * y + lam * e)
        over_e, over_y = 1.0 / e, 1.0 / y
        time = (psi / root - x * q + lam * eta) * over_e
        gap = time - W[at(TARGET, lane)]
        over_y2 = over_y * over_y
        d1 = (3.0 * time * x - 2.0 + 2.0 * lam3 * x * over_y) * over_e
        d2 = (3.0 * time + 5.0 * x * d1 + 2.0 * q * lam3 * over_y * over_y2) * over_e
        d3 = (
            7.0 * x * d2 + 8.0 * d1 - 6.0 * q * lam2 * lam3 * x * over_y * over_y2 * over_y2
        ) * over_e
        step = (
            gap
            * (d1 * d1 - 0.5 * gap * d2)
            / (d1 * (d1 * d1 - gap * d2) + d3 * gap * gap * (1.0 / 6.0))
        )
        done = W[at(DONE, lane)] > 0.0
        x = x if done else x - step
        inside = (x > -1.0) & (x < _PARABOLIC)
        near = abs(step) <= _STEP_TOLERANCE * min(1.0 + x, 1.0 - x)
        W[at(LOOSE, lane)] = W[at(LOOSE, lane)] if inside else 1.0
        W[at(X, lane)] = x
        W[at(DONE, lane)] = 0.0 if inside & (not done) & (not near) else 1.0


@lane_kernel
def mima(a: int, b: int, out: int, W: _Array) -> None:
    """Write MIMA's acceleration times the flight time, for impulses (3 rows each)."""
    for lane in range(LANES):
        x1, y1, z1 = W[at(a, lane)], W[at(a + 1, lane)], W[at(a + 2, lane)]
        x2, y2, z2 = W[at(b, lane)], W[at(b + 1, lane)], W[at(b + 2, lane)]
        dx, dy, dz = x1 + x2, y1 + y2, z1 + z2
        ex, ey, ez = x1 - x2, y1 - y2, z1 - z2
        dd = dx * dx + dy * dy + dz * dz
        ee = ex * ex + ey * ey + ez * ez
        de = dx * ex + dy * ey + dz * ez
        k = 2.0 * de / (ee if ee > 0.0 else 1.0)
        root = math.sqrt(k * k + 4.0)
        # 1 / x of the switch.
        over = 0.5 * (2.0 + (4.0 / (root + k) if k > 0.0 else root - k))
        W[at(out, lane)] = math.sqrt(max(dd + (2.0 * de + ee * over) * over, 0.0))
