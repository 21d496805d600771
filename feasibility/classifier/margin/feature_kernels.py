"""The inputs of the margin network: what a leg looks like when units and directions are gone.

All is seen from the departure orbit: its plane, x axis through the departure
position; gravitational parameter and semi-major axis 1. The hints are
estimates of the smallest thrust acceleration at departure, thrust / m*, in these units:
along paths in element space (`path_kernels`) for up to five numbers of
revolutions, of which the two cheapest are refined, and along Lambert arcs (MIMA).
"""

import math

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.margin.lanes.math_kernels import sine_cosine
from feasibility.classifier.margin.path_kernels import (
    N_NODES,
    SATURATED,
    STRIDE,
    PathWork,
    first_path,
    flown_path,
    gauss_rows,
    impulse_effects,
    smallest_impulse,
    workspace,
)
from feasibility.orbits.lambert_kernels import lambert
from feasibility.orbits.mima_kernels import mima_acceleration
from feasibility.runtime.jit import inner_kernel, kernel
from feasibility.sims_flanagan.fast.element_kernels import to_elements

_Array = NDArray[np.float64]
LambertWork = tuple[_Array, _Array, _Array, _Array, _Array, _Array]
HintWork = tuple[_Array, NDArray[np.int64], _Array, _Array, _Array, _Array]
FeatureWork = tuple[
    PathWork,
    tuple[_Array, _Array, _Array, _Array, _Array],
    LambertWork,
    HintWork,
]

N_GEOMETRY = 20
N_NEED = 14
N_QUICK = N_GEOMETRY + N_NEED + 6
N_FEATURES = N_GEOMETRY + N_NEED + 46
MAX_REVS = 2
QUICK_NODES = 12

_TWO_PI = 2.0 * math.pi
_N_COUNTS = 5
_WORTH_REFINING = 3.0
_N_ROUNDS = 3
_N_OTHERS = 2 * _N_ROUNDS + 1 + _N_COUNTS + 3 * (MAX_REVS + 1)
# int() at the calls: numba would compile a kernel once for each literal number of steps.
_FIRST_STEPS = 3
_NEXT_STEPS = 2
_DAMPING = 0.65
_SHORT_TURNS = 0.27
_LARGEST_BLEND = 2.0
# The nearest number of revolutions always has a path; others only where it is plausible.
_LEAST_MOTION = 0.3
# Ranges of what a network can be shown.
_LEAST_LOG = -1.5
_LARGEST_LOG = 3.0


@inner_kernel
def clip(x: float, low: float, high: float) -> float:
    """Return x within the bounds."""
    return min(max(x, low), high)


@inner_kernel
def to_frame(rv_dep: _Array, rv_arr: _Array, mu: float, s0: _Array, s1: _Array) -> float:
    """Write both states as seen from the departure orbit; return its semi-major axis in m.

    0 where the departure orbit is not an ellipse.
    """
    x, y, z = rv_dep[0], rv_dep[1], rv_dep[2]
    vx, vy, vz = rv_dep[3], rv_dep[4], rv_dep[5]
    r = math.sqrt(x * x + y * y + z * z)
    energy = 2.0 / r - (vx * vx + vy * vy + vz * vz) / mu
    hx, hy, hz = y * vz - z * vy, z * vx - x * vz, x * vy - y * vx
    h = math.sqrt(hx * hx + hy * hy + hz * hz)
    if not (energy * r > 1e-6 and h > 0.0):
        return 0.0
    a: float = 1.0 / energy
    speed = math.sqrt(mu / a)
    x, y, z = x / r, y / r, z / r
    hx, hy, hz = hx / h, hy / h, hz / h
    tx, ty, tz = hy * z - hz * y, hz * x - hx * z, hx * y - hy * x
    for part in range(2):
        unit = a if part == 0 else speed
        j = 3 * part
        u, v, w = rv_dep[j], rv_dep[j + 1], rv_dep[j + 2]
        s0[j] = (u * x + v * y + w * z) / unit
        s0[j + 1] = (u * tx + v * ty + w * tz) / unit
        s0[j + 2] = (u * hx + v * hy + w * hz) / unit
        u, v, w = rv_arr[j], rv_arr[j + 1], rv_arr[j + 2]
        s1[j] = (u * x + v * y + w * z) / unit
        s1[j + 1] = (u * tx + v * ty + w * tz) / unit
        s1[j + 2] = (u * hx + v * hy + w * hz) / unit
    return a


@inner_kernel
def lambert_hints(
    s0: _Array,
    s1: _Array,
    tof: float,
    lambert_work: LambertWork,
    out: _Array,
    branch: NDArray[np.int64],
) -> None:
    """Write for 0, 1 and 2 revolutions MIMA's acceleration and the impulse sum of the best branch.

    SATURATED where there is none. `out` has 2 entries a number of revolutions,
    `branch` receives which branch it is, -1 for none.
    """
    v1, v2, dv1, dv2, _, _ = lambert_work
    lambert(s0[:3], s1[:3], tof, MAX_REVS, 1.0, v1, v2)
    for revs in range(MAX_REVS + 1):
        out[2 * revs] = SATURATED
        out[2 * revs + 1] = SATURATED
        branch[revs] = -1
    for b in range(1 + 2 * MAX_REVS):
        if math.isnan(v1[b, 0]):
            continue
        size1 = 0.0
        size2 = 0.0
        for j in range(3):
            dv1[j] = v1[b, j] - s0[3 + j]
            dv2[j] = s1[3 + j] - v2[b, j]
            size1 += dv1[j] * dv1[j]
            size2 += dv2[j] * dv2[j]
        a, _ = mima_acceleration(dv1, dv2, tof)
        revs = (b + 1) // 2
        if a < out[2 * revs]:
            out[2 * revs] = a
            out[2 * revs + 1] = math.sqrt(size1) + math.sqrt(size2)
            branch[revs] = b


@inner_kernel
def lambert_path(
    s0: _Array,
    s1: _Array,
    tof: float,
    ve: float,
    b: int,
    lambert_work: LambertWork,
    path_work: PathWork,
) -> float:
    """Return the hint of one Lambert branch: what replaces its impulses, to first order.

    The path is the Lambert orbit itself, and d the effect of both impulses at arrival.
    SATURATED where there is none.
    """
    v1, v2, dv1, dv2, state, x = lambert_work
    path, rows, p, weights, g, c, d, anomaly = path_work
    for j in range(3):
        dv1[j] = v1[b, j] - s0[3 + j]
        dv2[j] = s1[3 + j] - v2[b, j]
        state[j] = s0[j]
        state[3 + j] = v1[b, j]
    if not to_elements(state, x):
        return SATURATED
    for j in range(6):
        d[j] = 0.0
    for i in range(N_NODES):
        for j in range(5):
            path[j * STRIDE + i] = x[j]
    for end in range(2):
        path[5 * STRIDE + end] = x[5] + end * x[0] * tof
        anomaly[end] = (1 - end) * tof
    if not impulse_effects(path, 2, rows, anomaly):
        return SATURATED
    add_impulse(s0, v1[b], dv1, rows, int(0), d)
    add_impulse(s1, v2[b], dv2, rows, int(1), d)
    for i in range(N_NODES):
        path[5 * STRIDE + i] = x[5] + x[0] * tof * (i + 0.5) / N_NODES
    if not gauss_rows(path, tof, N_NODES, rows, anomaly):
        return SATURATED
    z = smallest_impulse(rows, d, ve, 0.0, N_NODES, int(_FIRST_STEPS), p, weights, g, c)
    return z if 0.0 < z < SATURATED else SATURATED


@inner_kernel
def add_impulse(r: _Array, v: _Array, dv: _Array, rows: _Array, i: int, d: _Array) -> None:
    """Add to d the effect of an impulse at node i, where the state is r[:3] and v."""
    x, y, z = r[0], r[1], r[2]
    size = math.sqrt(x * x + y * y + z * z)
    hx, hy, hz = y * v[2] - z * v[1], z * v[0] - x * v[2], x * v[1] - y * v[0]
    h = math.sqrt(hx * hx + hy * hy + hz * hz)
    x, y, z = x / size, y / size, z / size
    hx, hy, hz = hx / h, hy / h, hz / h
    tx, ty, tz = hy * z - hz * y, hz * x - hx * z, hx * y - hy * x
    u = dv[0] * x + dv[1] * y + dv[2] * z
    t = dv[0] * tx + dv[1] * ty + dv[2] * tz
    o = dv[0] * hx + dv[1] * hy + dv[2] * hz
    d[0] += rows[i] * u + rows[STRIDE + i] * t
    d[1] += rows[2 * STRIDE + i] * u + rows[3 * STRIDE + i] * t + rows[4 * STRIDE + i] * o
    d[2] += rows[5 * STRIDE + i] * u + rows[6 * STRIDE + i] * t + rows[7 * STRIDE + i] * o
    d[3] += rows[8 * STRIDE + i] * o
    d[4] += rows[9 * STRIDE + i] * o
    d[5] += rows[10 * STRIDE + i] * u + rows[11 * STRIDE + i] * t + rows[12 * STRIDE + i] * o


@inner_kernel
def coasted_state(n: float, ex: float, ey: float, longitude: float, state: _Array) -> None:
    """Write x, y, 0 and the velocity of a plane orbit: elements as in `path_kernels`."""
    f = longitude
    for _ in range(20):
        s, c = sine_cosine(f)
        slope, curve = 1.0 - ex * c - ey * s, ex * s - ey * c
        gap = f - curve - longitude
        step = gap / (slope - 0.5 * gap / slope * curve)
        f -= min(1.0, max(-1.0, step))
        if abs(step) < 1e-4:
            break
    s, c = sine_cosine(f)
    root_a = 1.0 / np.cbrt(n)
    a = root_a * root_a
    b = 1.0 / (1.0 + math.sqrt(1.0 - ex * ex - ey * ey))
    na_r = n * a / (1.0 - ex * c - ey * s)
    state[0] = a * ((1.0 - ey * ey * b) * c + ex * ey * b * s - ex)
    state[1] = a * ((1.0 - ex * ex * b) * s + ex * ey * b * c - ey)
    state[2] = 0.0
    state[3] = na_r * (ex * ey * b * c - (1.0 - ey * ey * b) * s)
    state[4] = na_r * ((1.0 - ex * ex * b) * c - ex * ey * b * s)
    state[5] = 0.0


@inner_kernel
def geometry(
    s1: _Array,
    x0: _Array,
    x1: _Array,
    tof: float,
    ve: float,
    near: float,
    state: _Array,
    out: _Array,
) -> None:
    """Write the features 0 to N_GEOMETRY - 1: the leg, without a hint."""
    n0, n1 = x0[0], x1[0]
    out[0] = math.log(tof)
    out[1] = math.log(ve)
    out[2] = math.log(n1)
    out[3], out[4] = x0[1], x0[2]
    out[5], out[6] = x1[1], x1[2]
    out[7], out[8] = x1[3], x1[4]
    out[9] = near
    out[10] = clip(near / tof, -2.0, 2.0)
    out[11] = math.sin(x1[5])
    out[12] = math.cos(x1[5])
    out[13] = 0.25 * tof * (n0 + n1) / math.pi
    # Arrival against the coasted departure orbit, in the local frame there.
    coasted_state(n0, x0[1], x0[2], x0[5] + n0 * tof, state)
    r = math.sqrt(state[0] * state[0] + state[1] * state[1])
    cx, cy = state[0] / r, state[1] / r
    for part in range(2):
        j = 3 * part
        ax, ay, az = s1[j] - state[j], s1[j + 1] - state[j + 1], s1[j + 2]
        o = 14 + 3 * part
        out[o] = ax * cx + ay * cy
        out[o + 1] = ay * cx - ax * cy
        out[o + 2] = az


@inner_kernel
def need(total: float, tof: float, ve: float, d: _Array, p: _Array, out: _Array) -> None:
    """Write the N_NEED features after the geometry: what has to be done, in terms of a hint.

    `total` is the impulse of all segments together by the hint, `p` its dual.
    """
    for part in range(2):
        unit = 0.5 * total * tof if part == 0 else total
        for j in range(3):
            q = 3 * part + j
            out[N_GEOMETRY + q] = clip(out[14 + q] / unit, -3.0, 3.0)
    out[N_GEOMETRY + 6] = math.log(total)
    out[N_GEOMETRY + 7] = clip(total / ve, 0.0, 2.0)
    value = 0.0
    for j in range(6):
        value += p[j] * d[j]
    for j in range(6):
        out[N_GEOMETRY + 8 + j] = clip(p[j] * d[j] / value, -3.0, 3.0)


@inner_kernel
def log_ratio(value: float, base: float) -> float:
    """Return log(value) - base within what a network is shown."""
    return clip(math.log(value) - base, _LEAST_LOG, _LARGEST_LOG)


@kernel
def quick_features(
    rv_dep: _Array,
    rv_arr: _Array,
    tof_s: float,
    exhaust: float,
    mu: float,
    work: FeatureWork,
    out: _Array,
) -> float:
    """Write the few features (N_QUICK,) that cost little; return the log of a rough hint.

    The path of the nearest number of revolutions by least squares, and MIMA.
    Parameters and result as for `leg_features`.
    """
    (
        (path, rows, p, weights, g, c, d, anomaly),
        (s0, s1, x0, x1, state),
        lambert_work,
        (lam, branch, _, _, _, _),
    ) = work
    for j in range(N_QUICK):
        out[j] = np.nan
    a = to_frame(rv_dep, rv_arr, mu, s0, s1)
    if not a > 0.0 or not to_elements(s0, x0) or not to_elements(s1, x1):
        return np.nan
    tof = tof_s / math.sqrt(a * a * a / mu)
    ve = exhaust / math.sqrt(mu / a)
    mean = 0.5 * tof * (x0[0] + x1[0])
    near = wrapped(x1[5] - x0[5] - mean)
    for j in range(5):
        d[j] = x1[j] - x0[j]
    d[5] = mean + near - x0[0] * tof
    first_path(x0, x1, tof, near, _LEAST_MOTION, QUICK_NODES, path)
    if not gauss_rows(path, tof, QUICK_NODES, rows, anomaly):
        return np.nan
    z = smallest_impulse(rows, d, ve, 0.0, QUICK_NODES, int(1), p, weights, g, c)
    if not 0.0 < z < SATURATED:
        return np.nan
    total = z * QUICK_NODES
    geometry(s1, x0, x1, tof, ve, near, state, out)
    need(total, tof, ve, d, p, out)
    lambert_hints(s0, s1, tof, lambert_work, lam, branch)
    base = math.log(total)
    for j in range(2 * (MAX_REVS + 1)):
        out[N_GEOMETRY + N_NEED + j] = log_ratio(lam[j] * (tof if j % 2 == 0 else 1.0), base)
    return math.log(total / tof)


@inner_kernel
def wrapped(angle: float) -> float:
    """Return the angle moved by whole turns into [-pi, pi]."""
    return float(angle - _TWO_PI * np.rint(angle / _TWO_PI))


@inner_kernel
def turns_beside(q: int) -> int:
    """Return the q-th number of revolutions to try, counted from the nearest one."""
    return (0, 1, -1, 2, -2)[q]


@inner_kernel
def least_motion(q: int) -> float:
    """Return the least mean motion of a first path, for the q-th number of revolutions."""
    return _LEAST_MOTION if q == 0 else 0.0


@inner_kernel
def refine(
    x0: _Array,
    x1: _Array,
    tof: float,
    ve: float,
    excess: float,
    least: float,
    path_work: PathWork,
    flown: _Array,
    z: _Array,
) -> bool:
    """Write the hints of the first path and of `_N_ROUNDS` better ones; return success.

    A round that fails leaves the rest at the last value.
    """
    path, rows, p, weights, g, c, d, anomaly = path_work
    first_path(x0, x1, tof, excess, least, N_NODES, path)
    if not gauss_rows(path, tof, N_NODES, rows, anomaly):
        return False
    value = smallest_impulse(rows, d, ve, 0.0, N_NODES, int(_FIRST_STEPS), p, weights, g, c)
    if not 0.0 < value < SATURATED:
        return False
    for j in range(_N_ROUNDS + 1):
        z[j] = value
    for k in range(1, _N_ROUNDS + 1):
        flown_path(x0, rows, weights, g, tof, N_NODES, flown)
        for j in range(6):
            for i in range(j * STRIDE, j * STRIDE + N_NODES):
                path[i] += _DAMPING * (flown[i] - path[i])
        if not gauss_rows(path, tof, N_NODES, rows, anomaly):
            return True
        value = smallest_impulse(rows, d, ve, value, N_NODES, int(_NEXT_STEPS), p, weights, g, c)
        if not 0.0 < value < SATURATED:
            return True
        for j in range(k, _N_ROUNDS + 1):
            z[j] = value
    return True


@inner_kernel
def other_hints(hint_work: HintWork, tof: float, base: float, out: _Array) -> None:
    """Write the _N_OTHERS features that compare other estimates with the hint.

    `base` is the logarithm of the hint's impulse of one segment.
    """
    lam, _, _, z_first, z, z_lambert = hint_work
    for j in range(_N_ROUNDS):
        out[j] = clip(math.log(z[j]) - base, -1.0, 1.0)
    o = _N_ROUNDS
    for j in range(_N_ROUNDS + 1):
        out[o + j] = log_ratio(z[_N_ROUNDS + 1 + j], base)
    o += _N_ROUNDS + 1
    for q in range(_N_COUNTS):
        out[o + q] = log_ratio(z_first[q], base)
    o += _N_COUNTS
    for j in range(2 * (MAX_REVS + 1)):
        unit = tof if j % 2 == 0 else 1.0
        out[o + j] = log_ratio(lam[j] * unit / N_NODES, base)
    o += 2 * (MAX_REVS + 1)
    for revs in range(MAX_REVS + 1):
        out[o + revs] = log_ratio(z_lambert[revs], base)


@inner_kernel
def thrust_directions(path_work: PathWork, base: float, out: _Array) -> None:
    """Write the last features, from the dual that the best hint has left in `path_work`.

    Where it nearly vanishes the thrust turns; where it points the thrust points.
    """
    _, _, _, weights, g, c, _, _ = path_work
    average = 0.0
    smallest = np.inf
    largest_use = 0.0
    for i in range(N_NODES):
        average += g[3 * STRIDE + i] / N_NODES
        smallest = min(smallest, g[3 * STRIDE + i])
        largest_use = max(largest_use, weights[i] * g[3 * STRIDE + i] / c[i])
    out[0] = smallest / average
    out[1] = clip(math.log(largest_use) - base, -1.0, 1.0)
    o = 2
    for k in range(5):
        i = (0, 5, 10, 14, 19)[k]
        length = max(g[3 * STRIDE + i], 1e-12 * average)
        out[o] = g[i] / length
        out[o + 1] = g[STRIDE + i] / length
        out[o + 2] = g[2 * STRIDE + i] / length
        out[o + 3] = clip(length / average, 0.0, 4.0)
        o += 4


@inner_kernel
def leg_features(
    rv_dep: _Array,
    rv_arr: _Array,
    tof_s: float,
    exhaust: float,
    mu: float,
    work: FeatureWork,
    out: _Array,
) -> float:
    """Write the features of one leg; return the logarithm of the best hint.

    Parameters
    ----------
    rv_dep, rv_arr : (6,) float64, m and m/s
    tof_s : float, s
    exhaust : float, m/s
    mu : float, m3/s2
    work : tuple of arrays
        `feature_workspace`.
    out : (N_FEATURES,) float64
        Overwritten.

    Returns
    -------
    float
        log of thrust / m*, unit mu / a_dep^2; NaN where an orbit is no ellipse
        or no hint exists (then `out` is NaN too).
    """
    path_work, (s0, s1, x0, x1, state), lambert_work, hint_work = work
    lam, branch, flown, z_first, z, z_lambert = hint_work
    path, rows, p, weights, g, c, d, anomaly = path_work
    for j in range(N_FEATURES):
        out[j] = np.nan
    a = to_frame(rv_dep, rv_arr, mu, s0, s1)
    if not a > 0.0 or not to_elements(s0, x0) or not to_elements(s1, x1):
        return np.nan
    tof = tof_s / math.sqrt(a * a * a / mu)
    ve = exhaust / math.sqrt(mu / a)
    mean = 0.5 * tof * (x0[0] + x1[0])
    near = wrapped(x1[5] - x0[5] - mean)
    for j in range(5):
        d[j] = x1[j] - x0[j]

    # Every number of revolutions along its first path; the two cheapest are refined.
    best = -1
    second = -1
    for q in range(_N_COUNTS):
        excess = near + _TWO_PI * turns_beside(q)
        z_first[q] = SATURATED
        d[5] = mean + excess - x0[0] * tof
        first_path(x0, x1, tof, excess, least_motion(q), N_NODES, path)
        if not gauss_rows(path, tof, N_NODES, rows, anomaly):
            continue
        value = smallest_impulse(rows, d, ve, 0.0, N_NODES, int(1), p, weights, g, c)
        if not 0.0 < value < SATURATED:
            continue
        z_first[q] = value
        if best < 0 or value < z_first[best]:
            second = best
            best = q
        elif second < 0 or value < z_first[second]:
            second = q
    if best < 0:
        return np.nan
    for j in range(2 * (_N_ROUNDS + 1)):
        z[j] = SATURATED
    if second >= 0 and z_first[second] < _WORTH_REFINING * z_first[best]:
        excess = near + _TWO_PI * turns_beside(second)
        d[5] = mean + excess - x0[0] * tof
        refine(x0, x1, tof, ve, excess, least_motion(second), path_work, flown, z[_N_ROUNDS + 1 :])
    lambert_hints(s0, s1, tof, lambert_work, lam, branch)
    least = min(lam[0], lam[2], lam[4])
    for revs in range(MAX_REVS + 1):
        z_lambert[revs] = SATURATED
        if branch[revs] >= 0 and lam[2 * revs] < _WORTH_REFINING * least:
            z_lambert[revs] = lambert_path(s0, s1, tof, ve, branch[revs], lambert_work, path_work)
    # The best one last, so that its duals remain.
    excess = near + _TWO_PI * turns_beside(best)
    for j in range(5):
        d[j] = x1[j] - x0[j]
    d[5] = mean + excess - x0[0] * tof
    if not refine(x0, x1, tof, ve, excess, least_motion(best), path_work, flown, z):
        return np.nan
    hint = z[_N_ROUNDS]
    base = math.log(hint)
    total = hint * N_NODES

    geometry(s1, x0, x1, tof, ve, near, state, out)
    need(total, tof, ve, d, p, out)
    o = N_GEOMETRY + N_NEED
    out[o] = clip(excess / tof, -2.0, 2.0)
    out[o + 1] = 0.5 * (mean + excess) / math.pi
    out[o + 2] = clip((excess - near) / _TWO_PI, -2.0, 2.0)
    other_hints(hint_work, tof, base, out[o + 3 : o + 3 + _N_OTHERS])
    thrust_directions(path_work, base, out[o + 3 + _N_OTHERS :])
    # On short arcs the Lambert path is the better hint.
    share = 1.0 / (1.0 + (out[13] / _SHORT_TURNS) ** 8)
    difference = math.log(z_lambert[0]) - base
    blend = share * difference if abs(difference) < _LARGEST_BLEND else 0.0
    return float(math.log(total / tof) + blend)


@inner_kernel
def feature_workspace() -> FeatureWork:
    """Return the scratch arrays of `leg_features` and `quick_features`."""
    branches = 1 + 2 * MAX_REVS
    return (
        workspace(),
        (np.empty(6), np.empty(6), np.empty(6), np.empty(6), np.empty(6)),
        (
            np.empty((branches, 3)),
            np.empty((branches, 3)),
            np.empty(3),
            np.empty(3),
            np.empty(6),
            np.empty(6),
        ),
        (
            np.empty(2 * (MAX_REVS + 1)),
            np.empty(MAX_REVS + 1, np.int64),
            np.empty(6 * STRIDE),
            np.empty(_N_COUNTS),
            np.empty(2 * (_N_ROUNDS + 1)),
            np.empty(MAX_REVS + 1),
        ),
    )


@kernel
def feature_batch(
    rv_dep: _Array,
    rv_arr: _Array,
    tof_s: _Array,
    exhaust: _Array,
    mu: float,
    out: _Array,
    hint: _Array,
) -> None:
    """Write features (n, N_FEATURES) and log hints (n,) of n legs; see `leg_features`."""
    work = feature_workspace()
    for i in range(len(tof_s)):
        hint[i] = leg_features(rv_dep[i], rv_arr[i], tof_s[i], exhaust[i], mu, work, out[i])


@kernel
def quick_batch(
    rv_dep: _Array,
    rv_arr: _Array,
    tof_s: _Array,
    exhaust: _Array,
    mu: float,
    out: _Array,
    hint: _Array,
) -> None:
    """Write features (n, N_QUICK) and log hints (n,) of n legs, one after the other.

    See `quick_features`; `lanes.rendezvous_kernels` does the same faster, and is compared with it.
    """
    work = feature_workspace()
    for i in range(len(tof_s)):
        hint[i] = quick_features(rv_dep[i], rv_arr[i], tof_s[i], exhaust[i], mu, work, out[i])
