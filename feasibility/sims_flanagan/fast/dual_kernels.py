"""The linearised leg: least thrust that closes a gap, by its six-dimensional dual."""

import math

import numpy as np
from numpy.typing import NDArray

from feasibility.runtime.jit import inner_kernel
from feasibility.sims_flanagan.fast.algebra_kernels import (
    cholesky,
    solve_lower,
    solve_lower_transposed,
)
from feasibility.sims_flanagan.fast.workspace_kernels import (
    ALONG,
    FREE,
    HESSIAN,
    HESSIAN_LOWER,
    M_TWO,
    NORM,
    PINNED,
    PRIMER,
    SLOPE,
    THRUST,
    TRIAL_NORM,
    TRIAL_PRIMER,
    TURNED,
    WEIGHT,
    Workspace,
    Y,
    has_free_ends,
    open_end,
)

_DUAL_ITERATIONS = 40
_SOFTNESS = 1e-3
_FULL = 0.995
_LARGEST = 2.0
_BACKWARD_LIMIT = 0.367
_NO_THRUST = 1e-9
_RIGID = 1e20
_ROUNDS = 12
_MET = 1e-7

_Array = NDArray[np.float64]


@inner_kernel
def full_thrust_profile(
    z: float, n: int, n_forward: int, c: float, free: _Array, y: _Array, slope: _Array
) -> None:
    """Write impulses over exhaust velocity, y_i, at full thrust, and their derivative by z.

    z = T dt / (m0 c). Forward half (mass before the impulse): y = z_i; backward
    half (mass after it): y exp(-y) = z_i; both z_(i+1) = z_i exp(y_i). Beyond
    z_i = 1/e the convention sets a backward impulse no limit at all (the mass
    left is as small as it needs to be); there y = 1. Of a free end y is its bound `free` over
    exhaust velocity `c`, whatever z is.
    """
    zi = z
    dz = 1.0
    for i in range(n):
        if free[i] > 0.0:
            y[i] = free[i] / c
            slope[i] = 0.0
        elif i < n_forward:
            zi = min(zi, _LARGEST)
            y[i] = zi
            slope[i] = dz
            grow = math.exp(zi)
            dz = dz * grow * (1.0 + zi)
            zi = zi * grow
        elif zi > _BACKWARD_LIMIT:
            y[i] = 1.0
            slope[i] = 0.0
        else:
            yi = zi * (1.0 + zi * (1.0 + 1.5 * zi))
            for _ in range(20):
                grow = math.exp(yi)
                step = (yi - zi * grow) / (1.0 - yi)
                yi = min(yi - step, 0.999)
                if abs(step) < 1e-12:
                    break
            grow = math.exp(yi)
            dz = dz * grow / (1.0 - yi)
            y[i] = yi
            slope[i] = dz
            zi = yi


@inner_kernel
def z_of_impulses(dv: _Array, n: int, n_forward: int, c: float, free: _Array) -> float:
    """Return the smallest z = T dt / (m0 c) at which the impulses need no throttle above 1.

    m0 exp(-S_i / c) |dv_i| <= T dt with S_i the sum of the impulses before
    segment i, in the backward half including it. The excess of free ends, where `free` is
    not 0, needs no thrust.
    """
    total = 0.0
    z = 0.0
    for i in range(n):
        if free[i] > 0.0:
            continue
        y = math.sqrt(dv[i, 0] ** 2 + dv[i, 1] ** 2 + dv[i, 2] ** 2) / c
        if i < n_forward:
            z = max(z, y * math.exp(-total))
            total += y
        else:
            total += y
            z = max(z, y * math.exp(-total))
    return z


@inner_kernel
def correction_matrix(b: _Array, n: int, gram: _Array, w: Workspace) -> None:
    """Write sum b_i b_i^T: how the end answers to corrections.

    Free ends count with their weights, and across the excess only where it is at its bound.
    """
    for i in range(6):
        for j in range(i + 1):
            total = 0.0
            for k in range(n):
                if w.s[FREE, k] > 0.0:
                    continue
                total += (
                    b[k, i, 0] * b[k, j, 0] + b[k, i, 1] * b[k, j, 1] + b[k, i, 2] * b[k, j, 2]
                )
            gram[i, j] = total
    for k in range(0, n, max(n - 1, 1)):
        if not w.s[FREE, k] > 0.0:
            continue
        a = w.n3[ALONG, k]
        for i in range(6):
            along = b[k, i, 0] * a[0] + b[k, i, 1] * a[1] + b[k, i, 2] * a[2]
            for j in range(i + 1):
                gram[i, j] += w.s[WEIGHT, k] * (
                    b[k, i, 0] * b[k, j, 0]
                    + b[k, i, 1] * b[k, j, 1]
                    + b[k, i, 2] * b[k, j, 2]
                    - along * (b[k, j, 0] * a[0] + b[k, j, 1] * a[1] + b[k, j, 2] * a[2])
                )


@inner_kernel
def whiten(b: _Array, n: int, gram: _Array, lower: _Array, w: Workspace) -> bool:
    """Overwrite each b_i (6, 3) with L^-1 b_i, where L L^T = sum b_i b_i^T; return whether it can.

    In whitened coordinates the norm of a gap is the least impulse that closes it.
    """
    correction_matrix(b, n, gram, w)
    if not cholesky(gram, lower):
        return False
    for k in range(n):
        for col in range(3):
            for i in range(6):
                total = b[k, i, col]
                for j in range(i):
                    total -= lower[i, j] * b[k, j, col]
                b[k, i, col] = total / lower[i, i]
    return True


@inner_kernel
def _primers(
    b: _Array, lam: _Array, n: int, thrust: _Array, primer: _Array, norm: _Array, w: Workspace
) -> float:
    """Write b_i^T lam and the softened norms sqrt(|b_i^T lam|^2 + eps^2).

    For a pinned segment the "norm" is the work done along its given direction. Returns the work
    that free ends do at their bounds.
    """
    pinned, free = w.s[PINNED], w.s[FREE]
    mean = 0.0
    excess = 0.0
    for i in range(n):
        total = 0.0
        for j in range(3):
            p = 0.0
            for k in range(6):
                p += b[i, k, j] * lam[k]
            primer[i, j] = p
            total += p * p
        norm[i] = total
        if free[i] == 0.0:
            mean += total
    eps2 = _SOFTNESS * _SOFTNESS * mean / n
    for i in range(n):
        if free[i] > 0.0:
            # As much softer work as a segment's.
            norm[i] = math.sqrt(norm[i] + eps2 / w.s[WEIGHT, i])
            excess += free[i] * norm[i]
        elif pinned[i] > 0.0:
            norm[i] = 0.0
            for j in range(3):
                norm[i] += primer[i, j] * thrust[i, j]
        else:
            norm[i] = math.sqrt(norm[i] + eps2)
    return excess


@inner_kernel
def _bound(
    norm: _Array,
    work: float,
    z: float,
    n: int,
    n_forward: int,
    c: float,
    free: _Array,
    y: _Array,
    slope: _Array,
) -> float:
    """Return the z at which full thrust along the primers just does `work`: c sum y_i |p_i|."""
    for _ in range(30):
        full_thrust_profile(z, n, n_forward, c, free, y, slope)
        done = 0.0
        rate = 0.0
        for i in range(n):
            done += c * y[i] * norm[i]
            rate += c * slope[i] * norm[i]
        step = (work - done) / rate
        z += min(max(step, -0.5 * z), z)
        if abs(step) < 1e-9 * z:
            break
    return z


@inner_kernel
def _curvature(
    b: _Array,
    n: int,
    c: float,
    y: _Array,
    primer: _Array,
    norm: _Array,
    thrust: _Array,
    pinned: _Array,
    lam: _Array,
    h: _Array,
    grad: _Array,
    turned: _Array,
) -> None:
    """Add to `grad` (6,) the impulses' effect c y_i b_i p_i / |p_i|; write the Newton matrix h."""
    for i in range(6):
        for j in range(i + 1):
            h[i, j] = 0.0
    for k in range(n):
        u0, u1, u2 = thrust[k, 0], thrust[k, 1], thrust[k, 2]
        if pinned[k] > 0.0:
            for i in range(6):
                grad[i] += c * y[k] * (b[k, i, 0] * u0 + b[k, i, 1] * u1 + b[k, i, 2] * u2)
            continue
        inverse = 1.0 / norm[k]
        weight = c * y[k] * inverse
        p0, p1, p2 = primer[k, 0] * inverse, primer[k, 1] * inverse, primer[k, 2] * inverse
        for i in range(6):
            b0, b1, b2 = b[k, i, 0], b[k, i, 1], b[k, i, 2]
            along = b0 * p0 + b1 * p1 + b2 * p2
            turn = b0 * u0 + b1 * u1 + b2 * u2
            turned[0, i] = along
            turned[1, i] = turn
            grad[i] += c * y[k] * along
            for j in range(i + 1):
                h[i, j] += weight * (
                    b0 * b[k, j, 0]
                    + b1 * b[k, j, 1]
                    + b2 * b[k, j, 2]
                    - 0.5 * (along * turned[1, j] + turn * turned[0, j])
                )
    trace = 0.0
    for i in range(6):
        trace += h[i, i]
    # No curvature along lam itself, whose length is fixed.
    for i in range(6):
        for j in range(i + 1):
            h[i, j] += trace * lam[i] * lam[j]
        h[i, i] += 1e-10 * trace


@inner_kernel
def turn_to_open_end(b: _Array, gap: _Array, lam: _Array, n: int, end: int, w: Workspace) -> None:
    """Turn the coordinates so that an open end acts along the first three only.

    Householder's reflections of b[end] (6, 3); they are kept for `turn_back`.
    """
    mirrors = w.m[M_TWO]
    for col in range(3):
        size = 0.0
        for k in range(6):
            mirrors[col, k] = b[end, k, col] if k >= col else 0.0
            size += mirrors[col, k] ** 2
        mirrors[col, col] += math.copysign(math.sqrt(size), mirrors[col, col])
        _reflect_all(b, gap, lam, n, mirrors[col])


@inner_kernel
def turn_back(b: _Array, gap: _Array, lam: _Array, n: int, w: Workspace) -> None:
    """Undo `turn_to_open_end`."""
    for col in range(2, -1, -1):
        _reflect_all(b, gap, lam, n, w.m[M_TWO, col])


@inner_kernel
def _reflect_all(b: _Array, gap: _Array, lam: _Array, n: int, mirror: _Array) -> None:
    """Reflect sensitivities, gap and multipliers."""
    square = 0.0
    along_gap = along_lam = 0.0
    for k in range(6):
        square += mirror[k] * mirror[k]
        along_gap += mirror[k] * gap[k]
        along_lam += mirror[k] * lam[k]
    for k in range(6):
        gap[k] -= 2.0 * along_gap / square * mirror[k]
        lam[k] -= 2.0 * along_lam / square * mirror[k]
    for i in range(n):
        for col in range(3):
            along = 0.0
            for k in range(6):
                along += mirror[k] * b[i, k, col]
            for k in range(6):
                b[i, k, col] -= 2.0 * along / square * mirror[k]


@inner_kernel
def close_by_open_end(b: _Array, gap: _Array, n: int, end: int, dv: _Array) -> None:
    """Write the excess of an open end that closes what the other impulses leave of the gap."""
    for i in range(2, -1, -1):
        rest = gap[i]
        for k in range(n):
            if k != end:
                for j in range(3):
                    rest -= b[k, i, j] * dv[k, j]
        for j in range(i + 1, 3):
            rest -= b[end, i, j] * dv[end, j]
        dv[end, i] = rest / b[end, i, i]


@inner_kernel
def keep_out(h: _Array, grad: _Array, step: _Array) -> None:
    """Take the first three coordinates out of a Newton step."""
    trace = 0.0
    for i in range(6):
        trace += h[i, i]
    for i in range(3):
        grad[i] = step[i] = 0.0
        h[i, i] = _RIGID * trace
        for j in range(i + 1, 6):
            h[j, i] = 0.0


@inner_kernel
def _climb(
    b: _Array,
    gap: _Array,
    n: int,
    n_forward: int,
    c: float,
    lam: _Array,
    z: float,
    end: int,
    w: Workspace,
) -> float:
    """Raise z(lam) by damped Newton steps from `lam` (norm 1); return z, -1 where it fails.

    With an open end, `end` of 0 or more, `lam` stays in the last three coordinates.
    """
    primer, trial_primer, thrust = w.n3[PRIMER], w.n3[TRIAL_PRIMER], w.n3[THRUST]
    norm, trial_norm, y, slope = w.s[NORM], w.s[TRIAL_NORM], w.s[Y], w.s[SLOPE]
    pinned, free = w.s[PINNED], w.s[FREE]
    h, lower, turned = w.m[HESSIAN], w.m[HESSIAN_LOWER], w.m[TURNED]
    grad, step, trial = turned[2], turned[3], turned[4]
    work = 0.0
    for i in range(6):
        work += lam[i] * gap[i]
    excess = _primers(b, lam, n, thrust, primer, norm, w)
    z = _bound(norm, work, z, n, n_forward, c, free, y, slope)
    for i in range(n):
        if pinned[i] == 0.0:
            for j in range(3):
                thrust[i, j] = primer[i, j] / norm[i]
    for _ in range(_DUAL_ITERATIONS):
        for i in range(6):
            grad[i] = -gap[i]
        _curvature(b, n, c, y, primer, norm, thrust, pinned, lam, h, grad, turned)
        along = 0.0
        for i in range(6):
            along += lam[i] * grad[i]
        for i in range(6):
            grad[i] -= along * lam[i]
            step[i] = -grad[i]
        if end >= 0:
            keep_out(h, grad, step)
        if not cholesky(h, lower):
            return -1.0
        solve_lower(lower, step)
        solve_lower_transposed(lower, step)
        decrement = 0.0
        for i in range(6):
            decrement -= step[i] * grad[i]
        if not decrement > 1e-8 * (work - excess):
            break
        fraction = 1.0
        better = False
        for _ in range(12):
            size = 0.0
            for i in range(6):
                trial[i] = lam[i] + fraction * step[i]
                size += trial[i] * trial[i]
            size = math.sqrt(size)
            trial_work = 0.0
            for i in range(6):
                trial[i] /= size
                trial_work += trial[i] * gap[i]
            if trial_work > 0.0:
                trial_excess = _primers(b, trial, n, thrust, trial_primer, trial_norm, w)
                if trial_work > trial_excess:
                    trial_z = _bound(trial_norm, trial_work, z, n, n_forward, c, free, y, slope)
                    if trial_z > z:
                        better = True
                        break
            fraction *= 0.5
        if not better:
            break
        for k in range(n):
            if pinned[k] == 0.0:
                _turn_thrust(b[k], step, fraction, primer[k], norm[k], thrust[k])
        z = trial_z
        work = trial_work
        excess = trial_excess
        for i in range(6):
            lam[i] = trial[i]
        for i in range(n):
            norm[i] = trial_norm[i]
            for j in range(3):
                primer[i, j] = trial_primer[i, j]
    full_thrust_profile(z, n, n_forward, c, free, y, slope)
    return z


@inner_kernel
def _turn_thrust(
    b: _Array, step: _Array, fraction: float, primer: _Array, norm: float, thrust: _Array
) -> None:
    """Let a thrust direction follow its own linearisation, kept inside the unit ball."""
    d0 = d1 = d2 = 0.0
    for i in range(6):
        d0 += b[i, 0] * step[i]
        d1 += b[i, 1] * step[i]
        d2 += b[i, 2] * step[i]
    along = (primer[0] * d0 + primer[1] * d1 + primer[2] * d2) / norm
    thrust[0] += fraction * ((d0 + primer[0] - along * thrust[0]) / norm - thrust[0])
    thrust[1] += fraction * ((d1 + primer[1] - along * thrust[1]) / norm - thrust[1])
    thrust[2] += fraction * ((d2 + primer[2] - along * thrust[2]) / norm - thrust[2])
    size = math.sqrt(thrust[0] ** 2 + thrust[1] ** 2 + thrust[2] ** 2)
    if size > 1.0:
        for j in range(3):
            thrust[j] /= size


@inner_kernel
def _pin_direction(b: _Array, lower: _Array, turned: _Array, u: _Array) -> None:
    """Move `u` (3,), shorter than 1, to the unit vector that the others make up for most cheaply.

    Least (v - u)^T Q (v - u) over |v| = 1 with Q = b^T H^-1 b: (Q + tau) v = Q u with
    -q_min < tau < 0, found by bisection.
    """
    for j in range(3):
        for i in range(6):
            turned[j, i] = b[i, j]
        solve_lower(lower, turned[j])
    q00 = q01 = q02 = q11 = q12 = q22 = 0.0
    for i in range(6):
        q00 += turned[0, i] * turned[0, i]
        q01 += turned[0, i] * turned[1, i]
        q02 += turned[0, i] * turned[2, i]
        q11 += turned[1, i] * turned[1, i]
        q12 += turned[1, i] * turned[2, i]
        q22 += turned[2, i] * turned[2, i]
    g0 = q00 * u[0] + q01 * u[1] + q02 * u[2]
    g1 = q01 * u[0] + q11 * u[1] + q12 * u[2]
    g2 = q02 * u[0] + q12 * u[1] + q22 * u[2]
    low = -min(q00, q11, q22)
    high = 0.0
    v0, v1, v2 = u[0], u[1], u[2]
    for _ in range(50):
        tau = 0.5 * (low + high)
        a00 = q00 + tau
        a11 = q11 + tau
        a22 = q22 + tau
        c00 = a11 * a22 - q12 * q12
        c01 = q02 * q12 - q01 * a22
        c02 = q01 * q12 - q02 * a11
        det = a00 * c00 + q01 * c01 + q02 * c02
        if a00 > 0.0 and a00 * a11 > q01 * q01 and det > 0.0:
            c11 = a00 * a22 - q02 * q02
            c12 = q01 * q02 - a00 * q12
            c22 = a00 * a11 - q01 * q01
            t0 = (c00 * g0 + c01 * g1 + c02 * g2) / det
            t1 = (c01 * g0 + c11 * g1 + c12 * g2) / det
            t2 = (c02 * g0 + c12 * g1 + c22 * g2) / det
            if t0 * t0 + t1 * t1 + t2 * t2 <= 1.0:
                high = tau
                v0, v1, v2 = t0, t1, t2
                continue
        low = tau
    size = math.sqrt(v0 * v0 + v1 * v1 + v2 * v2)
    if size > 0.0:
        u[0], u[1], u[2] = v0 / size, v1 / size, v2 / size


@inner_kernel
def _beyond_ends(
    b: _Array, gap: _Array, n: int, lam: _Array, dv: _Array, end: int, w: Workspace
) -> bool:
    """Write into `lam` what is left of a gap that free ends close as far as they can.

    Along this direction the ends do less work than the gap asks for. Where nothing is left,
    returns False and leaves the excess velocities, alone, in `dv`.
    """
    matrix, rest = w.m[TURNED], w.m[HESSIAN]
    low = 3 if end >= 0 else 0
    for i in range(n):
        for j in range(3):
            dv[i, j] = 0.0
    total = 0.0
    for k in range(low, 6):
        total += gap[k] * gap[k]
    left = np.inf
    for _ in range(_ROUNDS):
        for i in range(0, n, max(n - 1, 1)):
            if w.s[FREE, i] > 0.0 and i != end:
                for k in range(low, 6):
                    value = gap[k]
                    for e in range(0, n, max(n - 1, 1)):
                        if e != i:
                            for j in range(3):
                                value -= b[e, k, j] * dv[e, j]
                    rest[0, k] = value
                _nearest_in_ball(b[i], rest[0], low, w.s[FREE, i], matrix, dv[i])
        before = left
        left = 0.0
        for k in range(low):
            lam[k] = 0.0
        for k in range(low, 6):
            lam[k] = gap[k]
            for e in range(0, n, max(n - 1, 1)):
                for j in range(3):
                    lam[k] -= b[e, k, j] * dv[e, j]
            left += lam[k] * lam[k]
        if left < _MET * _MET * total or left > 0.99 * before:
            break
    return left > _MET * _MET * total


@inner_kernel
def _nearest_in_ball(
    b: _Array, rest: _Array, first: int, radius: float, m: _Array, e: _Array
) -> None:
    """Write the vector `e` (3,), no longer than `radius`, with the least |rest - b e|.

    Only the coordinates from `first` on count.

    (b^T b + tau) e = b^T rest with tau of 0 or more, by a bisection in its logarithm.
    """
    trace = 0.0
    for i in range(3):
        for j in range(i + 1):
            value = 0.0
            for k in range(first, 6):
                value += b[k, i] * b[k, j]
            m[i, j] = value
        trace += m[i, i]
        m[3, i] = 0.0
        for k in range(first, 6):
            m[3, i] += b[k, i] * rest[k]
    size = math.sqrt(m[3, 0] ** 2 + m[3, 1] ** 2 + m[3, 2] ** 2)
    _solve_three(m, 1e-14 * trace, e)
    if e[0] ** 2 + e[1] ** 2 + e[2] ** 2 <= radius * radius:
        return
    low = math.log(1e-14 * trace)
    high = math.log(max(size / radius, 1e-13 * trace))
    for _ in range(40):
        middle = 0.5 * (low + high)
        _solve_three(m, math.exp(middle), e)
        if e[0] ** 2 + e[1] ** 2 + e[2] ** 2 <= radius * radius:
            high = middle
        else:
            low = middle
        if high - low < 1e-10:
            break
    _solve_three(m, math.exp(high), e)


@inner_kernel
def _solve_three(m: _Array, tau: float, x: _Array) -> None:
    """Write the solution of (m + tau) x = m[3] for the symmetric (3, 3) matrix in m's triangle."""
    a00, a11, a22 = m[0, 0] + tau, m[1, 1] + tau, m[2, 2] + tau
    a01, a02, a12 = m[1, 0], m[2, 0], m[2, 1]
    c00 = a11 * a22 - a12 * a12
    c01 = a02 * a12 - a01 * a22
    c02 = a01 * a12 - a02 * a11
    c11 = a00 * a22 - a02 * a02
    c12 = a01 * a02 - a00 * a12
    c22 = a00 * a11 - a01 * a01
    det = a00 * c00 + a01 * c01 + a02 * c02
    g0, g1, g2 = m[3, 0], m[3, 1], m[3, 2]
    x[0] = (c00 * g0 + c01 * g1 + c02 * g2) / det
    x[1] = (c01 * g0 + c11 * g1 + c12 * g2) / det
    x[2] = (c02 * g0 + c12 * g1 + c22 * g2) / det


@inner_kernel
def least_thrust(
    b: _Array,
    gap: _Array,
    n: int,
    n_forward: int,
    c: float,
    lam: _Array,
    z: float,
    now: _Array,
    dv: _Array,
    w: Workspace,
) -> float:
    """Solve: least z with sum b_i dv_i = gap and |dv_i| = c y_i(z); write dv; return z or -1.

    The dual is the largest z(lam) over 6-vectors lam, where z(lam) solves
    c sum y_i(z) |b_i^T lam| = lam . gap. At its optimum some b_i^T lam may well be
    zero, where the thrust turns round, so the norms are softened and the Newton
    steps are those of Andersen, Christiansen, Conn and Overton 2000 ("An efficient
    primal-dual interior-point method for minimizing a sum of Euclidean norms"),
    which carry the thrust directions as unknowns of their own.

    Such a segment would thrust partly; but a lighter spacecraft may be heavier at
    the start, so it pays to thrust fully even there, in the direction that the other
    segments make up for most cheaply; `now` settles its sign where both are alike.

    Free ends are impulses with bounds of their own that do not depend on z, and may be shorter.
    At an open end lam has to be perpendicular to all b^T: it has three dimensions.

    `b` and `gap` are whitened; `lam` holds the first guess and receives the
    solution, norm 1.
    """
    end = open_end(n, w)
    if end < 0:
        return _least_thrust(b, gap, n, n_forward, c, lam, z, now, dv, end, w)
    turn_to_open_end(b, gap, lam, n, end, w)
    for i in range(3):
        lam[i] = 0.0
    z = _least_thrust(b, gap, n, n_forward, c, lam, z, now, dv, end, w)
    close_by_open_end(b, gap, n, end, dv)
    turn_back(b, gap, lam, n, w)
    return z


@inner_kernel
def _least_thrust(
    b: _Array,
    gap: _Array,
    n: int,
    n_forward: int,
    c: float,
    lam: _Array,
    z: float,
    now: _Array,
    dv: _Array,
    end: int,
    w: Workspace,
) -> float:
    """As `least_thrust`, in coordinates that are turned to an open end, if there is one."""
    primer, thrust = w.n3[PRIMER], w.n3[THRUST]
    norm, y, pinned = w.s[NORM], w.s[Y], w.s[PINNED]
    h, lower, turned = w.m[HESSIAN], w.m[HESSIAN_LOWER], w.m[TURNED]
    z = min(z, 0.5 / n) if z > 0.0 else 0.5 / n
    work = 0.0
    for i in range(6):
        work += lam[i] * gap[i]
    for i in range(n):
        pinned[i] = 0.0
    if has_free_ends(n, w):
        excess = _primers(b, lam, n, thrust, primer, norm, w)
        if not work > excess and not _beyond_ends(b, gap, n, lam, dv, end, w):
            # The ends close the gap alone.
            return _NO_THRUST
    elif not work > 0.0:
        for i in range(6):
            lam[i] = gap[i]
    size = 0.0
    for i in range(6):
        size += lam[i] * lam[i]
    size = math.sqrt(size)
    if not (0.0 < size < np.inf):
        return -1.0
    for i in range(6):
        lam[i] /= size
    z = _climb(b, gap, n, n_forward, c, lam, z, end, w)
    if not z > 0.0:
        return -1.0
    some = False
    for i in range(n):
        total = 0.0
        for j in range(3):
            thrust[i, j] = primer[i, j] / norm[i]
            total += thrust[i, j] ** 2
        if total < _FULL * _FULL and w.s[FREE, i] == 0.0:
            pinned[i] = 1.0
            some = True
    if some:
        _curvature(b, n, c, y, primer, norm, thrust, pinned, lam, h, turned[5], turned)
        if end >= 0:
            keep_out(h, turned[5], turned[5])
        if not cholesky(h, lower):
            return -1.0
        for i in range(n):
            if pinned[i] > 0.0:
                size = 1e-300
                for j in range(3):
                    size += abs(now[i, j])
                for j in range(3):
                    thrust[i, j] += 1e-7 * now[i, j] / size
                _pin_direction(b[i], lower, turned, thrust[i])
        z = _climb(b, gap, n, n_forward, c, lam, z, end, w)
        if not z > 0.0:
            return -1.0
    for i in range(n):
        for j in range(3):
            if pinned[i] == 0.0:
                thrust[i, j] = primer[i, j] / norm[i]
            dv[i, j] = c * y[i] * thrust[i, j]
    return z
