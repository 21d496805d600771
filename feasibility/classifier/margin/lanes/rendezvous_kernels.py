"""The quick features of legs from rest to rest, eight at a time; see `feature_kernels`."""

import math

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.margin.feature_kernels import (
    MAX_REVS,
    N_GEOMETRY,
    N_NEED,
    N_QUICK,
    FeatureWork,
    feature_workspace,
    lambert_hints,
    log_ratio,
    quick_features,
)
from feasibility.classifier.margin.lanes.lambert_kernels import lambert, mima
from feasibility.classifier.margin.lanes.layout_kernels import (
    BODY0,
    COASTED,
    EXCESS0,
    EXCESS1,
    FEATURES,
    IMPULSE,
    LANES,
    LOOSE,
    MIMA,
    NEAR,
    NODES,
    ODD,
    S0,
    S1,
    TARGET,
    TOF,
    TOTAL,
    UNIT,
    V1,
    V2,
    VE,
    WEIGHTS,
    X0,
    X1,
    D,
    P,
    at,
    lane_workspace,
)
from feasibility.classifier.margin.lanes.math_kernels import (
    inverse_cube_root,
    log,
    sine_cosine,
    small_sine_cosine,
)
from feasibility.classifier.margin.lanes.path_kernels import (
    balanced_impulse,
    duals,
    elements,
    first_path,
    impulse_effects,
    weighted_solve,
)
from feasibility.classifier.margin.path_kernels import SATURATED
from feasibility.runtime.jit import kernel, lane_function, lane_kernel

_Array = NDArray[np.float64]

_LEAST_LOG = -1.5
_LARGEST_LOG = 3.0
_OVER_PI = 1.0 / math.pi


@lane_function
def clip(x: float, low: float, high: float) -> float:
    """Return x within the bounds."""
    return min(max(x, low), high)


@lane_kernel
def to_frame(mu: float, W: _Array) -> None:
    """Write the bodies' states as seen from the departure orbit into S0 and S1, and UNIT, m.

    Flight time and exhaust velocity too, which are in seconds and m/s before.
    """
    b = BODY0
    for lane in range(LANES):
        x, y, z = W[at(b, lane)], W[at(b + 1, lane)], W[at(b + 2, lane)]
        u, v, w = W[at(b + 3, lane)], W[at(b + 4, lane)], W[at(b + 5, lane)]
        r = math.sqrt(x * x + y * y + z * z)
        over = 1.0 / r
        energy = 2.0 * over - (u * u + v * v + w * w) / mu
        hx, hy, hz = y * w - z * v, z * u - x * w, x * v - y * u
        h = math.sqrt(hx * hx + hy * hy + hz * hz)
        fine = (energy * r > 1e-6) & (h > 0.0)
        W[at(ODD, lane)] = 0.0 if fine else 1.0
        a = 1.0 / (energy if fine else over)
        over_a = energy if fine else over
        over_speed = math.sqrt(a / mu)
        over_h = 1.0 / h
        x, y, z = x * over, y * over, z * over
        hx, hy, hz = hx * over_h, hy * over_h, hz * over_h
        tx, ty, tz = hy * z - hz * y, hz * x - hx * z, hx * y - hy * x
        W[at(UNIT, lane)] = a
        W[at(TOF, lane)] *= over_a / over_speed
        W[at(VE, lane)] *= over_speed
        for part in range(4):
            unit = over_a if part % 2 == 0 else over_speed
            o = 3 * part
            p, q, s = W[at(b + o, lane)], W[at(b + o + 1, lane)], W[at(b + o + 2, lane)]
            W[at(S0 + o, lane)] = (p * x + q * y + s * z) * unit
            W[at(S0 + o + 1, lane)] = (p * tx + q * ty + s * tz) * unit
            W[at(S0 + o + 2, lane)] = (p * hx + q * hy + s * hz) * unit


@lane_kernel
def coast(W: _Array) -> None:
    """Write position and velocity (2 rows each) on the departure orbit at arrival as COASTED."""
    for lane in range(LANES):
        n, ex, ey = W[at(X0, lane)], W[at(X0 + 1, lane)], W[at(X0 + 2, lane)]
        longitude = W[at(X0 + 5, lane)] + n * W[at(TOF, lane)]
        s, c = sine_cosine(longitude)
        slope, curve = 1.0 - ex * c - ey * s, ex * s - ey * c
        beyond = curve * slope / (slope * slope + 0.5 * curve * curve)
        fine = abs(beyond) < 0.8
        sine, cosine = small_sine_cosine(beyond)
        s, c = s * cosine + c * sine, c * cosine - s * sine
        for _ in range(2):
            slope, curve = 1.0 - ex * c - ey * s, ex * s - ey * c
            gap = beyond - curve
            step = gap * slope / (slope * slope - 0.5 * gap * curve)
            beyond -= step
            fine &= abs(step) < 0.5
            sine, cosine = small_sine_cosine(step)
            s, c = s * cosine - c * sine, c * cosine + s * sine
        root_a = inverse_cube_root(n)
        a = root_a * root_a
        b = 1.0 / (1.0 + math.sqrt(1.0 - ex * ex - ey * ey))
        na_r = n * a / (1.0 - ex * c - ey * s)
        W[at(COASTED, lane)] = a * ((1.0 - ey * ey * b) * c + ex * ey * b * s - ex)
        W[at(COASTED + 1, lane)] = a * ((1.0 - ex * ex * b) * s + ex * ey * b * c - ey)
        W[at(COASTED + 2, lane)] = na_r * (ex * ey * b * c - (1.0 - ey * ey * b) * s)
        W[at(COASTED + 3, lane)] = na_r * ((1.0 - ex * ex * b) * c - ex * ey * b * s)
        W[at(ODD, lane)] = W[at(ODD, lane)] if fine else 1.0


@lane_kernel
def geometry(W: _Array) -> None:
    """Write the features 0 to N_GEOMETRY - 1: the leg, without a hint."""
    o = FEATURES
    for lane in range(LANES):
        tof, near = W[at(TOF, lane)], W[at(NEAR, lane)]
        W[at(o, lane)] = log(tof)
        W[at(o + 1, lane)] = log(W[at(VE, lane)])
        W[at(o + 2, lane)] = log(W[at(X1, lane)])
        W[at(o + 3, lane)] = W[at(X0 + 1, lane)]
        W[at(o + 4, lane)] = W[at(X0 + 2, lane)]
        W[at(o + 5, lane)] = W[at(X1 + 1, lane)]
        W[at(o + 6, lane)] = W[at(X1 + 2, lane)]
        W[at(o + 7, lane)] = W[at(X1 + 3, lane)]
        W[at(o + 8, lane)] = W[at(X1 + 4, lane)]
        W[at(o + 9, lane)] = near
        W[at(o + 10, lane)] = clip(near / tof, -2.0, 2.0)
        s, c = sine_cosine(W[at(X1 + 5, lane)])
        W[at(o + 11, lane)] = s
        W[at(o + 12, lane)] = c
        W[at(o + 13, lane)] = 0.25 * tof * (W[at(X0, lane)] + W[at(X1, lane)]) * _OVER_PI
        x, y = W[at(COASTED, lane)], W[at(COASTED + 1, lane)]
        over = 1.0 / math.sqrt(x * x + y * y)
        cx, cy = x * over, y * over
        ax, ay = W[at(S1, lane)] - x, W[at(S1 + 1, lane)] - y
        W[at(o + 14, lane)] = ax * cx + ay * cy
        W[at(o + 15, lane)] = ay * cx - ax * cy
        W[at(o + 16, lane)] = W[at(S1 + 2, lane)]
        ax, ay = (
            W[at(S1 + 3, lane)] - W[at(COASTED + 2, lane)],
            W[at(S1 + 4, lane)] - W[at(COASTED + 3, lane)],
        )
        W[at(o + 17, lane)] = ax * cx + ay * cy
        W[at(o + 18, lane)] = ay * cx - ax * cy
        W[at(o + 19, lane)] = W[at(S1 + 5, lane)]


@lane_kernel
def need(W: _Array) -> None:
    """Write the N_NEED features after the geometry, and TOTAL, the impulse of all segments."""
    o = FEATURES + N_GEOMETRY
    for lane in range(LANES):
        value = 0.0
        for j in range(6):
            value += W[at(P + j, lane)] * W[at(D + j, lane)]
        z = W[at(IMPULSE, lane)]
        fine = (value > 0.0) & (z > 0.0) & (z < SATURATED)
        W[at(ODD, lane)] = W[at(ODD, lane)] if fine else 1.0
        total = z * NODES if fine else 1.0
        W[at(TOTAL, lane)] = total
        over = 1.0 / total
        W[at(o + 6, lane)] = log(total)
        W[at(o + 7, lane)] = clip(total / W[at(VE, lane)], 0.0, 2.0)
        over_value = 1.0 / (value if fine else 1.0)
        way = 2.0 * over / W[at(TOF, lane)]
        for j in range(3):
            W[at(o + j, lane)] = clip(W[at(FEATURES + 14 + j, lane)] * way, -3.0, 3.0)
            W[at(o + 3 + j, lane)] = clip(W[at(FEATURES + 17 + j, lane)] * over, -3.0, 3.0)
        for j in range(6):
            share = W[at(P + j, lane)] * W[at(D + j, lane)] * over_value
            W[at(o + 8 + j, lane)] = clip(share, -3.0, 3.0)


@lane_kernel
def lambert_features(W: _Array) -> None:
    """Write the features of Lambert's direct arc; legs long enough for others become LOOSE."""
    lambert(W)
    for lane in range(LANES):
        W[at(LOOSE, lane)] = W[at(LOOSE, lane)] if W[at(TARGET, lane)] < math.pi else 1.0
    for lane in range(LANES):
        for j in range(3):
            W[at(EXCESS0 + j, lane)] = W[at(V1 + j, lane)] - W[at(S0 + 3 + j, lane)]
            W[at(EXCESS1 + j, lane)] = W[at(S1 + 3 + j, lane)] - W[at(V2 + j, lane)]
    mima(EXCESS0, EXCESS1, MIMA, W)
    o = FEATURES + N_GEOMETRY + N_NEED
    for lane in range(LANES):
        x, y, z = W[at(EXCESS0, lane)], W[at(EXCESS0 + 1, lane)], W[at(EXCESS0 + 2, lane)]
        u, v, w = W[at(EXCESS1, lane)], W[at(EXCESS1 + 1, lane)], W[at(EXCESS1 + 2, lane)]
        sizes = math.sqrt(x * x + y * y + z * z) + math.sqrt(u * u + v * v + w * w)
        base = W[at(FEATURES + N_GEOMETRY + 6, lane)]
        # Of no other number of revolutions: SATURATED there.
        none_mima = clip(log(SATURATED * W[at(TOF, lane)]) - base, _LEAST_LOG, _LARGEST_LOG)
        none_lambert = clip(log(SATURATED) - base, _LEAST_LOG, _LARGEST_LOG)
        fine = (sizes > 0.0) & (W[at(MIMA, lane)] > 0.0)
        W[at(o, lane)] = clip(
            log(W[at(MIMA, lane)] if fine else 1.0) - base, _LEAST_LOG, _LARGEST_LOG
        )
        W[at(o + 1, lane)] = clip(log(sizes if fine else 1.0) - base, _LEAST_LOG, _LARGEST_LOG)
        W[at(o + 2, lane)] = none_mima
        W[at(o + 3, lane)] = none_lambert
        W[at(o + 4, lane)] = none_mima
        W[at(o + 5, lane)] = none_lambert
        W[at(LOOSE, lane)] = W[at(LOOSE, lane)] if fine else 1.0


@lane_kernel
def loose_lambert_features(lane: int, W: _Array, work: FeatureWork, out: _Array) -> None:
    """Write the features of Lambert's arcs of one leg, up to MAX_REVS revolutions."""
    _, (s0, s1, _, _, _), lambert_work, (hints, branch, _, _, _, _) = work
    for j in range(6):
        s0[j], s1[j] = W[at(S0 + j, lane)], W[at(S1 + j, lane)]
    tof = W[at(TOF, lane)]
    lambert_hints(s0, s1, tof, lambert_work, hints, branch)
    base = W[at(FEATURES + N_GEOMETRY + 6, lane)]
    for j in range(2 * (MAX_REVS + 1)):
        out[N_GEOMETRY + N_NEED + j] = log_ratio(hints[j] * (tof if j % 2 == 0 else 1.0), base)


@lane_kernel
def quick_lanes(mu: float, W: _Array) -> None:
    """Write FEATURES of eight legs whose bodies' states, TOF and VE are given.

    The path of the nearest number of revolutions by least squares, and Lambert's direct arc.
    """
    to_frame(mu, W)
    elements(W)
    first_path(W)
    impulse_effects(int(NODES), W)
    for j in range(NODES * LANES):
        W[WEIGHTS * LANES + j] = 1.0
    weighted_solve(int(NODES), W)
    duals(int(NODES), W)
    balanced_impulse(W)
    coast(W)
    geometry(W)
    need(W)
    lambert_features(W)


@kernel
def quick_lane_batch(
    rv_dep: _Array,
    rv_arr: _Array,
    tof_s: _Array,
    exhaust: _Array,
    mu: float,
    out: _Array,
    hint: _Array,
) -> int:
    """Write features (n, N_QUICK) and log hints (n,) of n legs; return how many were ODD.

    See `feature_kernels.quick_features`, which the odd ones get.
    """
    W = lane_workspace()
    work = feature_workspace()
    n = len(tof_s)
    odd = 0
    for first in range(0, n, LANES):
        for lane in range(LANES):
            # The last ones again, where eight are not left.
            i = min(first + lane, n - 1)
            for j in range(6):
                W[at(BODY0 + j, lane)] = rv_dep[i, j]
                W[at(BODY0 + 6 + j, lane)] = rv_arr[i, j]
            W[at(TOF, lane)] = tof_s[i]
            W[at(VE, lane)] = exhaust[i]
        quick_lanes(mu, W)
        for lane in range(min(LANES, n - first)):
            i = first + lane
            if W[at(ODD, lane)] > 0.0:
                odd += 1
                hint[i] = quick_features(
                    rv_dep[i], rv_arr[i], tof_s[i], exhaust[i], mu, work, out[i]
                )
                continue
            for j in range(N_QUICK):
                out[i, j] = W[at(FEATURES + j, lane)]
            hint[i] = W[at(FEATURES + N_GEOMETRY + 6, lane)] - W[at(FEATURES, lane)]
            if W[at(LOOSE, lane)] > 0.0:
                loose_lambert_features(lane, W, work, out[i])
    return odd
