"""The inputs of the nets for legs with free ends.

`free_path_kernels` finds good excess velocities. With these the leg is one from rest to rest
between moved ends, whose features and hint `feature_kernels` makes: as m* is the largest over all
excess velocities, a small error of theirs hardly matters. Some more features say what the
excess does, and how sure one can be of it.
"""

import math

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.margin.feature_kernels import (
    MAX_REVS,
    N_FEATURES,
    N_GEOMETRY,
    N_NEED,
    FeatureWork,
    clip,
    feature_workspace,
    geometry,
    leg_features,
    log_ratio,
    need,
    to_frame,
)
from feasibility.classifier.margin.free_path_kernels import (
    BALLISTIC,
    BRANCHES,
    N_STARTS,
    ROUNDS,
    SEGMENTS,
    EndsWork,
    bounded_impulse,
    cut_excess,
    ends_workspace,
    find_excess,
    lay_ends,
    lay_first,
    lay_problem,
    local_axes,
    own_excess,
    read_excess,
    to_leg_frame,
    turn_back,
    weigh_alike,
)
from feasibility.classifier.margin.path_kernels import (
    N_NODES,
    SATURATED,
    STRIDE,
    duals,
    impulse_effects,
)
from feasibility.orbits.lambert_kernels import lambert
from feasibility.orbits.mima_kernels import mima_acceleration
from feasibility.runtime.jit import inner_kernel, kernel
from feasibility.sims_flanagan.fast.element_kernels import to_elements

_Array = NDArray[np.float64]
Scratch = tuple[_Array, _Array, _Array]

N_END = 8
N_ENDS = 2 * N_END
N_DUALS = 6
N_COMPARED = ROUNDS + 1 + 3 + MAX_REVS + 1 + 3
N_FREE = N_FEATURES + N_ENDS + N_DUALS + N_COMPARED
N_FREE_QUICK = N_GEOMETRY + N_NEED + N_ENDS + 5
QUICK_SEGMENTS = 12

LEAST_ACCELERATION = 1e-9
"""m/s2: legs that need no more count as needing this. An engine of 0.1 N gives it to 100 000 t."""

_LARGE = 0.7
_AGREED = 0.05
_SHOWN = 10.0
_LEAST_LOG_IMPULSE = -9.0
_FARTHEST = 0.3
# int() at the calls: numba would compile a kernel once for each literal number of steps.
_QUICK_STEPS = 2


@inner_kernel
def end_features(
    bound: float, excess: _Array, state: _Array, total: float, axes: _Array, out: _Array
) -> None:
    """Write N_END features of an end: bound, and excess velocity in the local frame.

    All velocities in the same unit, which is that of the moved departure orbit; `state` is the
    moved one.
    """
    open_end = bound == np.inf
    out[0] = 1.0 if open_end else bound / (1.0 + bound)
    out[1] = 1.0 if open_end else bound / (total + bound)
    out[2] = 1.0 if open_end else 0.0
    size = math.sqrt(excess[0] ** 2 + excess[1] ** 2 + excess[2] ** 2)
    out[3] = 0.0 if open_end or bound == 0.0 else min(size / bound, 1.0)
    out[4] = size / (total + size + 1e-12)
    local_axes(state, state[3:], axes)
    for k in range(3):
        u = axes[k, 0] * excess[0] + axes[k, 1] * excess[1] + axes[k, 2] * excess[2]
        out[5 + k] = clip(u, -3.0, 3.0)


@inner_kernel
def dual_features(
    tof: float,
    bounds: _Array,
    excess: _Array,
    axes: _Array,
    feature_work: FeatureWork,
    out: _Array,
) -> None:
    """Write N_DUALS features of what the dual of the hint says of both ends.

    Its size beside that of the segments, how much of the work the excess does, and the cosine
    of the angle to the excess: 1 at the optimum. The path in `feature_work` is spoilt.
    """
    (path, rows, p, _, g, _, _, anomaly), (s0, s1, x0, x1, _), _, _ = feature_work
    average = 0.0
    for i in range(N_NODES):
        average += g[3 * STRIDE + i] / N_NODES
    for j in range(6):
        path[j * STRIDE] = x0[j]
        path[j * STRIDE + 1] = x1[j]
    anomaly[0] = tof
    anomaly[1] = 0.0
    for j in range(N_DUALS):
        out[j] = 0.0
    if not impulse_effects(path, 2, rows, anomaly):
        return
    duals(rows, p, 2, g)
    for end in range(2):
        state = s0 if end == 0 else s1
        local_axes(state, state[3:], axes)
        size = 0.0
        along = 0.0
        for j in range(3):
            size += excess[end, j] ** 2
            u = 0.0
            for k in range(3):
                u += axes[k, j] * g[k * STRIDE + end]
            along += u * excess[end, j]
        size = math.sqrt(size)
        dual = g[3 * STRIDE + end]
        sign = 1.0 if end == 0 else -1.0
        o = 3 * end
        out[o] = min(dual / average, 4.0)
        bound = 0.0 if bounds[end] == np.inf else bounds[end]
        out[o + 1] = dual * bound / (dual * bound + average)
        out[o + 2] = sign * along / (size * dual) if size * dual > 0.0 else 0.0


@inner_kernel
def compared(best: int, base: float, ends_work: EndsWork, scale: float, out: _Array) -> None:
    """Write N_COMPARED features that compare other estimates with the hint.

    `base` is the logarithm of the hint's impulse, `scale` the velocity unit of `ends_work` in its.
    """
    over, rounds, starts = ends_work[7], ends_work[9], ends_work[10]
    o = 0
    for k in range(ROUNDS + 1):
        out[o + k] = clip(math.log(max(rounds[k], 1e-12) * SEGMENTS * scale) - base, -1.5, 1.5)
    o += ROUNDS + 1
    # The best of each kind of start.
    for kind in range(3):
        first = (0, BRANCHES, N_STARTS - 1)[kind]
        last = (BRANCHES, N_STARTS - 1, N_STARTS)[kind]
        least = SATURATED
        for q in range(first, last):
            least = min(least, starts[q])
        out[o + kind] = log_ratio(max(least, 1e-12) * SEGMENTS * scale, base)
    o += 3
    for revs in range(MAX_REVS + 1):
        least = over[0] if revs == 0 else min(over[2 * revs - 1], over[2 * revs])
        out[o + revs] = log_ratio(max(least, 1e-12) * scale, base)
    o += MAX_REVS + 1
    second = SATURATED
    for q in range(N_STARTS):
        if q != best:
            second = min(second, starts[q])
    out[o] = log_ratio(max(second, 1e-12) * SEGMENTS * scale, base)
    out[o + 1] = 1.0 if best < BRANCHES else 0.0
    out[o + 2] = 1.0


@inner_kernel
def free_leg_features(
    rv_dep: _Array,
    rv_arr: _Array,
    tof_s: float,
    exhaust: float,
    bounds: _Array,
    mu: float,
    ends_work: EndsWork,
    feature_work: FeatureWork,
    scratch: Scratch,
    out: _Array,
    found: _Array,
) -> float:
    """Write the features of one leg; return the logarithm of the best hint, in m/s2.

    Parameters
    ----------
    rv_dep, rv_arr : (6,) float64, m and m/s
    tof_s, exhaust : float, s and m/s
    bounds : (2,) float64, m/s
        Largest excess velocities at departure and arrival, inf allowed.
    mu : float, m3/s2
    ends_work, feature_work : tuples of arrays
        `ends_workspace` and `feature_workspace`.
    scratch : tuple of arrays
        (5, 6) states, (3, 3) axes, (2, 3) excess velocities.
    out : (N_FREE,) float64
        Overwritten.
    found : (6,) float64
        Receives the excess velocities, m/s.

    Returns
    -------
    float
        NaN where no path was found (then `out` is NaN too). Never below the logarithm of
        LEAST_ACCELERATION, which is that of a leg that needs no thrust.
    """
    states, axes, excess = scratch
    s0, s1, moved_dep, moved_arr, scaled = states[0], states[1], states[2], states[3], states[4]
    for j in range(N_FREE):
        out[j] = np.nan
    length = to_leg_frame(rv_dep, rv_arr, mu, axes, s0, s1)
    if not length > 0.0:
        return np.nan
    speed = math.sqrt(mu / length)
    tof, ve = tof_s * speed / length, exhaust / speed
    best = find_excess(s0, s1, tof, ve, bounds[0] / speed, bounds[1] / speed, ends_work)
    if best < 0:
        return np.nan
    best_ends = ends_work[11]
    for end in range(2):
        turn_back(axes, speed, best_ends[end], found[3 * end : 3 * end + 3])
    for j in range(3):
        moved_dep[j], moved_arr[j] = rv_dep[j], rv_arr[j]
        moved_dep[3 + j] = rv_dep[3 + j] + found[j]
        moved_arr[3 + j] = rv_arr[3 + j] + found[3 + j]
    floor = math.log(LEAST_ACCELERATION)
    if best == BALLISTIC:
        # Without thrust there is no dual, and what its features would say is rounding alone.
        for j in range(N_FREE):
            out[j] = 0.0
        return floor
    hint = leg_features(moved_dep, moved_arr, tof_s, exhaust, mu, feature_work, out)
    m0, m1, _, _, _ = feature_work[1]
    a = to_frame(moved_dep, moved_arr, mu, m0, m1)
    if not a > 0.0 or math.isnan(hint):
        # There are no features of such orbits (the last one says so), but there is a hint.
        for j in range(N_FREE):
            out[j] = 0.0
        total = ends_work[9][ROUNDS] * SEGMENTS
        return max(math.log(total / tof * mu / length / length), floor)
    show_within(out)
    unit = math.sqrt(mu / a)
    tof = tof_s * unit / a
    total = math.exp(hint) * tof
    for end in range(2):
        scaled[end] = bounds[end] / unit
        # The excess velocities in the frame of the moved departure orbit.
        body, moved = (rv_dep, m0) if end == 0 else (rv_arr, m1)
        for j in range(3):
            excess[end, j] = moved[3 + j]
        local_frame_velocity(moved_dep, body, unit, axes, excess[end])
    for end in range(2):
        o = N_FEATURES + N_END * end
        moved = m0 if end == 0 else m1
        end_features(scaled[end], excess[end], moved, total, axes, out[o : o + N_END])
    o = N_FEATURES + N_ENDS
    dual_features(tof, scaled, excess, axes, feature_work, out[o : o + N_DUALS])
    compared(best, hint + math.log(tof), ends_work, speed / unit, out[o + N_DUALS :])
    # The mean of both hints where they agree; else mostly the smaller one, as paths that do not
    # suit their leg cost more.
    free = math.log(max(ends_work[9][ROUNDS], 1e-12) * SEGMENTS * speed / unit / tof)
    apart = abs(free - hint)
    hint = 0.5 * (hint + free) - 0.5 * max(0.0, apart - _AGREED)
    return max(hint + math.log(mu / (a * a)), floor)


@inner_kernel
def local_frame_velocity(
    moved: _Array, body: _Array, unit: float, axes: _Array, velocity: _Array
) -> None:
    """Subtract a body's velocity, turned into the frame of the moved departure orbit."""
    local_axes(moved, moved[3:], axes)
    for j in range(3):
        u, v, w = axes[j, 0], axes[j, 1], axes[j, 2]
        velocity[j] -= (u * body[3] + v * body[4] + w * body[5]) / unit


@inner_kernel
def quick_excess(
    s0: _Array, s1: _Array, tof: float, ve: float, dep: float, arr: float, ends_work: EndsWork
) -> float:
    """Write rough excess velocities into `ends` of `ends_work`; return a rough sum of impulses.

    0 where the direct Lambert arc needs none, SATURATED where there is no path.
    """
    path_work, ends, elements, _, _, v1, v2, over, _, _, _, _ = ends_work
    lambert(s0[:3], s1[:3], tof, int(0), 1.0, v1, v2)
    over[0] = SATURATED
    if not math.isnan(v1[0, 0]):
        over[0] = cut_excess(v1[0], s0, dep, ends[2]) + cut_excess(v2[0], s1, arr, ends[3])
        if over[0] == 0.0:
            return 0.0
    guess = min(over[0], _LARGE) / QUICK_SEGMENTS
    for start in range(2):
        if start == 0 and over[0] > _LARGE:
            continue
        if start == 1:
            own_excess(s0, s1, dep, arr, ends)
        if not lay_ends(s0, s1, ends, elements):
            continue
        lay_first(tof, int(0), int(QUICK_SEGMENTS), elements, path_work)
        if not lay_problem(tof, dep, arr, int(QUICK_SEGMENTS), ends, elements, path_work):
            continue
        weigh_alike(guess, dep, arr, int(QUICK_SEGMENTS), path_work)
        z = bounded_impulse(ve, dep, arr, int(QUICK_SEGMENTS), int(_QUICK_STEPS), path_work)
        if not 0.0 < z < SATURATED:
            continue
        for end in range(2):
            body, bound = (s0, dep) if end == 0 else (s1, arr)
            read_excess(end, bound, body, int(QUICK_SEGMENTS), ends_work)
            shorten(body, ends[end], ends[2 + end])
        return z * QUICK_SEGMENTS
    return SATURATED


@inner_kernel
def shorten(body: _Array, before: _Array, excess: _Array) -> None:
    """Move an excess velocity less far from that of a state, where it would go too far."""
    r = math.sqrt(body[0] ** 2 + body[1] ** 2 + body[2] ** 2)
    size = 0.0
    for j in range(3):
        size += (body[3 + j] + excess[j] - before[3 + j]) ** 2
    share = min(1.0, _FARTHEST / math.sqrt(max(size * r, 1e-300)))
    for j in range(3):
        start = before[3 + j] - body[3 + j]
        excess[j] = start + share * (excess[j] - start)


@inner_kernel
def free_quick_features(
    rv_dep: _Array,
    rv_arr: _Array,
    tof_s: float,
    exhaust: float,
    bounds: _Array,
    mu: float,
    ends_work: EndsWork,
    feature_work: FeatureWork,
    scratch: Scratch,
    out: _Array,
) -> float:
    """Write the few features (N_FREE_QUICK,) that cost little; return the log of a rough hint.

    Rough excess velocities, and the first path between the ends that they lead to. Parameters
    and result as for `free_leg_features`.
    """
    path_work, ends, elements, _, _, _, _, over, _, _, _, _ = ends_work
    _, _, p, weights, g, _, d, _ = path_work
    states, axes, _ = scratch
    s0, s1, m0, m1, scaled = states[0], states[1], states[2], states[3], states[4]
    for j in range(N_FREE_QUICK):
        out[j] = np.nan
    length = to_leg_frame(rv_dep, rv_arr, mu, axes, s0, s1)
    if not length > 0.0:
        return np.nan
    speed = math.sqrt(mu / length)
    tof, ve = tof_s * speed / length, exhaust / speed
    dep, arr = bounds[0] / speed, bounds[1] / speed
    total = quick_excess(s0, s1, tof, ve, dep, arr, ends_work)
    # Everything again in the frame of the moved departure orbit.
    if not total < SATURATED or not lay_ends(s0, s1, ends, elements):
        return over_floor(total, out)
    a = to_frame(ends[0], ends[1], 1.0, m0, m1)
    if not a > 0.0:
        return over_floor(total, out)
    unit = math.sqrt(1.0 / a)
    tof *= unit / a
    ve /= unit
    local_axes(ends[0], ends[0, 3:], axes)
    for end in range(2):
        scaled[end] = bounds[end] / speed / unit
        turn(axes, 1.0 / unit, ends[2 + end])
    for j in range(6):
        ends[0, j], ends[1, j] = m0[j], m1[j]
    if not to_elements(m0, elements[0]) or not to_elements(m1, elements[1]):
        return over_floor(total, out)
    near = lay_first(tof, int(0), int(QUICK_SEGMENTS), elements, path_work)
    dep, arr = scaled[0], scaled[1]
    if not lay_problem(tof, dep, arr, int(QUICK_SEGMENTS), ends, elements, path_work):
        return over_floor(total, out)
    guess = max(total / unit, 1e-9) / QUICK_SEGMENTS
    weigh_alike(guess, dep, arr, int(QUICK_SEGMENTS), path_work)
    z = bounded_impulse(ve, dep, arr, int(QUICK_SEGMENTS), int(_QUICK_STEPS), path_work)
    if not 0.0 < z < SATURATED:
        return over_floor(total, out)
    base = math.log(z * QUICK_SEGMENTS)
    geometry(m1, elements[0], elements[1], tof, ve, near, feature_work[1][4], out)
    need(z * QUICK_SEGMENTS, tof, ve, d, p, out)
    show_within(out)
    o = N_GEOMETRY + N_NEED
    for end in range(2):
        end_features(
            scaled[end], ends[2 + end], ends[end], z * QUICK_SEGMENTS, axes, out[o : o + N_END]
        )
        o += N_END
    for end in range(2):
        impulse = weights[QUICK_SEGMENTS + end] * g[3 * STRIDE + QUICK_SEGMENTS + end]
        out[o + end] = min(impulse / (impulse + z * QUICK_SEGMENTS), 1.0)
    out[o + 2] = clip(math.log(max(total / unit, 1e-12)) - base, -1.5, 1.5)
    out[o + 3] = log_ratio(max(over[0] / unit, 1e-12), base)
    left = SATURATED
    if over[0] < SATURATED:
        left = left_acceleration(int(0), s0, s1, bounds, speed, ends_work) / unit
    out[o + 4] = log_ratio(max(left, 1e-12), base)
    floor = math.log(LEAST_ACCELERATION)
    if total == 0.0:
        return floor
    return max(base + math.log(mu / length / length / tof / (a * a)), floor)


@inner_kernel
def left_acceleration(
    b: int, s0: _Array, s1: _Array, bounds: _Array, speed: float, ends_work: EndsWork
) -> float:
    """Return MIMA's acceleration times the flight time, of what the bounds leave of an arc."""
    _, ends, _, _, _, v1, v2, _, _, _, _, _ = ends_work
    cut_excess(v1[b], s0, bounds[0] / speed, ends[2])
    cut_excess(v2[b], s1, bounds[1] / speed, ends[3])
    for j in range(3):
        ends[2, j] = v1[b, j] - s0[3 + j] - ends[2, j]
        ends[3, j] = s1[3 + j] + ends[3, j] - v2[b, j]
    a, _ = mima_acceleration(ends[2, :3], ends[3, :3], 1.0)
    return float(a)


@inner_kernel
def over_floor(left: float, out: _Array) -> float:
    """Return the hint where there are no features: known only where nothing is left to do."""
    if left > 0.0:
        for j in range(N_FREE_QUICK):
            out[j] = np.nan
        return np.nan
    for j in range(N_FREE_QUICK):
        out[j] = 0.0
    return math.log(LEAST_ACCELERATION)


@inner_kernel
def show_within(out: _Array) -> None:
    """Keep the geometry and the impulse within what a net is shown; nearly nothing is nothing."""
    for j in range(N_GEOMETRY):
        out[j] = clip(out[j], -_SHOWN, _SHOWN)
    out[N_GEOMETRY + 6] = max(out[N_GEOMETRY + 6], _LEAST_LOG_IMPULSE)


@inner_kernel
def turn(axes: _Array, scale: float, v: _Array) -> None:
    """Turn a vector into axes, in another unit."""
    x, y, z = v[0], v[1], v[2]
    for j in range(3):
        v[j] = scale * (axes[j, 0] * x + axes[j, 1] * y + axes[j, 2] * z)


@inner_kernel
def scratch_arrays() -> Scratch:
    """Return states, axes and excess velocities."""
    return np.empty((5, 6)), np.empty((3, 3)), np.empty((2, 3))


@kernel
def free_feature_batch(
    rv_dep: _Array,
    rv_arr: _Array,
    tof_s: _Array,
    exhaust: _Array,
    bounds: _Array,
    mu: float,
    out: _Array,
    hint: _Array,
    excess: _Array,
) -> None:
    """Write features (n, N_FREE), log hints (n,) and excess velocities (n, 6) of n legs.

    `bounds` is (n, 2); see `free_leg_features`.
    """
    ends_work, feature_work, scratch = ends_workspace(), feature_workspace(), scratch_arrays()
    for i in range(len(tof_s)):
        excess[i] = np.nan
        hint[i] = free_leg_features(
            rv_dep[i],
            rv_arr[i],
            tof_s[i],
            exhaust[i],
            bounds[i],
            mu,
            ends_work,
            feature_work,
            scratch,
            out[i],
            excess[i],
        )


@kernel
def free_quick_batch(
    rv_dep: _Array,
    rv_arr: _Array,
    tof_s: _Array,
    exhaust: _Array,
    bounds: _Array,
    mu: float,
    out: _Array,
    hint: _Array,
) -> None:
    """Write features (n, N_FREE_QUICK) and log hints (n,) of n legs; see `free_quick_features`."""
    ends_work, feature_work, scratch = ends_workspace(), feature_workspace(), scratch_arrays()
    for i in range(len(tof_s)):
        hint[i] = free_quick_features(
            rv_dep[i],
            rv_arr[i],
            tof_s[i],
            exhaust[i],
            bounds[i],
            mu,
            ends_work,
            feature_work,
            scratch,
            out[i],
        )
