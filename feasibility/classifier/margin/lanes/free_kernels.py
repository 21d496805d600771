"""The quick features of legs with free ends, eight at a time; see `free_feature_kernels`.

What the bounds and excess velocities mean is said in `free_path_kernels`.
"""

import math

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.margin.feature_kernels import (
    N_GEOMETRY,
    N_NEED,
    feature_workspace,
)
from feasibility.classifier.margin.free_feature_kernels import (
    LEAST_ACCELERATION,
    N_END,
    N_FREE_QUICK,
    free_quick_features,
    scratch_arrays,
)
from feasibility.classifier.margin.free_path_kernels import EndsWork, ends_workspace
from feasibility.classifier.margin.lanes.lambert_kernels import lambert, mima
from feasibility.classifier.margin.lanes.layout_kernels import (
    ARR,
    AXES,
    BODY0,
    BODY1,
    DEP,
    DUALS,
    EXCESS0,
    EXCESS1,
    FEATURES,
    GUESS,
    IMPULSE,
    LANES,
    LEFT,
    LENGTH,
    LOOSE,
    MIMA,
    MOST,
    MOVED0,
    MOVED1,
    NODES,
    ODD,
    OVER,
    PATH,
    RATIO,
    REMAINING,
    ROWS,
    S0,
    S1,
    SIZE,
    SPEED,
    TOF,
    TOTAL,
    UNIT,
    V1,
    V2,
    VALUE,
    VE,
    WEIGHTS,
    X0,
    X1,
    D,
    at,
    lane_workspace,
)
from feasibility.classifier.margin.lanes.math_kernels import log
from feasibility.classifier.margin.lanes.path_kernels import (
    balanced_impulse,
    duals,
    elements,
    first_path,
    impulse_effects,
    weighted_solve,
)
from feasibility.classifier.margin.lanes.rendezvous_kernels import clip, coast, geometry, need
from feasibility.classifier.margin.path_kernels import SATURATED
from feasibility.orbits.lambert_kernels import lambert as lambert_alone
from feasibility.runtime.jit import kernel, lane_kernel

_Array = NDArray[np.float64]

_LARGE = 0.7
_STIFF = 1e6
_LEAST_SHARE = 0.5
_FARTHEST = 0.3
_SHOWN = 10.0
_LEAST_LOG_IMPULSE = -9.0
_LEAST_LOG = -1.5
_LARGEST_LOG = 3.0


@lane_kernel
def to_leg_frame(mu: float, W: _Array) -> None:
    """Turn the bodies' states into the frame and the units of the leg; bounds and times too."""
    b = BODY0
    for l in range(LANES):
        x, y, z = W[at(b, l)], W[at(b + 1, l)], W[at(b + 2, l)]
        u, v, w = W[at(b + 3, l)], W[at(b + 4, l)], W[at(b + 5, l)]
        p, q, s = W[at(b + 6, l)], W[at(b + 7, l)], W[at(b + 8, l)]
        r = math.sqrt(x * x + y * y + z * z)
        far = math.sqrt(p * p + q * q + s * s)
        hx, hy, hz = y * w - z * v, z * u - x * w, x * v - y * u
        h = math.sqrt(hx * hx + hy * hy + hz * hz)
        fine = (r > 0.0) & (far > 0.0) & (h > 0.0)
        W[at(ODD, l)] = 0.0 if fine else 1.0
        over, over_h = 1.0 / r, 1.0 / h
        x, y, z = x * over, y * over, z * over
        hx, hy, hz = hx * over_h, hy * over_h, hz * over_h
        tx, ty, tz = hy * z - hz * y, hz * x - hx * z, hx * y - hy * x
        length = max(r, far)
        over_length = 1.0 / length
        speed = math.sqrt(mu * over_length)
        over_speed = 1.0 / speed
        W[at(LENGTH, l)] = length
        W[at(SPEED, l)] = speed
        W[at(TOF, l)] *= speed * over_length
        W[at(VE, l)] *= over_speed
        W[at(DEP, l)] *= over_speed
        W[at(ARR, l)] *= over_speed
        for part in range(4):
            unit = over_length if part % 2 == 0 else over_speed
            o = b + 3 * part
            p, q, s = W[at(o, l)], W[at(o + 1, l)], W[at(o + 2, l)]
            W[at(o, l)] = (p * x + q * y + s * z) * unit
            W[at(o + 1, l)] = (p * tx + q * ty + s * tz) * unit
            W[at(o + 2, l)] = (p * hx + q * hy + s * hz) * unit


@lane_kernel
def cut(W: _Array) -> None:
    """Write the excess of Lambert's arc, cut to the bounds, and OVER, what is left of it.

    MIMA gets what MIMA's acceleration times the flight time is for what is left.
    """
    for end in range(2):
        v = V1 + 3 * end
        b = BODY0 + 6 * end + 3
        o = EXCESS0 + 3 * end
        k = MOVED0 + 3 * end
        sign = 1.0 if end == 0 else -1.0
        for l in range(LANES):
            x, y, z = W[at(v, l)] - W[at(b, l)], W[at(v + 1, l)] - W[at(b + 1, l)], 0.0
            z = W[at(v + 2, l)] - W[at(b + 2, l)]
            size = math.sqrt(x * x + y * y + z * z)
            bound = W[at(DEP + end, l)]
            within = size <= bound
            share = 1.0 if within else bound / size
            W[at(o, l)] = x * share
            W[at(o + 1, l)] = y * share
            W[at(o + 2, l)] = z * share
            rest = sign * (1.0 - share)
            W[at(k, l)] = x * rest
            W[at(k + 1, l)] = y * rest
            W[at(k + 2, l)] = z * rest
            left = 0.0 if within else size - bound
            W[at(OVER, l)] = left if end == 0 else W[at(OVER, l)] + left
    mima(MOVED0, MOVED0 + 3, MIMA, W)


@lane_kernel
def touching(end: int, l: int, W: _Array) -> None:
    """Write the excess of an orbit with an apsis at one end, and the other as far as the other."""
    own, other = BODY0 + 6 * end, BODY1 - 6 * end
    o = EXCESS0 + 3 * end
    x, y, z = W[at(own, l)], W[at(own + 1, l)], W[at(own + 2, l)]
    p, q, s = W[at(other, l)], W[at(other + 1, l)], W[at(other + 2, l)]
    u, v, w = W[at(other + 3, l)], W[at(other + 4, l)], W[at(other + 5, l)]
    r = math.sqrt(x * x + y * y + z * z)
    far = math.sqrt(p * p + q * q + s * s)
    hx, hy, hz = q * w - s * v, s * u - p * w, p * v - q * u
    tx, ty, tz = hy * z - hz * y, hz * x - hx * z, hx * y - hy * x
    t = math.sqrt(tx * tx + ty * ty + tz * tz)
    speed = math.sqrt(2.0 / r - 2.0 / (r + far)) / max(t, 1e-12)
    W[at(o, l)] = tx * speed - W[at(own + 3, l)]
    W[at(o + 1, l)] = ty * speed - W[at(own + 4, l)]
    W[at(o + 2, l)] = tz * speed - W[at(own + 5, l)]


@lane_kernel
def begin(W: _Array) -> None:
    """Write the excess velocities of the first path, as `quick_excess` does, and GUESS.

    Those of Lambert's arc, or the bodies' own where that asks for too much.
    """
    for l in range(LANES):
        over = W[at(OVER, l)]
        W[at(GUESS, l)] = min(over, _LARGE) / NODES
        W[at(ODD, l)] = W[at(ODD, l)] if over > 0.0 else 1.0
        if over > _LARGE:
            for j in range(6):
                W[at(EXCESS0 + j, l)] = 0.0
            for end in range(2):
                if W[at(DEP + end, l)] == np.inf:
                    touching(end, l, W)
    for j in range(3):
        for l in range(LANES):
            W[at(S0 + j, l)] = W[at(BODY0 + j, l)]
            W[at(S1 + j, l)] = W[at(BODY1 + j, l)]
            W[at(S0 + 3 + j, l)] = W[at(BODY0 + 3 + j, l)] + W[at(EXCESS0 + j, l)]
            W[at(S1 + 3 + j, l)] = W[at(BODY1 + 3 + j, l)] + W[at(EXCESS1 + j, l)]


@lane_kernel
def local_axes(end: int, W: _Array) -> None:
    """Write the radial, transverse and normal directions at a state, S0 or S1, as AXES."""
    s = S0 + 6 * end
    for l in range(LANES):
        x, y, z = W[at(s, l)], W[at(s + 1, l)], W[at(s + 2, l)]
        u, v, w = W[at(s + 3, l)], W[at(s + 4, l)], W[at(s + 5, l)]
        over = 1.0 / math.sqrt(x * x + y * y + z * z)
        hx, hy, hz = y * w - z * v, z * u - x * w, x * v - y * u
        over_h = 1.0 / math.sqrt(hx * hx + hy * hy + hz * hz)
        x, y, z = x * over, y * over, z * over
        hx, hy, hz = hx * over_h, hy * over_h, hz * over_h
        W[at(AXES, l)] = x
        W[at(AXES + 1, l)] = y
        W[at(AXES + 2, l)] = z
        W[at(AXES + 3, l)] = hy * z - hz * y
        W[at(AXES + 4, l)] = hz * x - hx * z
        W[at(AXES + 5, l)] = hx * y - hy * x
        W[at(AXES + 6, l)] = hx
        W[at(AXES + 7, l)] = hy
        W[at(AXES + 8, l)] = hz


@lane_kernel
def add_excess(end: int, W: _Array) -> None:
    """Add to D the effect of a bounded excess velocity at its end."""
    local_axes(end, W)
    sign = 1.0 if end == 0 else -1.0
    e = EXCESS0 + 3 * end
    o = ROWS + NODES + end
    for l in range(LANES):
        x, y, z = W[at(e, l)], W[at(e + 1, l)], W[at(e + 2, l)]
        bounded = sign if W[at(DEP + end, l)] < np.inf else 0.0
        for k in range(3):
            a = AXES + 3 * k
            part = x * W[at(a, l)] + y * W[at(a + 1, l)] + z * W[at(a + 2, l)]
            W[at(MOVED0 + k, l)] = bounded * part
    for l in range(LANES):
        u, t, n = W[at(MOVED0, l)], W[at(MOVED0 + 1, l)], W[at(MOVED0 + 2, l)]
        W[at(D, l)] += W[at(o, l)] * u + W[at(o + MOST, l)] * t
        W[at(D + 1, l)] += (
            W[at(o + 2 * MOST, l)] * u + W[at(o + 3 * MOST, l)] * t + W[at(o + 4 * MOST, l)] * n
        )
        W[at(D + 2, l)] += (
            W[at(o + 5 * MOST, l)] * u + W[at(o + 6 * MOST, l)] * t + W[at(o + 7 * MOST, l)] * n
        )
        W[at(D + 3, l)] += W[at(o + 8 * MOST, l)] * n
        W[at(D + 4, l)] += W[at(o + 9 * MOST, l)] * n
        W[at(D + 5, l)] += (
            W[at(o + 10 * MOST, l)] * u + W[at(o + 11 * MOST, l)] * t + W[at(o + 12 * MOST, l)] * n
        )


@lane_kernel
def weigh_alike(W: _Array) -> None:
    """Write the weights as if all duals were alike, for an impulse of a segment of GUESS."""
    for l in range(LANES):
        guess = W[at(GUESS, l)]
        for i in range(NODES):
            W[at(WEIGHTS + i, l)] = guess
        for end in range(2):
            W[at(WEIGHTS + NODES + end, l)] = min(W[at(DEP + end, l)], _STIFF * guess)


@lane_kernel
def weigh(W: _Array) -> None:
    """Write the weights of the segments and of both ends, bounded where a dual nearly vanishes."""
    g = DUALS + 3 * MOST
    for l in range(LANES):
        mean = 0.0
        for i in range(NODES):
            mean += W[at(g + i, l)]
        mean *= 1.0 / NODES
        z, least = W[at(IMPULSE, l)], 0.02 * mean
        for i in range(NODES):
            W[at(WEIGHTS + i, l)] = z * W[at(RATIO + i, l)] / max(W[at(g + i, l)], least)
        stiff = _STIFF * z / mean
        for end in range(2):
            dual = max(W[at(g + NODES + end, l)], 1e-30)
            W[at(WEIGHTS + NODES + end, l)] = min(W[at(DEP + end, l)] / dual, stiff)


@lane_kernel
def bounded_impulse(W: _Array) -> None:
    """Write IMPULSE after two steps, the least one with the excess velocities within bounds."""
    g = DUALS + 3 * MOST
    for step in range(2):
        if step == 1:
            weigh(W)
        weighted_solve(int(MOST), W)
        duals(int(MOST), W)
        for l in range(LANES):
            own = 0.0
            for i in range(NODES):
                own += W[at(WEIGHTS + i, l)] * W[at(g + i, l)] * W[at(g + i, l)]
            value = own
            for end in range(2):
                bound, size = W[at(DEP + end, l)], W[at(g + NODES + end, l)]
                worth = (W[at(WEIGHTS + NODES + end, l)] * size - bound) * size
                value += worth if bound < np.inf else 0.0
            W[at(ODD, l)] = W[at(ODD, l)] if own > 0.0 else 1.0
            W[at(VALUE, l)] = max(value, _LEAST_SHARE * own)
        balanced_impulse(W)
    for l in range(LANES):
        z = W[at(IMPULSE, l)]
        W[at(ODD, l)] = W[at(ODD, l)] if (z > 0.0) & (z < SATURATED) else 1.0


@lane_kernel
def solve_ends(W: _Array) -> None:
    """Solve the linear problem on the first path between S0 and S1."""
    elements(W)
    first_path(W)
    for j in range(6):
        for l in range(LANES):
            W[at(PATH + j * MOST + NODES, l)] = W[at(X0 + j, l)]
            W[at(PATH + j * MOST + NODES + 1, l)] = W[at(X1 + j, l)]
    for l in range(LANES):
        W[at(REMAINING + NODES, l)] = W[at(TOF, l)]
        W[at(REMAINING + NODES + 1, l)] = 0.0
    impulse_effects(int(MOST), W)
    add_excess(int(0), W)
    add_excess(int(1), W)
    weigh_alike(W)
    bounded_impulse(W)


@lane_kernel
def read_excess(end: int, W: _Array) -> None:
    """Write the excess velocity of the last solution at an end, bounded and not too far away."""
    local_axes(end, W)
    s = S0 + 6 * end
    b = BODY0 + 6 * end
    e = EXCESS0 + 3 * end
    i = NODES + end
    sign = 1.0 if end == 0 else -1.0
    for l in range(LANES):
        scale = sign * W[at(WEIGHTS + i, l)]
        p = scale * W[at(DUALS + i, l)]
        q = scale * W[at(DUALS + MOST + i, l)]
        n = scale * W[at(DUALS + 2 * MOST + i, l)]
        bound = W[at(DEP + end, l)]
        # What the state has already.
        hx = W[at(s + 3, l)] - W[at(b + 3, l)]
        hy = W[at(s + 4, l)] - W[at(b + 4, l)]
        hz = W[at(s + 5, l)] - W[at(b + 5, l)]
        beyond = 0.0 if bound < np.inf else 1.0
        x = W[at(AXES, l)] * p + W[at(AXES + 3, l)] * q + W[at(AXES + 6, l)] * n + beyond * hx
        y = W[at(AXES + 1, l)] * p + W[at(AXES + 4, l)] * q + W[at(AXES + 7, l)] * n + beyond * hy
        z = W[at(AXES + 2, l)] * p + W[at(AXES + 5, l)] * q + W[at(AXES + 8, l)] * n + beyond * hz
        size = math.sqrt(x * x + y * y + z * z)
        share = bound / size if size > bound else 1.0
        x, y, z = x * share - hx, y * share - hy, z * share - hz
        rx, ry, rz = W[at(b, l)], W[at(b + 1, l)], W[at(b + 2, l)]
        r = math.sqrt(rx * rx + ry * ry + rz * rz)
        size = x * x + y * y + z * z
        share = min(1.0, _FARTHEST / math.sqrt(max(size * r, 1e-300)))
        W[at(e, l)] = hx + share * x
        W[at(e + 1, l)] = hy + share * y
        W[at(e + 2, l)] = hz + share * z


@lane_kernel
def to_moved_frame(W: _Array) -> None:
    """Move the ends by the excess velocities; then all in the frame of the departure orbit.

    UNIT is its unit of speed, and LEFT its semi-major axis, in those of before.
    """
    for j in range(3):
        for l in range(LANES):
            W[at(S0 + 3 + j, l)] = W[at(BODY0 + 3 + j, l)] + W[at(EXCESS0 + j, l)]
            W[at(S1 + 3 + j, l)] = W[at(BODY1 + 3 + j, l)] + W[at(EXCESS1 + j, l)]
    local_axes(int(0), W)
    for l in range(LANES):
        x, y, z = W[at(S0, l)], W[at(S0 + 1, l)], W[at(S0 + 2, l)]
        u, v, w = W[at(S0 + 3, l)], W[at(S0 + 4, l)], W[at(S0 + 5, l)]
        over = 1.0 / math.sqrt(x * x + y * y + z * z)
        energy = 2.0 * over - (u * u + v * v + w * w)
        fine = energy > 1e-3 * over
        W[at(ODD, l)] = W[at(ODD, l)] if fine else 1.0
        energy = energy if fine else over
        a = 1.0 / energy
        over_speed = math.sqrt(a)
        unit = 1.0 / over_speed
        W[at(UNIT, l)] = unit
        W[at(LEFT, l)] = a
        W[at(TOF, l)] *= unit * energy
        W[at(VE, l)] *= over_speed
        W[at(DEP, l)] *= over_speed
        W[at(ARR, l)] *= over_speed
        W[at(GUESS, l)] = max(W[at(TOTAL, l)] * over_speed, 1e-9) / NODES
    for part in range(6):
        o = S0 + 3 * part if part < 4 else EXCESS0 + 3 * (part - 4)
        for l in range(LANES):
            over_speed = 1.0 / W[at(UNIT, l)]
            over_unit = over_speed if (part % 2 == 1) | (part > 3) else 1.0 / W[at(LEFT, l)]
            x, y, z = W[at(o, l)], W[at(o + 1, l)], W[at(o + 2, l)]
            for k in range(3):
                a = AXES + 3 * k
                turned = x * W[at(a, l)] + y * W[at(a + 1, l)] + z * W[at(a + 2, l)]
                W[at(MOVED0 + k, l)] = turned * over_unit
        for k in range(3):
            for l in range(LANES):
                W[at(o + k, l)] = W[at(MOVED0 + k, l)]


@lane_kernel
def end_features(end: int, W: _Array) -> None:
    """Write N_END features of an end: bound, and excess velocity in the local frame."""
    local_axes(end, W)
    o = FEATURES + N_GEOMETRY + N_NEED + N_END * end
    e = EXCESS0 + 3 * end
    last = FEATURES + N_GEOMETRY + N_NEED + 2 * N_END + end
    for l in range(LANES):
        bound, total = W[at(DEP + end, l)], W[at(TOTAL, l)]
        open_end = bound == np.inf
        x, y, z = W[at(e, l)], W[at(e + 1, l)], W[at(e + 2, l)]
        size = math.sqrt(x * x + y * y + z * z)
        W[at(o, l)] = 1.0 if open_end else bound / (1.0 + bound)
        W[at(o + 1, l)] = 1.0 if open_end else bound / (total + bound)
        W[at(o + 2, l)] = 1.0 if open_end else 0.0
        W[at(o + 3, l)] = 0.0 if open_end | (bound == 0.0) else min(size / bound, 1.0)
        W[at(o + 4, l)] = size / (total + size + 1e-12)
        for k in range(3):
            a = AXES + 3 * k
            u = x * W[at(a, l)] + y * W[at(a + 1, l)] + z * W[at(a + 2, l)]
            W[at(o + 5 + k, l)] = clip(u, -3.0, 3.0)
        impulse = W[at(WEIGHTS + NODES + end, l)] * W[at(DUALS + 3 * MOST + NODES + end, l)]
        W[at(last, l)] = min(impulse / (impulse + total), 1.0)


@lane_kernel
def compared(W: _Array) -> None:
    """Write the last three features, and keep the others within what a net is shown.

    SIZE has the first total, in the unit of before.
    """
    for j in range(N_GEOMETRY):
        for l in range(LANES):
            W[at(FEATURES + j, l)] = clip(W[at(FEATURES + j, l)], -_SHOWN, _SHOWN)
    o = FEATURES + N_GEOMETRY + N_NEED + 2 * N_END + 2
    for l in range(LANES):
        base = W[at(FEATURES + N_GEOMETRY + 6, l)]
        over_unit = 1.0 / W[at(UNIT, l)]
        first = max(W[at(MOVED1, l)] * over_unit, 1e-12)
        over = max(W[at(OVER, l)] * over_unit, 1e-12)
        left = max(W[at(MIMA, l)] * over_unit, 1e-12)
        W[at(o, l)] = clip(log(first) - base, -1.5, 1.5)
        W[at(o + 1, l)] = clip(log(over) - base, _LEAST_LOG, _LARGEST_LOG)
        W[at(o + 2, l)] = clip(log(left) - base, _LEAST_LOG, _LARGEST_LOG)
        # The hint, before the impulse is kept within what is shown.
        scale = W[at(LENGTH, l)] * W[at(LEFT, l)] / W[at(SPEED, l)]
        hint = base - log(W[at(TOF, l)] * scale * W[at(LEFT, l)] / W[at(SPEED, l)])
        W[at(SIZE, l)] = max(hint, math.log(LEAST_ACCELERATION))
        W[at(FEATURES + N_GEOMETRY + 6, l)] = max(base, _LEAST_LOG_IMPULSE)


@lane_kernel
def solve_alone(W: _Array, ends_work: EndsWork) -> None:
    """Solve Lambert's problem of the LOOSE legs; those without a solution are ODD."""
    _, ends, _, _, _, v1, v2, _, _, _, _, _ = ends_work
    for l in range(LANES):
        if W[at(LOOSE, l)] == 0.0:
            continue
        for j in range(3):
            ends[0, j], ends[1, j] = W[at(S0 + j, l)], W[at(S1 + j, l)]
        lambert_alone(ends[0, :3], ends[1, :3], W[at(TOF, l)], int(0), 1.0, v1, v2)
        for j in range(3):
            W[at(V1 + j, l)], W[at(V2 + j, l)] = v1[0, j], v2[0, j]
        if math.isnan(v1[0, 0]):
            W[at(ODD, l)] = 1.0


@lane_kernel
def free_quick_lanes(mu: float, W: _Array, ends_work: EndsWork) -> None:
    """Write FEATURES of eight legs whose bodies' states, bounds, TOF and VE are given."""
    to_leg_frame(mu, W)
    for j in range(6):
        for l in range(LANES):
            W[at(S0 + j, l)] = W[at(BODY0 + j, l)]
            W[at(S1 + j, l)] = W[at(BODY1 + j, l)]
    lambert(W)
    solve_alone(W, ends_work)
    cut(W)
    begin(W)
    solve_ends(W)
    for l in range(LANES):
        W[at(TOTAL, l)] = W[at(IMPULSE, l)] * NODES
    read_excess(int(0), W)
    read_excess(int(1), W)
    to_moved_frame(W)
    for l in range(LANES):
        W[at(MOVED1, l)] = W[at(TOTAL, l)]
    solve_ends(W)
    coast(W)
    geometry(W)
    need(W)
    end_features(int(0), W)
    end_features(int(1), W)
    compared(W)


@kernel
def free_quick_lane_batch(
    rv_dep: _Array,
    rv_arr: _Array,
    tof_s: _Array,
    exhaust: _Array,
    bounds: _Array,
    mu: float,
    out: _Array,
    hint: _Array,
) -> int:
    """Write features (n, N_FREE_QUICK) and log hints (n,) of n legs; return how many were ODD.

    See `free_feature_kernels.free_quick_features`, which the odd ones get.
    """
    W = lane_workspace()
    ends_work, feature_work, scratch = ends_workspace(), feature_workspace(), scratch_arrays()
    n = len(tof_s)
    odd = 0
    for first in range(0, n, LANES):
        for l in range(LANES):
            # The last ones again, where eight are not left.
            i = min(first + l, n - 1)
            for j in range(6):
                W[at(BODY0 + j, l)] = rv_dep[i, j]
                W[at(BODY1 + j, l)] = rv_arr[i, j]
            W[at(TOF, l)] = tof_s[i]
            W[at(VE, l)] = exhaust[i]
            W[at(DEP, l)] = bounds[i, 0]
            W[at(ARR, l)] = bounds[i, 1]
        free_quick_lanes(mu, W, ends_work)
        for l in range(min(LANES, n - first)):
            i = first + l
            if W[at(ODD, l)] > 0.0:
                odd += 1
                hint[i] = free_quick_features(
                    rv_dep[i], rv_arr[i], tof_s[i], exhaust[i], bounds[i], mu, ends_work,
                    feature_work, scratch, out[i],
                )  # fmt: skip
                continue
            for j in range(N_FREE_QUICK):
                out[i, j] = W[at(FEATURES + j, l)]
            hint[i] = W[at(SIZE, l)]
    return odd
