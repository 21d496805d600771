"""The excess velocities of a leg with free ends, and how much thrust is then left to do.

The excess velocities are two more impulses of the linear problem of `path_kernels`, at the ends
of the path, whose bounds cost nothing:

    sum_i C_i u_i + C_dep w_dep - C_arr w_arr = d,   |u_i| <= z c_i,  |w_dep| <= V_dep,
    |w_arr| <= V_arr.

The smallest z is the largest value over p of

    (p . d - V_dep |C_dep^T p| - V_arr |C_arr^T p|) / sum_i c_i |C_i^T p|,

by reweighted least squares again, with weights z c_i / |C_i^T p| and V / |C^T p|. An end without
a bound has a weight beside which the others vanish, so that p has no effect there, and d is taken
from the last excess velocity. After each round the path begins and ends with the excess
velocities found, and d is exact for these.

The first path is one of several: Lambert's arcs, on which two impulses at the ends are exact, and
paths in element space, from the bodies' own velocities (at an end without bound: from that of an
orbit that touches there), or from those of the best Lambert arc, cut to the bounds.

The nodes of a path are the segments' centres, followed by both ends. Units: gravitational
parameter 1, the larger distance from it 1; axes: departure position and orbital plane of the
departure body.
"""

import math

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.margin.feature_kernels import MAX_REVS, add_impulse
from feasibility.classifier.margin.path_kernels import (
    SATURATED,
    STRIDE,
    PathWork,
    balanced_impulse,
    duals,
    first_path,
    flown_path,
    impulse_effects,
    weighted_solve,
    workspace,
)
from feasibility.orbits.lambert_kernels import lambert
from feasibility.runtime.jit import inner_kernel
from feasibility.sims_flanagan.fast.element_kernels import to_elements

_Array = NDArray[np.float64]
EndsWork = tuple[
    PathWork,
    _Array,
    _Array,
    _Array,
    _Array,
    _Array,
    _Array,
    _Array,
    _Array,
    _Array,
    _Array,
    _Array,
]

SEGMENTS = 16
"""Fewer than the legs have: the excess velocities hardly depend on it."""

BRANCHES = 1 + 2 * MAX_REVS
N_STARTS = BRANCHES + 4
ROUNDS = 6
BALLISTIC = 100

_DEP = SEGMENTS
_ARR = SEGMENTS + 1
_NODES = SEGMENTS + 2
_TWO_PI = 2.0 * math.pi
_STIFF = 1e6
_DAMPING = 0.65
_LEAST_MOTION = 0.3
_LEAST_SHARE = 0.5
_TYPICAL_IMPULSE = 0.1
_SLOWEST = 0.3
# int() at the calls: numba would compile a kernel once for each literal number of steps.
_FIRST_STEPS = 3
_NEXT_STEPS = 2
_NEEDED_ROUNDS = 2
_CONVERGED = 1e-5
_NEARLY_CONVERGED = 1e-3
_ALIKE = 1e-3


@inner_kernel
def to_leg_frame(
    rv_dep: _Array, rv_arr: _Array, mu: float, axes: _Array, s0: _Array, s1: _Array
) -> float:
    """Write both states in the frame of the leg, and its axes; return its unit of length in m.

    0 where the departure body has no orbital plane.
    """
    x, y, z = rv_dep[0], rv_dep[1], rv_dep[2]
    vx, vy, vz = rv_dep[3], rv_dep[4], rv_dep[5]
    r = math.sqrt(x * x + y * y + z * z)
    far = math.sqrt(rv_arr[0] ** 2 + rv_arr[1] ** 2 + rv_arr[2] ** 2)
    hx, hy, hz = y * vz - z * vy, z * vx - x * vz, x * vy - y * vx
    h = math.sqrt(hx * hx + hy * hy + hz * hz)
    if not (r > 0.0 and far > 0.0 and h > 0.0):
        return 0.0
    local_axes(rv_dep, rv_dep[3:], axes)
    length = max(r, far)
    speed = math.sqrt(mu / length)
    for part in range(2):
        unit = length if part == 0 else speed
        o = 3 * part
        for j in range(3):
            u, v, w = axes[j, 0], axes[j, 1], axes[j, 2]
            s0[o + j] = (u * rv_dep[o] + v * rv_dep[o + 1] + w * rv_dep[o + 2]) / unit
            s1[o + j] = (u * rv_arr[o] + v * rv_arr[o + 1] + w * rv_arr[o + 2]) / unit
    return length


@inner_kernel
def local_axes(r: _Array, v: _Array, axes: _Array) -> None:
    """Write the radial, transverse and normal directions (3, 3) at a position and velocity."""
    x, y, z = r[0], r[1], r[2]
    size = math.sqrt(x * x + y * y + z * z)
    hx, hy, hz = y * v[2] - z * v[1], z * v[0] - x * v[2], x * v[1] - y * v[0]
    h = math.sqrt(hx * hx + hy * hy + hz * hz)
    x, y, z = x / size, y / size, z / size
    hx, hy, hz = hx / h, hy / h, hz / h
    axes[0, 0], axes[0, 1], axes[0, 2] = x, y, z
    axes[1, 0], axes[1, 1], axes[1, 2] = hy * z - hz * y, hz * x - hx * z, hx * y - hy * x
    axes[2, 0], axes[2, 1], axes[2, 2] = hx, hy, hz


@inner_kernel
def turn_back(axes: _Array, scale: float, v: _Array, out: _Array) -> None:
    """Write a vector given in the frame of the leg as it is outside, in another unit."""
    for j in range(3):
        out[j] = scale * (axes[0, j] * v[0] + axes[1, j] * v[1] + axes[2, j] * v[2])


@inner_kernel
def cut_excess(v: _Array, own: _Array, bound: float, excess: _Array) -> float:
    """Write the excess of v over the velocity of a state, cut; return how much is left."""
    size = 0.0
    for j in range(3):
        excess[j] = v[j] - own[3 + j]
        size += excess[j] * excess[j]
    size = math.sqrt(size)
    if size <= bound:
        return 0.0
    for j in range(3):
        excess[j] *= bound / size
    return size - bound


@inner_kernel
def weigh(
    g: _Array, c: _Array, z: float, dep: float, arr: float, segments: int, weights: _Array
) -> None:
    """Write the weights of the segments and of both ends, bounded where a dual nearly vanishes."""
    mean = 0.0
    for i in range(segments):
        mean += g[3 * STRIDE + i]
    mean /= segments
    for i in range(segments):
        weights[i] = z * c[i] / max(g[3 * STRIDE + i], 0.02 * mean)
    stiff = _STIFF * z / mean
    for end in range(2):
        i = segments + end
        bound = dep if end == 0 else arr
        weights[i] = min(bound / max(g[3 * STRIDE + i], 1e-30), stiff)


@inner_kernel
def weigh_alike(guess: float, dep: float, arr: float, segments: int, path_work: PathWork) -> None:
    """Write the weights as if all duals were alike, for an impulse of a segment of `guess`."""
    weights, c = path_work[3], path_work[5]
    for i in range(segments):
        c[i] = 1.0
        weights[i] = guess
    weights[segments] = min(dep, _STIFF * guess)
    weights[segments + 1] = min(arr, _STIFF * guess)


@inner_kernel
def bounded_impulse(
    ve: float, dep: float, arr: float, segments: int, steps: int, path_work: PathWork
) -> float:
    """Return z: the least impulse of the first segment, with excess velocities within bounds.

    The weights of the first step are given. 0 where the problem is singular.
    """
    _, rows, p, weights, g, c, d, _ = path_work
    z = 0.0
    for step in range(steps):
        if not weighted_solve(rows, weights, d, segments + 2, p):
            return 0.0
        duals(rows, p, segments + 2, g)
        own = 0.0
        for i in range(segments):
            own += weights[i] * g[3 * STRIDE + i] ** 2
        value = own
        for end in range(2):
            bound = dep if end == 0 else arr
            if bound < np.inf:
                size = g[3 * STRIDE + segments + end]
                value += (weights[segments + end] * size - bound) * size
        if not own > 0.0:
            return 0.0
        # While the excess is far from its optimum the bound may be worth nothing.
        z = balanced_impulse(max(value, _LEAST_SHARE * own), g, ve, segments, c)
        if step < steps - 1:
            weigh(g, c, z, dep, arr, segments, weights)
    return z


@inner_kernel
def read_excess(end: int, bound: float, own: _Array, segments: int, work: EndsWork) -> None:
    """Write the excess velocity that the last solution has at an end, within its bound."""
    path_work, ends, _, _, local, _, _, _, _, _, _, _ = work
    weights, g = path_work[3], path_work[4]
    state, excess = ends[end], ends[2 + end]
    i = segments + end
    scale = weights[i] if end == 0 else -weights[i]
    local_axes(state, state[3:], local)
    size = 0.0
    for j in range(3):
        u = 0.0
        for k in range(3):
            u += local[k, j] * g[k * STRIDE + i]
        excess[j] = scale * u
        if bound == np.inf:
            excess[j] += state[3 + j] - own[3 + j]
        size += excess[j] * excess[j]
    size = math.sqrt(size)
    if size > bound:
        for j in range(3):
            excess[j] *= bound / size


@inner_kernel
def move_part(own: _Array, state: _Array, excess: _Array) -> None:
    """Move an excess velocity back to a part of the way from that of the state."""
    for j in range(3):
        before = state[3 + j] - own[3 + j]
        excess[j] = before + _DAMPING * (excess[j] - before)


@inner_kernel
def lay_rows(tof: float, segments: int, path_work: PathWork) -> bool:
    """Write the rows of the segments and both ends; return False off the ellipses."""
    path, rows, _, _, _, _, _, anomaly = path_work
    for i in range(segments):
        anomaly[i] = tof * (1.0 - (i + 0.5) / segments)
    anomaly[segments] = tof
    anomaly[segments + 1] = 0.0
    return impulse_effects(path, segments + 2, rows, anomaly)


@inner_kernel
def bound(s: _Array, excess: _Array) -> bool:
    """Return whether a body with an excess velocity is on an ellipse."""
    speed2 = (s[3] + excess[0]) ** 2 + (s[4] + excess[1]) ** 2 + (s[5] + excess[2]) ** 2
    return bool(2.0 / math.sqrt(s[0] * s[0] + s[1] * s[1] + s[2] * s[2]) - speed2 > 1e-6)


@inner_kernel
def lay_departure(s0: _Array, ends: _Array, elements: _Array) -> bool:
    """Write the departure with its excess and its elements; return False off the ellipses."""
    for j in range(3):
        ends[0, j] = s0[j]
        ends[0, 3 + j] = s0[3 + j] + ends[2, j]
    return to_elements(ends[0], elements[0])


@inner_kernel
def lay_ends(s0: _Array, s1: _Array, ends: _Array, elements: _Array) -> bool:
    """Write the states with excess and their elements; return False off the ellipses."""
    for j in range(3):
        ends[1, j] = s1[j]
        ends[1, 3 + j] = s1[3 + j] + ends[3, j]
    return lay_departure(s0, ends, elements) and to_elements(ends[1], elements[1])


@inner_kernel
def lay_problem(
    tof: float,
    dep: float,
    arr: float,
    segments: int,
    ends: _Array,
    elements: _Array,
    path_work: PathWork,
) -> bool:
    """Write rows and d of the path, between the ends laid; return False off the ellipses."""
    path, rows, _, _, _, _, d, _ = path_work
    for end in range(2):
        for j in range(6):
            path[j * STRIDE + segments + end] = elements[end, j]
    if not lay_rows(tof, segments, path_work):
        return False
    for j in range(5):
        d[j] = elements[1, j] - elements[0, j]
    d[5] = elements[1, 5] - elements[0, 5] - elements[0, 0] * tof
    if dep < np.inf:
        add_impulse(ends[0], ends[0, 3:], ends[2], rows, segments, d)
    if arr < np.inf:
        for j in range(3):
            ends[4, j] = -ends[3, j]
        add_impulse(ends[1], ends[1, 3:], ends[4], rows, segments + 1, d)
    return True


@inner_kernel
def lay_lambert(
    b: int, s0: _Array, s1: _Array, tof: float, dep: float, arr: float, work: EndsWork
) -> bool:
    """Write path, rows and d of a Lambert arc; return whether there is one, and an ellipse."""
    path_work, ends, elements, _, _, v1, v2, _, _, _, _, _ = work
    path, rows, _, _, _, _, d, _ = path_work
    if math.isnan(v1[b, 0]):
        return False
    for j in range(3):
        ends[0, j], ends[0, 3 + j] = s0[j], v1[b, j]
        ends[1, j], ends[1, 3 + j] = s1[j], v2[b, j]
    x = elements[0]
    if not to_elements(ends[0], x):
        return False
    for i in range(_NODES):
        for j in range(5):
            path[j * STRIDE + i] = x[j]
    for i in range(SEGMENTS):
        path[5 * STRIDE + i] = x[5] + x[0] * tof * (i + 0.5) / SEGMENTS
    path[5 * STRIDE + _DEP] = x[5]
    path[5 * STRIDE + _ARR] = x[5] + x[0] * tof
    if not lay_rows(tof, int(SEGMENTS), path_work):
        return False
    for j in range(6):
        d[j] = 0.0
    for j in range(3):
        ends[2, j] = v1[b, j] - s0[3 + j]
        ends[3, j] = s1[3 + j] - v2[b, j]
    if dep < np.inf:
        add_impulse(ends[0], ends[0, 3:], ends[2], rows, int(_DEP), d)
    if arr < np.inf:
        add_impulse(ends[1], ends[1, 3:], ends[3], rows, int(_ARR), d)
    return True


@inner_kernel
def touching_excess(own: _Array, other: _Array, excess: _Array) -> None:
    """Write the excess of an orbit with an apsis here, and the other as far as the other end.

    In the plane through this position that is nearest to the other's orbital plane.
    """
    r = math.sqrt(own[0] ** 2 + own[1] ** 2 + own[2] ** 2)
    far = math.sqrt(other[0] ** 2 + other[1] ** 2 + other[2] ** 2)
    hx = other[1] * other[5] - other[2] * other[4]
    hy = other[2] * other[3] - other[0] * other[5]
    hz = other[0] * other[4] - other[1] * other[3]
    tx, ty, tz = hy * own[2] - hz * own[1], hz * own[0] - hx * own[2], hx * own[1] - hy * own[0]
    t = math.sqrt(tx * tx + ty * ty + tz * tz)
    speed = math.sqrt(2.0 / r - 2.0 / (r + far)) / max(t, 1e-12)
    excess[0] = tx * speed - own[3]
    excess[1] = ty * speed - own[4]
    excess[2] = tz * speed - own[5]


@inner_kernel
def own_excess(s0: _Array, s1: _Array, dep: float, arr: float, ends: _Array) -> None:
    """Write the excess velocities of paths from the bodies' own orbits: 0, if there are bounds."""
    for j in range(3):
        ends[2, j] = 0.0
        ends[3, j] = 0.0
    if arr == np.inf:
        touching_excess(s1, s0, ends[3])
    if dep == np.inf:
        touching_excess(s0, s1, ends[2])


@inner_kernel
def lay_start(
    q: int, s0: _Array, s1: _Array, tof: float, dep: float, arr: float, work: EndsWork
) -> bool:
    """Write path, rows and d of the q-th start; return whether there is one."""
    path_work, ends, elements, _, _, v1, v2, _, _, _, _, _ = work
    if q < BRANCHES:
        return lay_lambert(q, s0, s1, tof, dep, arr, work)
    beside = (0, 1, -1, 0)[q - BRANCHES]
    if q == N_STARTS - 1:
        best = cheapest_branch(s0, s1, dep, arr, work)
        if best < 0:
            return False
        cut_excess(v1[best], s0, dep, ends[2])
        cut_excess(v2[best], s1, arr, ends[3])
    else:
        own_excess(s0, s1, dep, arr, ends)
    if not lay_ends(s0, s1, ends, elements):
        return False
    lay_first(tof, beside, int(SEGMENTS), elements, path_work)
    return lay_problem(tof, dep, arr, int(SEGMENTS), ends, elements, path_work)


@inner_kernel
def lay_first(
    tof: float, beside: int, segments: int, elements: _Array, path_work: PathWork
) -> float:
    """Write the first path between two ends; return by how much it goes beyond the mean motion.

    `beside` is the number of revolutions, counted from the nearest one.
    """
    x0, x1 = elements[0], elements[1]
    mean = 0.5 * tof * (x0[0] + x1[0])
    x1[5] -= _TWO_PI * (np.rint((x1[5] - x0[5] - mean) / _TWO_PI) - beside)
    excess = x1[5] - x0[5] - mean
    least = _LEAST_MOTION if beside == 0 else 0.0
    first_path(x0, x1, tof, excess, least, segments, path_work[0])
    return float(excess)


@inner_kernel
def cheapest_branch(s0: _Array, s1: _Array, dep: float, arr: float, work: EndsWork) -> int:
    """Return the Lambert arc that the excess velocities leave least of, -1 for none.

    The sums of impulses that are left are written.
    """
    _, ends, _, _, _, v1, v2, over, _, _, _, _ = work
    best = -1
    for b in range(BRANCHES):
        over[b] = SATURATED
        if not math.isnan(v1[b, 0]):
            over[b] = cut_excess(v1[b], s0, dep, ends[2]) + cut_excess(v2[b], s1, arr, ends[3])
            if best < 0 or over[b] < over[best]:
                best = b
    return best


@inner_kernel
def lag(k: int) -> float:
    """Return how far behind the best one a start may be before its k-th round."""
    return (2.0, 1.4, 1.2, 1.08, 1.02, 1.02)[k - 1]


@inner_kernel
def pursue(
    q: int,
    rival: float,
    s0: _Array,
    s1: _Array,
    tof: float,
    ve: float,
    dep: float,
    arr: float,
    work: EndsWork,
) -> float:
    """Return z after ROUNDS rounds from the q-th start, with the excess velocities in `ends`.

    SATURATED where it has no path or leaves the ellipses; sooner where it lags behind `rival`,
    the best z so far, comes to the same path as that one, or has converged. `z_rounds` holds the
    z of each round.
    """
    path_work, ends, elements, flown, _, _, _, over, z_rounds, _, _, _ = work
    path, rows, p, weights, g, c, _, _ = path_work
    before = ends[5:]
    if not lay_start(q, s0, s1, tof, dep, arr, work):
        return SATURATED
    guess = _TYPICAL_IMPULSE / SEGMENTS
    if q < BRANCHES:
        guess = max(over[q], 1e-9) / SEGMENTS
    weigh_alike(guess, dep, arr, int(SEGMENTS), path_work)
    z = bounded_impulse(ve, dep, arr, int(SEGMENTS), int(_FIRST_STEPS), path_work)
    if not 0.0 < z < SATURATED:
        return SATURATED
    z_rounds[0] = z
    for k in range(1, ROUNDS + 1):
        z_rounds[k] = z
    for k in range(1, ROUNDS + 1):
        if z > lag(k) * rival:
            return z
        if k > _NEEDED_ROUNDS:
            change = abs(z - z_rounds[k - 2])
            if change < _CONVERGED * z:
                break
            if change < _NEARLY_CONVERGED * z and abs(z - rival) < _ALIKE * rival:
                return max(z, rival)
        read_excess(int(0), dep, s0, int(SEGMENTS), work)
        read_excess(int(1), arr, s1, int(SEGMENTS), work)
        for j in range(6):
            before[0, j], before[1, j] = ends[0, j], ends[1, j]
        bound_path = bound(s1, ends[3]) and lay_departure(s0, ends, elements)
        if bound_path:
            flown_path(elements[0], rows, weights, g, tof, int(SEGMENTS), flown)
        move_part(s0, before[0], ends[2])
        move_part(s1, before[1], ends[3])
        if not lay_ends(s0, s1, ends, elements):
            return z if k > _NEEDED_ROUNDS else SATURATED
        if not bound_path:
            flown_path(elements[0], rows, weights, g, tof, int(SEGMENTS), flown)
        last = SEGMENTS - 1
        longitude = flown[5 * STRIDE + last] + 0.5 * tof / SEGMENTS * flown[last]
        elements[1, 5] += _TWO_PI * np.rint((longitude - elements[1, 5]) / _TWO_PI)
        for j in range(6):
            for i in range(j * STRIDE, j * STRIDE + SEGMENTS):
                path[i] += _DAMPING * (flown[i] - path[i])
        if not lay_problem(tof, dep, arr, int(SEGMENTS), ends, elements, path_work):
            return z if k > _NEEDED_ROUNDS else SATURATED
        duals(rows, p, _NODES, g)
        weigh(g, c, z, dep, arr, int(SEGMENTS), weights)
        value = bounded_impulse(ve, dep, arr, int(SEGMENTS), int(_NEXT_STEPS), path_work)
        if not 0.0 < value < SATURATED:
            return z if k > _NEEDED_ROUNDS else SATURATED
        z = value
        for j in range(k, ROUNDS + 1):
            z_rounds[j] = z
    read_excess(int(0), dep, s0, int(SEGMENTS), work)
    read_excess(int(1), arr, s1, int(SEGMENTS), work)
    return z


@inner_kernel
def find_excess(
    s0: _Array, s1: _Array, tof: float, ve: float, dep: float, arr: float, work: EndsWork
) -> int:
    """Write the excess velocities of the start with the least z; return its number.

    Parameters
    ----------
    s0, s1 : (6,) float64
        States of the bodies in the frame of the leg.
    tof, ve, dep, arr : float
        Flight time, exhaust velocity and bounds of the excess velocities, inf allowed.
    work : tuple of arrays
        `ends_workspace`; its last three receive z of the rounds from the best start, z of all
        starts, and the excess velocities.

    Returns
    -------
    int
        The start; BALLISTIC where a Lambert arc needs no thrust, -1 where no start has a path.
    """
    _, ends, _, _, _, v1, v2, over, z_rounds, best_rounds, z_starts, best_ends = work
    lambert(s0[:3], s1[:3], tof, MAX_REVS, 1.0, v1, v2)
    branch = cheapest_branch(s0, s1, dep, arr, work)
    for q in range(N_STARTS):
        z_starts[q] = SATURATED
    if branch >= 0 and over[branch] == 0.0:
        cut_excess(v1[branch], s0, dep, best_ends[0])
        cut_excess(v2[branch], s1, arr, best_ends[1])
        for k in range(ROUNDS + 1):
            best_rounds[k] = 0.0
        return BALLISTIC
    best = -1
    for k in range(N_STARTS):
        # The likely ones first.
        q = N_STARTS - 1 if k == 0 else (BRANCHES + k - 1) % (N_STARTS - 1)
        rival = z_starts[best] if best >= 0 else SATURATED
        z_starts[q] = pursue(q, rival, s0, s1, tof, ve, dep, arr, work)
        if z_starts[q] < SATURATED and (best < 0 or z_starts[q] < z_starts[best]):
            best = q
            for j in range(3):
                best_ends[0, j], best_ends[1, j] = ends[2, j], ends[3, j]
            for k in range(ROUNDS + 1):
                best_rounds[k] = z_rounds[k]
    return best


@inner_kernel
def ends_workspace() -> EndsWork:
    """Return scratch arrays of a leg with free ends.

    The path's; states with excess, excess velocities and one more; elements of the ends; flown
    path; axes; Lambert velocities at departure and arrival; what they exceed the bounds by; z of
    the rounds, and of the best start; z of the starts; excess velocities of the best.
    """
    return (
        workspace(),
        np.zeros((7, 6)),
        np.empty((2, 6)),
        np.empty(6 * STRIDE),
        np.empty((3, 3)),
        np.empty((BRANCHES, 3)),
        np.empty((BRANCHES, 3)),
        np.empty(BRANCHES),
        np.empty(ROUNDS + 1),
        np.empty(ROUNDS + 1),
        np.empty(N_STARTS),
        np.empty((2, 3)),
    )
