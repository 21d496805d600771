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
    BODY0,
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
    tiny_sine_cosine,
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
    for l in range(LANES):
        x, y, z = W[at(b, l)], W[at(b + 1, l)], W[at(b + 2, l)]
        u, v, w = W[at(b + 3, l)], W[at(b + 4, l)], W[at(b + 5, l)]
        r = math.sqrt(x * x + y * y + z * z)
        over = 1.0 / r
        energy = 2.0 * over - (u * u + v * v + w * w) / mu
        hx, hy, hz = y * w - z * v, z * u - x * w, x * v - y * u
        h = math.sqrt(hx * hx + hy * hy + hz * hz)
        fine = (energy * r > 1e-6) & (h > 0.0)
        W[at(ODD, l)] = 0.0 if fine else 1.0
        a = 1.0 / (energy if fine else over)
        over_a = energy if fine else over
        over_speed = math.sqrt(a / mu)
        over_h = 1.0 / h
        x, y, z = x * over, y * over, z * over
        hx, hy, hz = hx * over_h, hy * over_h, hz * over_h
        tx, ty, tz = hy * z - hz * y, hz * x - hx * z, hx * y - hy * x
        W[at(UNIT, l)] = a
        W[at(TOF, l)] *= over_a / over_speed
        W[at(VE, l)] *= over_speed
        for part in range(4):
            unit = over_a if part % 2 == 0 else over_speed
            o = 3 * part
            p, q, s = W[at(b + o, l)], W[at(b + o + 1, l)], W[at(b + o + 2, l)]
            W[at(S0 + o, l)] = (p * x + q * y + s * z) * unit
            W[at(S0 + o + 1, l)] = (p * tx + q * ty + s * tz) * unit
            W[at(S0 + o + 2, l)] = (p * hx + q * hy + s * hz) * unit


@lane_kernel
def coast(W: _Array) -> None:
    """Write position and velocity (2 rows each) on the departure orbit at arrival as COASTED."""
    for l in range(LANES):
        n, ex, ey = W[at(X0, l)], W[at(X0 + 1, l)], W[at(X0 + 2, l)]
        longitude = W[at(X0 + 5, l)] + n * W[at(TOF, l)]
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
            fine &= abs(step) < 0.05
            sine, cosine = tiny_sine_cosine(step)
            s, c = s * cosine - c * sine, c * cosine + s * sine
        root_a = inverse_cube_root(n)
        a = root_a * root_a
        b = 1.0 / (1.0 + math.sqrt(1.0 - ex * ex - ey * ey))
        na_r = n * a / (1.0 - ex * c - ey * s)
        W[at(COASTED, l)] = a * ((1.0 - ey * ey * b) * c + ex * ey * b * s - ex)
        W[at(COASTED + 1, l)] = a * ((1.0 - ex * ex * b) * s + ex * ey * b * c - ey)
        W[at(COASTED + 2, l)] = na_r * (ex * ey * b * c - (1.0 - ey * ey * b) * s)
        W[at(COASTED + 3, l)] = na_r * ((1.0 - ex * ex * b) * c - ex * ey * b * s)
        W[at(ODD, l)] = W[at(ODD, l)] if fine else 1.0


@lane_kernel
def geometry(W: _Array) -> None:
    """Write the features 0 to N_GEOMETRY - 1: the leg, without a hint."""
    o = FEATURES
    for l in range(LANES):
        tof, near = W[at(TOF, l)], W[at(NEAR, l)]
        W[at(o, l)] = log(tof)
        W[at(o + 1, l)] = log(W[at(VE, l)])
        W[at(o + 2, l)] = log(W[at(X1, l)])
        W[at(o + 3, l)] = W[at(X0 + 1, l)]
        W[at(o + 4, l)] = W[at(X0 + 2, l)]
        W[at(o + 5, l)] = W[at(X1 + 1, l)]
        W[at(o + 6, l)] = W[at(X1 + 2, l)]
        W[at(o + 7, l)] = W[at(X1 + 3, l)]
        W[at(o + 8, l)] = W[at(X1 + 4, l)]
        W[at(o + 9, l)] = near
        W[at(o + 10, l)] = clip(near / tof, -2.0, 2.0)
        s, c = sine_cosine(W[at(X1 + 5, l)])
        W[at(o + 11, l)] = s
        W[at(o + 12, l)] = c
        W[at(o + 13, l)] = 0.25 * tof * (W[at(X0, l)] + W[at(X1, l)]) * _OVER_PI
        x, y = W[at(COASTED, l)], W[at(COASTED + 1, l)]
        over = 1.0 / math.sqrt(x * x + y * y)
        cx, cy = x * over, y * over
        ax, ay = W[at(S1, l)] - x, W[at(S1 + 1, l)] - y
        W[at(o + 14, l)] = ax * cx + ay * cy
        W[at(o + 15, l)] = ay * cx - ax * cy
        W[at(o + 16, l)] = W[at(S1 + 2, l)]
        ax, ay = W[at(S1 + 3, l)] - W[at(COASTED + 2, l)], W[at(S1 + 4, l)] - W[at(COASTED + 3, l)]
        W[at(o + 17, l)] = ax * cx + ay * cy
        W[at(o + 18, l)] = ay * cx - ax * cy
        W[at(o + 19, l)] = W[at(S1 + 5, l)]


@lane_kernel
def need(W: _Array) -> None:
    """Write the N_NEED features after the geometry, and TOTAL, the impulse of all segments."""
    o = FEATURES + N_GEOMETRY
    for l in range(LANES):
        value = 0.0
        for j in range(6):
            value += W[at(P + j, l)] * W[at(D + j, l)]
        z = W[at(IMPULSE, l)]
        fine = (value > 0.0) & (z > 0.0) & (z < SATURATED)
        W[at(ODD, l)] = W[at(ODD, l)] if fine else 1.0
        total = z * NODES if fine else 1.0
        W[at(TOTAL, l)] = total
        over = 1.0 / total
        W[at(o + 6, l)] = log(total)
        W[at(o + 7, l)] = clip(total / W[at(VE, l)], 0.0, 2.0)
        over_value = 1.0 / (value if fine else 1.0)
        way = 2.0 * over / W[at(TOF, l)]
        for j in range(3):
            W[at(o + j, l)] = clip(W[at(FEATURES + 14 + j, l)] * way, -3.0, 3.0)
            W[at(o + 3 + j, l)] = clip(W[at(FEATURES + 17 + j, l)] * over, -3.0, 3.0)
        for j in range(6):
            share = W[at(P + j, l)] * W[at(D + j, l)] * over_value
            W[at(o + 8 + j, l)] = clip(share, -3.0, 3.0)


@lane_kernel
def lambert_features(W: _Array) -> None:
    """Write the features of Lambert's direct arc; legs long enough for others become LOOSE."""
    lambert(W)
    for l in range(LANES):
        W[at(LOOSE, l)] = W[at(LOOSE, l)] if W[at(TARGET, l)] < math.pi else 1.0
    for l in range(LANES):
        for j in range(3):
            W[at(EXCESS0 + j, l)] = W[at(V1 + j, l)] - W[at(S0 + 3 + j, l)]
            W[at(EXCESS1 + j, l)] = W[at(S1 + 3 + j, l)] - W[at(V2 + j, l)]
    mima(EXCESS0, EXCESS1, MIMA, W)
    o = FEATURES + N_GEOMETRY + N_NEED
    for l in range(LANES):
        x, y, z = W[at(EXCESS0, l)], W[at(EXCESS0 + 1, l)], W[at(EXCESS0 + 2, l)]
        u, v, w = W[at(EXCESS1, l)], W[at(EXCESS1 + 1, l)], W[at(EXCESS1 + 2, l)]
        sizes = math.sqrt(x * x + y * y + z * z) + math.sqrt(u * u + v * v + w * w)
        base = W[at(FEATURES + N_GEOMETRY + 6, l)]
        # Of no other number of revolutions: SATURATED there.
        none_mima = clip(log(SATURATED * W[at(TOF, l)]) - base, _LEAST_LOG, _LARGEST_LOG)
        none_lambert = clip(log(SATURATED) - base, _LEAST_LOG, _LARGEST_LOG)
        fine = (sizes > 0.0) & (W[at(MIMA, l)] > 0.0)
        W[at(o, l)] = clip(log(W[at(MIMA, l)] if fine else 1.0) - base, _LEAST_LOG, _LARGEST_LOG)
        W[at(o + 1, l)] = clip(log(sizes if fine else 1.0) - base, _LEAST_LOG, _LARGEST_LOG)
        W[at(o + 2, l)] = none_mima
        W[at(o + 3, l)] = none_lambert
        W[at(o + 4, l)] = none_mima
        W[at(o + 5, l)] = none_lambert
        W[at(LOOSE, l)] = W[at(LOOSE, l)] if fine else 1.0


@lane_kernel
def loose_lambert_features(l: int, W: _Array, work: FeatureWork, out: _Array) -> None:
    """Write the features of Lambert's arcs of one leg, up to MAX_REVS revolutions."""
    _, (s0, s1, _, _, _), lambert_work, (hints, branch, _, _, _, _) = work
    for j in range(6):
        s0[j], s1[j] = W[at(S0 + j, l)], W[at(S1 + j, l)]
    tof = W[at(TOF, l)]
    lambert_hints(s0, s1, tof, lambert_work, hints, branch)
    base = W[at(FEATURES + N_GEOMETRY + 6, l)]
    for j in range(2 * (MAX_REVS + 1)):
        out[N_GEOMETRY + N_NEED + j] = log_ratio(hints[j] * (tof if j % 2 == 0 else 1.0), base)


@lane_kernel
def quick_lanes(mu: float, W: _Array) -> None:
    """Write FEATURES of eight legs whose bodies' states, TOF and VE are given."""
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
        for l in range(LANES):
            # The last ones again, where eight are not left.
            i = min(first + l, n - 1)
            for j in range(6):
                W[at(BODY0 + j, l)] = rv_dep[i, j]
                W[at(BODY0 + 6 + j, l)] = rv_arr[i, j]
            W[at(TOF, l)] = tof_s[i]
            W[at(VE, l)] = exhaust[i]
        quick_lanes(mu, W)
        for l in range(min(LANES, n - first)):
            i = first + l
            if W[at(ODD, l)] > 0.0:
                odd += 1
                hint[i] = quick_features(
                    rv_dep[i], rv_arr[i], tof_s[i], exhaust[i], mu, work, out[i]
                )
                continue
            for j in range(N_QUICK):
                out[i, j] = W[at(FEATURES + j, l)]
            hint[i] = W[at(FEATURES + N_GEOMETRY + 6, l)] - W[at(FEATURES, l)]
            if W[at(LOOSE, l)] > 0.0:
                loose_lambert_features(l, W, work, out[i])
    return odd
