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
    FIRST,
    GUESS,
    IMPULSE,
    LANES,
    LEFT,
    LENGTH,
    LOOSE,
    MIMA,
    MOST,
    NODES,
    ODD,
    OVER,
    PATH,
    RATIO,
    REMAINING,
    ROWS,
    S0,
    S1,
    SCRATCH,
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
    for lane in range(LANES):
        x, y, z = W[at(b, lane)], W[at(b + 1, lane)], W[at(b + 2, lane)]
        u, v, w = W[at(b + 3, lane)], W[at(b + 4, lane)], W[at(b + 5, lane)]
        p, q, s = W[at(b + 6, lane)], W[at(b + 7, lane)], W[at(b + 8, lane)]
        r = math.sqrt(x * x + y * y + z * z)
        far = math.sqrt(p * p + q * q + s * s)
        hx, hy, hz = y * w - z * v, z * u - x * w, x * v - y * u
        h = math.sqrt(hx * hx + hy * hy + hz * hz)
        fine = (r > 0.0) & (far > 0.0) & (h > 0.0)
        W[at(ODD, lane)] = 0.0 if fine else 1.0
        over, over_h = 1.0 / r, 1.0 / h
        x, y, z = x * over, y * over, z * over
        hx, hy, hz = hx * over_h, hy * over_h, hz * over_h
        tx, ty, tz = hy * z - hz * y, hz * x - hx * z, hx * y - hy * x
        length = max(r, far)
        over_length = 1.0 / length
        speed = math.sqrt(mu * over_length)
        over_speed = 1.0 / speed
        W[at(LENGTH, lane)] = length
        W[at(SPEED, lane)] = speed
        W[at(TOF, lane)] *= speed * over_length
        W[at(VE, lane)] *= over_speed
        W[at(DEP, lane)] *= over_speed
        W[at(ARR, lane)] *= over_speed
        for part in range(4):
            unit = over_length if part % 2 == 0 else over_speed
            o = b + 3 * part
            p, q, s = W[at(o, lane)], W[at(o + 1, lane)], W[at(o + 2, lane)]
            W[at(o, lane)] = (p * x + q * y + s * z) * unit
            W[at(o + 1, lane)] = (p * tx + q * ty + s * tz) * unit
            W[at(o + 2, lane)] = (p * hx + q * hy + s * hz) * unit


@lane_kernel
def cut(W: _Array) -> None:
    """Write the excess of Lambert's arc, cut to the bounds, and OVER, what is left of it.

    MIMA gets what MIMA's acceleration times the flight time is for what is left.
    """
    for end in range(2):
        v = V1 + 3 * end
        b = BODY0 + 6 * end + 3
        o = EXCESS0 + 3 * end
        k = SCRATCH + 3 * end
        sign = 1.0 if end == 0 else -1.0
        for lane in range(LANES):
            x, y, z = W[at(v, lane)] - W[at(b, lane)], W[at(v + 1, lane)] - W[at(b + 1, lane)], 0.0
            z = W[at(v + 2, lane)] - W[at(b + 2, lane)]
            size = math.sqrt(x * x + y * y + z * z)
            bound = W[at(DEP + end, lane)]
            within = size <= bound
            share = 1.0 if within else bound / size
            W[at(o, lane)] = x * share
            W[at(o + 1, lane)] = y * share
            W[at(o + 2, lane)] = z * share
            rest = sign * (1.0 - share)
            W[at(k, lane)] = x * rest
            W[at(k + 1, lane)] = y * rest
            W[at(k + 2, lane)] = z * rest
            left = 0.0 if within else size - bound
            W[at(OVER, lane)] = left if end == 0 else W[at(OVER, lane)] + left
    mima(SCRATCH, SCRATCH + 3, MIMA, W)


@lane_kernel
def touching(end: int, lane: int, W: _Array) -> None:
    """Write the excess of an orbit with an apsis at one end, and the other as far as the other."""
    own, other = BODY0 + 6 * end, BODY1 - 6 * end
    o = EXCESS0 + 3 * end
    x, y, z = W[at(own, lane)], W[at(own + 1, lane)], W[at(own + 2, lane)]
    p, q, s = W[at(other, lane)], W[at(other + 1, lane)], W[at(other + 2, lane)]
    u, v, w = W[at(other + 3, lane)], W[at(other + 4, lane)], W[at(other + 5, lane)]
    r = math.sqrt(x * x + y * y + z * z)
    far = math.sqrt(p * p + q * q + s * s)
    hx, hy, hz = q * w - s * v, s * u - p * w, p * v - q * u
    tx, ty, tz = hy * z - hz * y, hz * x - hx * z, hx * y - hy * x
    t = math.sqrt(tx * tx + ty * ty + tz * tz)
    speed = math.sqrt(2.0 / r - 2.0 / (r + far)) / max(t, 1e-12)
    W[at(o, lane)] = tx * speed - W[at(own + 3, lane)]
    W[at(o + 1, lane)] = ty * speed - W[at(own + 4, lane)]
    W[at(o + 2, lane)] = tz * speed - W[at(own + 5, lane)]


@lane_kernel
def begin(W: _Array) -> None:
    """Write the excess velocities of the first path, as `quick_excess` does, and GUESS.

    Those of Lambert's arc, or the bodies' own where that asks for too much.
    """
    for lane in range(LANES):
        over = W[at(OVER, lane)]
        W[at(GUESS, lane)] = min(over, _LARGE) / NODES
        W[at(ODD, lane)] = W[at(ODD, lane)] if over > 0.0 else 1.0
        if over > _LARGE:
            for j in range(6):
                W[at(EXCESS0 + j, lane)] = 0.0
            for end in range(2):
                if W[at(DEP + end, lane)] == np.inf:
                    touching(end, lane, W)
    for j in range(3):
        for lane in range(LANES):
            W[at(S0 + j, lane)] = W[at(BODY0 + j, lane)]
            W[at(S1 + j, lane)] = W[at(BODY1 + j, lane)]
            W[at(S0 + 3 + j, lane)] = W[at(BODY0 + 3 + j, lane)] + W[at(EXCESS0 + j, lane)]
            W[at(S1 + 3 + j, lane)] = W[at(BODY1 + 3 + j, lane)] + W[at(EXCESS1 + j, lane)]


@lane_kernel
def local_axes(end: int, W: _Array) -> None:
    """Write the radial, transverse and normal directions at a state, S0 or S1, as AXES."""
    s = S0 + 6 * end
    for lane in range(LANES):
        x, y, z = W[at(s, lane)], W[at(s + 1, lane)], W[at(s + 2, lane)]
        u, v, w = W[at(s + 3, lane)], W[at(s + 4, lane)], W[at(s + 5, lane)]
        over = 1.0 / math.sqrt(x * x + y * y + z * z)
        hx, hy, hz = y * w - z * v, z * u - x * w, x * v - y * u
        over_h = 1.0 / math.sqrt(hx * hx + hy * hy + hz * hz)
        x, y, z = x * over, y * over, z * over
        hx, hy, hz = hx * over_h, hy * over_h, hz * over_h
        W[at(AXES, lane)] = x
        W[at(AXES + 1, lane)] = y
        W[at(AXES + 2, lane)] = z
        W[at(AXES + 3, lane)] = hy * z - hz * y
        W[at(AXES + 4, lane)] = hz * x - hx * z
        W[at(AXES + 5, lane)] = hx * y - hy * x
        W[at(AXES + 6, lane)] = hx
        W[at(AXES + 7, lane)] = hy
        W[at(AXES + 8, lane)] = hz


@lane_kernel
def add_excess(end: int, W: _Array) -> None:
    """Add to D the effect of a bounded excess velocity at its end."""
    local_axes(end, W)
    sign = 1.0 if end == 0 else -1.0
    e = EXCESS0 + 3 * end
    o = ROWS + NODES + end
    for lane in range(LANES):
        x, y, z = W[at(e, lane)], W[at(e + 1, lane)], W[at(e + 2, lane)]
        bounded = sign if W[at(DEP + end, lane)] < np.inf else 0.0
        for k in range(3):
            a = AXES + 3 * k
            part = x * W[at(a, lane)] + y * W[at(a + 1, lane)] + z * W[at(a + 2, lane)]
            W[at(SCRATCH + k, lane)] = bounded * part
    for lane in range(LANES):
        u, t, n = W[at(SCRATCH, lane)], W[at(SCRATCH + 1, lane)], W[at(SCRATCH + 2, lane)]
        W[at(D, lane)] += W[at(o, lane)] * u + W[at(o + MOST, lane)] * t
        W[at(D + 1, lane)] += (
            W[at(o + 2 * MOST, lane)] * u
            + W[at(o + 3 * MOST, lane)] * t
            + W[at(o + 4 * MOST, lane)] * n
        )
        W[at(D + 2, lane)] += (
            W[at(o + 5 * MOST, lane)] * u
            + W[at(o + 6 * MOST, lane)] * t
            + W[at(o + 7 * MOST, lane)] * n
        )
        W[at(D + 3, lane)] += W[at(o + 8 * MOST, lane)] * n
        W[at(D + 4, lane)] += W[at(o + 9 * MOST, lane)] * n
        W[at(D + 5, lane)] += (
            W[at(o + 10 * MOST, lane)] * u
            + W[at(o + 11 * MOST, lane)] * t
            + W[at(o + 12 * MOST, lane)] * n
        )


@lane_kernel
def weigh_alike(W: _Array) -> None:
    """Write the weights as if all duals were alike, for an impulse of a segment of GUESS."""
    for lane in range(LANES):
        guess = W[at(GUESS, lane)]
        for i in range(NODES):
            W[at(WEIGHTS + i, lane)] = guess
        for end in range(2):
            W[at(WEIGHTS + NODES + end, lane)] = min(W[at(DEP + end, lane)], _STIFF * guess)


@lane_kernel
def weigh(W: _Array) -> None:
    """Write the weights of the segments and of both ends, bounded where a dual nearly vanishes."""
    g = DUALS + 3 * MOST
    for lane in range(LANES):
        mean = 0.0
        for i in range(NODES):
            mean += W[at(g + i, lane)]
        mean *= 1.0 / NODES
        z, least = W[at(IMPULSE, lane)], 0.02 * mean
        for i in range(NODES):
            W[at(WEIGHTS + i, lane)] = z * W[at(RATIO + i, lane)] / max(W[at(g + i, lane)], least)
        stiff = _STIFF * z / mean
        for end in range(2):
            dual = max(W[at(g + NODES + end, lane)], 1e-30)
            W[at(WEIGHTS + NODES + end, lane)] = min(W[at(DEP + end, lane)] / dual, stiff)


@lane_kernel
def bounded_impulse(W: _Array) -> None:
    """Write IMPULSE after two steps, the least one with the excess velocities within bounds."""
    g = DUALS + 3 * MOST
    for step in range(2):
        if step == 1:
            weigh(W)
        weighted_solve(int(MOST), W)
        duals(int(MOST), W)
        for lane in range(LANES):
            own = 0.0
            for i in range(NODES):
                own += W[at(WEIGHTS + i, lane)] * W[at(g + i, lane)] * W[at(g + i, lane)]
            value = own
            for end in range(2):
                bound, size = W[at(DEP + end, lane)], W[at(g + NODES + end, lane)]
                worth = (W[at(WEIGHTS + NODES + end, lane)] * size - bound) * size
                value += worth if bound < np.inf else 0.0
            W[at(ODD, lane)] = W[at(ODD, lane)] if own > 0.0 else 1.0
            W[at(VALUE, lane)] = max(value, _LEAST_SHARE * own)
        balanced_impulse(W)
    for lane in range(LANES):
        z = W[at(IMPULSE, lane)]
        W[at(ODD, lane)] = W[at(ODD, lane)] if (z > 0.0) & (z < SATURATED) else 1.0


@lane_kernel
def solve_ends(W: _Array) -> None:
    """Solve the linear problem on the first path between S0 and S1."""
    elements(W)
    first_path(W)
    for j in range(6):
        for lane in range(LANES):
            W[at(PATH + j * MOST + NODES, lane)] = W[at(X0 + j, lane)]
            W[at(PATH + j * MOST + NODES + 1, lane)] = W[at(X1 + j, lane)]
    for lane in range(LANES):
        W[at(REMAINING + NODES, lane)] = W[at(TOF, lane)]
        W[at(REMAINING + NODES + 1, lane)] = 0.0
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
    for lane in range(LANES):
        scale = sign * W[at(WEIGHTS + i, lane)]
        p = scale * W[at(DUALS + i, lane)]
        q = scale * W[at(DUALS + MOST + i, lane)]
        n = scale * W[at(DUALS + 2 * MOST + i, lane)]
        bound = W[at(DEP + end, lane)]
        # What the state has already.
        hx = W[at(s + 3, lane)] - W[at(b + 3, lane)]
        hy = W[at(s + 4, lane)] - W[at(b + 4, lane)]
        hz = W[at(s + 5, lane)] - W[at(b + 5, lane)]
        beyond = 0.0 if bound < np.inf else 1.0
        x = (
            W[at(AXES, lane)] * p
            + W[at(AXES + 3, lane)] * q
            + W[at(AXES + 6, lane)] * n
            + beyond * hx
        )
        y = (
            W[at(AXES + 1, lane)] * p
            + W[at(AXES + 4, lane)] * q
            + W[at(AXES + 7, lane)] * n
            + beyond * hy
        )
        z = (
            W[at(AXES + 2, lane)] * p
            + W[at(AXES + 5, lane)] * q
            + W[at(AXES + 8, lane)] * n
            + beyond * hz
        )
        size = math.sqrt(x * x + y * y + z * z)
        share = bound / size if size > bound else 1.0
        x, y, z = x * share - hx, y * share - hy, z * share - hz
        rx, ry, rz = W[at(b, lane)], W[at(b + 1, lane)], W[at(b + 2, lane)]
        r = math.sqrt(rx * rx + ry * ry + rz * rz)
        size = x * x + y * y + z * z
        share = min(1.0, _FARTHEST / math.sqrt(max(size * r, 1e-300)))
        W[at(e, lane)] = hx + share * x
        W[at(e + 1, lane)] = hy + share * y
        W[at(e + 2, lane)] = hz + share * z


@lane_kernel
def to_moved_frame(W: _Array) -> None:
    """Move the ends by the excess velocities; then all in the frame of the departure orbit.

    UNIT is its unit of speed, and LEFT its semi-major axis, in those of before.
    """
    for j in range(3):
        for lane in range(LANES):
            W[at(S0 + 3 + j, lane)] = W[at(BODY0 + 3 + j, lane)] + W[at(EXCESS0 + j, lane)]
            W[at(S1 + 3 + j, lane)] = W[at(BODY1 + 3 + j, lane)] + W[at(EXCESS1 + j, lane)]
    local_axes(int(0), W)
    for lane in range(LANES):
        x, y, z = W[at(S0, lane)], W[at(S0 + 1, lane)], W[at(S0 + 2, lane)]
        u, v, w = W[at(S0 + 3, lane)], W[at(S0 + 4, lane)], W[at(S0 + 5, lane)]
        over = 1.0 / math.sqrt(x * x + y * y + z * z)
        energy = 2.0 * over - (u * u + v * v + w * w)
        fine = energy > 1e-3 * over
        W[at(ODD, lane)] = W[at(ODD, lane)] if fine else 1.0
        energy = energy if fine else over
        a = 1.0 / energy
        over_speed = math.sqrt(a)
        unit = 1.0 / over_speed
        W[at(UNIT, lane)] = unit
        W[at(LEFT, lane)] = a
        W[at(TOF, lane)] *= unit * energy
        W[at(VE, lane)] *= over_speed
        W[at(DEP, lane)] *= over_speed
        W[at(ARR, lane)] *= over_speed
        W[at(GUESS, lane)] = max(W[at(TOTAL, lane)] * over_speed, 1e-9) / NODES
    for part in range(6):
        o = S0 + 3 * part if part < 4 else EXCESS0 + 3 * (part - 4)
        for lane in range(LANES):
            over_speed = 1.0 / W[at(UNIT, lane)]
            over_unit = over_speed if (part % 2 == 1) | (part > 3) else 1.0 / W[at(LEFT, lane)]
            x, y, z = W[at(o, lane)], W[at(o + 1, lane)], W[at(o + 2, lane)]
            for k in range(3):
                a = AXES + 3 * k
                turned = x * W[at(a, lane)] + y * W[at(a + 1, lane)] + z * W[at(a + 2, lane)]
                W[at(SCRATCH + k, lane)] = turned * over_unit
        for k in range(3):
            for lane in range(LANES):
                W[at(o + k, lane)] = W[at(SCRATCH + k, lane)]


@lane_kernel
def end_features(end: int, W: _Array) -> None:
    """Write N_END features of an end: bound, and excess velocity in the local frame."""
    local_axes(end, W)
    o = FEATURES + N_GEOMETRY + N_NEED + N_END * end
    e = EXCESS0 + 3 * end
    last = FEATURES + N_GEOMETRY + N_NEED + 2 * N_END + end
    for lane in range(LANES):
        bound, total = W[at(DEP + end, lane)], W[at(TOTAL, lane)]
        open_end = bound == np.inf
        x, y, z = W[at(e, lane)], W[at(e + 1, lane)], W[at(e + 2, lane)]
        size = math.sqrt(x * x + y * y + z * z)
        W[at(o, lane)] = 1.0 if open_end else bound / (1.0 + bound)
        W[at(o + 1, lane)] = 1.0 if open_end else bound / (total + bound)
        W[at(o + 2, lane)] = 1.0 if open_end else 0.0
        W[at(o + 3, lane)] = 0.0 if open_end | (bound == 0.0) else min(size / bound, 1.0)
        W[at(o + 4, lane)] = size / (total + size + 1e-12)
        for k in range(3):
            a = AXES + 3 * k
            u = x * W[at(a, lane)] + y * W[at(a + 1, lane)] + z * W[at(a + 2, lane)]
            W[at(o + 5 + k, lane)] = clip(u, -3.0, 3.0)
        impulse = W[at(WEIGHTS + NODES + end, lane)] * W[at(DUALS + 3 * MOST + NODES + end, lane)]
        W[at(last, lane)] = min(impulse / (impulse + total), 1.0)


@lane_kernel
def compared(W: _Array) -> None:
    """Write the last three features, and keep the others within what a net is shown.

    SIZE receives the hint.
    """
    for j in range(N_GEOMETRY):
        for lane in range(LANES):
            W[at(FEATURES + j, lane)] = clip(W[at(FEATURES + j, lane)], -_SHOWN, _SHOWN)
    o = FEATURES + N_GEOMETRY + N_NEED + 2 * N_END + 2
    for lane in range(LANES):
        base = W[at(FEATURES + N_GEOMETRY + 6, lane)]
        over_unit = 1.0 / W[at(UNIT, lane)]
        first = max(W[at(FIRST, lane)] * over_unit, 1e-12)
        over = max(W[at(OVER, lane)] * over_unit, 1e-12)
        left = max(W[at(MIMA, lane)] * over_unit, 1e-12)
        W[at(o, lane)] = clip(log(first) - base, -1.5, 1.5)
        W[at(o + 1, lane)] = clip(log(over) - base, _LEAST_LOG, _LARGEST_LOG)
        W[at(o + 2, lane)] = clip(log(left) - base, _LEAST_LOG, _LARGEST_LOG)
        # The hint, before the impulse is kept within what is shown.
        scale = W[at(LENGTH, lane)] * W[at(LEFT, lane)] / W[at(SPEED, lane)]
        hint = base - log(W[at(TOF, lane)] * scale * W[at(LEFT, lane)] / W[at(SPEED, lane)])
        W[at(SIZE, lane)] = max(hint, math.log(LEAST_ACCELERATION))
        W[at(FEATURES + N_GEOMETRY + 6, lane)] = max(base, _LEAST_LOG_IMPULSE)


@lane_kernel
def solve_alone(W: _Array, ends_work: EndsWork) -> None:
    """Solve Lambert's problem of the LOOSE legs; those without a solution are ODD."""
    _, ends, _, _, _, v1, v2, _, _, _, _, _ = ends_work
    for lane in range(LANES):
        if W[at(LOOSE, lane)] == 0.0:
            continue
        for j in range(3):
            ends[0, j], ends[1, j] = W[at(S0 + j, lane)], W[at(S1 + j, lane)]
        lambert_alone(ends[0, :3], ends[1, :3], W[at(TOF, lane)], int(0), 1.0, v1, v2)
        for j in range(3):
            W[at(V1 + j, lane)], W[at(V2 + j, lane)] = v1[0, j], v2[0, j]
        if math.isnan(v1[0, 0]):
            W[at(ODD, lane)] = 1.0


@lane_kernel
def free_quick_lanes(mu: float, W: _Array, ends_work: EndsWork) -> None:
    """Write FEATURES of eight legs whose bodies' states, bounds, TOF and VE are given.

    Rough excess velocities, and the first path between the ends that they lead to.
    """
    to_leg_frame(mu, W)
    for j in range(6):
        for lane in range(LANES):
            W[at(S0 + j, lane)] = W[at(BODY0 + j, lane)]
            W[at(S1 + j, lane)] = W[at(BODY1 + j, lane)]
    lambert(W)
    solve_alone(W, ends_work)
    cut(W)
    begin(W)
    solve_ends(W)
    for lane in range(LANES):
        W[at(TOTAL, lane)] = W[at(IMPULSE, lane)] * NODES
    read_excess(int(0), W)
    read_excess(int(1), W)
    to_moved_frame(W)
    for lane in range(LANES):
        W[at(FIRST, lane)] = W[at(TOTAL, lane)]
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
        for lane in range(LANES):
            # The last ones again, where eight are not left.
            i = min(first + lane, n - 1)
            for j in range(6):
                W[at(BODY0 + j, lane)] = rv_dep[i, j]
                W[at(BODY1 + j, lane)] = rv_arr[i, j]
            W[at(TOF, lane)] = tof_s[i]
            W[at(VE, lane)] = exhaust[i]
            W[at(DEP, lane)] = bounds[i, 0]
            W[at(ARR, lane)] = bounds[i, 1]
        free_quick_lanes(mu, W, ends_work)
        for lane in range(min(LANES, n - first)):
            i = first + lane
            if W[at(ODD, lane)] > 0.0:
                odd += 1
                hint[i] = free_quick_features(
                    rv_dep[i], rv_arr[i], tof_s[i], exhaust[i], bounds[i], mu, ends_work,
                    feature_work, scratch, out[i],
                )  # fmt: skip
                continue
            for j in range(N_FREE_QUICK):
                out[i, j] = W[at(FEATURES + j, lane)]
            hint[i] = W[at(SIZE, lane)]
    return odd
