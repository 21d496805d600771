"""Minimum propellant at a given initial mass, by sequential linearisation with thrust bounds."""

import math

import numpy as np
from numpy.typing import NDArray

from feasibility.runtime.jit import inner_kernel, kernel
from feasibility.sims_flanagan.fast.algebra_kernels import (
    cholesky,
    multiply_lower_transposed,
    norm6,
    solve_lower,
    solve_lower_transposed,
)
from feasibility.sims_flanagan.fast.arc_kernels import linearise, whitened_gap
from feasibility.sims_flanagan.fast.dual_kernels import (
    close_by_open_end,
    keep_out,
    turn_back,
    turn_to_open_end,
)
from feasibility.sims_flanagan.fast.element_kernels import to_elements
from feasibility.sims_flanagan.fast.frame_kernels import (
    backward_impulse,
    read_throttles,
    scale_leg,
    write_throttles,
)
from feasibility.sims_flanagan.fast.workspace_kernels import (
    CAP,
    DV,
    E1,
    FREE,
    GAP,
    HESSIAN,
    HESSIAN_LOWER,
    LAM,
    LIMIT,
    LINEAR,
    LOWER,
    M_ONE,
    M_TWO,
    NORM,
    PRIMER,
    STEP,
    THRESHOLD,
    TOTAL,
    TRIAL,
    TRIAL_GAP,
    TRIAL_LAM,
    WEIGHT,
    WORK,
    Workspace,
    lay_timeline,
    make_workspace,
    open_end,
)

_OUTER = 60
_NEWTON = 30
_SOFTEST = 0.3
_SHARPEST = 0.003
# Share of the needed thrust that softened switching may give to segments that should coast.
_LEAK = 0.3
_FLOOR = 1e-3
# Softness of the excess at free ends, in units of that of switching.
_ROUND = 0.1
_REJECTIONS = 4
_ATTEMPTS = 4
_MISSING = 1e-2
_CORRECTIONS = 8
_CLOSED = 1e-11

_Array = NDArray[np.float64]


@inner_kernel
def clip_to_thrust(dv: _Array, n: int, n_forward: int, c: float, z: float, w: Workspace) -> float:
    """Shorten impulses to full thrust, masses followed from z = T dt / (m0 c); write the bounds.

    Excess velocities of free ends are shortened to theirs. Returns the sum of the impulses, which
    is what the propellant grows with.
    """
    free, limit, cap = w.s[FREE], w.s[LIMIT], w.s[CAP]
    total = 0.0
    for i in range(n):
        size = math.sqrt(dv[i, 0] ** 2 + dv[i, 1] ** 2 + dv[i, 2] ** 2)
        if free[i] > 0.0:
            cap[i] = limit[i]
            if size > cap[i]:
                for j in range(3):
                    dv[i, j] *= cap[i] / size
            continue
        cap[i] = c * (z if i < n_forward else backward_impulse(z))
        if size > cap[i]:
            for j in range(3):
                dv[i, j] *= cap[i] / size
            size = cap[i]
        z *= math.exp(size / c)
        total += size
    return total


@inner_kernel
def restore_bounded(
    x0: _Array,
    dv: _Array,
    n: int,
    n_forward: int,
    c: float,
    z: float,
    target: _Array,
    w: Workspace,
) -> bool:
    """Close an arc without exceeding full thrust, by the segments that thrust; return whether.

    Corrections are weighted by the thrust; a segment at full thrust only turns. The
    sensitivities at hand are used first, those of the arc itself where they fail.
    """
    for attempt in range(_ATTEMPTS):
        if attempt > 0 and not linearise(x0, dv, n, target, w, w.v[TRIAL_GAP]) < np.inf:
            return False
        if _correct_bounded(x0, dv, n, n_forward, c, z, target, w):
            return True
    return False


@inner_kernel
def _ease(k: int, share: float, w: Workspace) -> float:
    """Return the weight of an impulse in corrections: its share of full thrust, nearly."""
    if w.s[FREE, k] > 0.0:
        return float(w.s[WEIGHT, k])
    return share + _FLOOR


@inner_kernel
def _correct_bounded(
    x0: _Array,
    dv: _Array,
    n: int,
    n_forward: int,
    c: float,
    z: float,
    target: _Array,
    w: Workspace,
) -> bool:
    """Correct with the sensitivities at hand until closed or no longer contracting."""
    b, gap, cap = w.b[0], w.v[TRIAL_GAP], w.s[CAP]
    gram, lower = w.m[M_ONE], w.m[M_TWO]
    along = w.v[WORK]
    clip_to_thrust(dv, n, n_forward, c, z, w)
    size = whitened_gap(x0, dv, n, target, w, gap)
    if size < _CLOSED:
        return True
    for i in range(6):
        for j in range(6):
            gram[i, j] = 0.0
    for k in range(n):
        thrust = math.sqrt(dv[k, 0] ** 2 + dv[k, 1] ** 2 + dv[k, 2] ** 2)
        weight = _ease(k, thrust / cap[k], w)
        bound = weight / (thrust * thrust) if thrust > 0.999 * cap[k] else 0.0
        for i in range(6):
            along[i] = b[k, i, 0] * dv[k, 0] + b[k, i, 1] * dv[k, 1] + b[k, i, 2] * dv[k, 2]
            for j in range(i + 1):
                gram[i, j] += (
                    weight
                    * (b[k, i, 0] * b[k, j, 0] + b[k, i, 1] * b[k, j, 1] + b[k, i, 2] * b[k, j, 2])
                    - bound * along[i] * along[j]
                )
    if not cholesky(gram, lower):
        return False
    for _ in range(_CORRECTIONS):
        if not size < np.inf:
            return False
        solve_lower(lower, gap)
        solve_lower_transposed(lower, gap)
        for k in range(n):
            thrust = math.sqrt(dv[k, 0] ** 2 + dv[k, 1] ** 2 + dv[k, 2] ** 2)
            weight = _ease(k, thrust / cap[k], w)
            d0 = d1 = d2 = 0.0
            for i in range(6):
                d0 += b[k, i, 0] * gap[i]
                d1 += b[k, i, 1] * gap[i]
                d2 += b[k, i, 2] * gap[i]
            radial = 0.0
            if thrust > 0.999 * cap[k]:
                radial = (d0 * dv[k, 0] + d1 * dv[k, 1] + d2 * dv[k, 2]) / (thrust * thrust)
            dv[k, 0] -= weight * (d0 - radial * dv[k, 0])
            dv[k, 1] -= weight * (d1 - radial * dv[k, 1])
            dv[k, 2] -= weight * (d2 - radial * dv[k, 2])
        clip_to_thrust(dv, n, n_forward, c, z, w)
        new_size = whitened_gap(x0, dv, n, target, w, gap)
        if new_size < _CLOSED:
            return True
        if not new_size < 0.5 * size:
            return False
        size = new_size
    return False


@inner_kernel
def _dual_value(
    b: _Array,
    total: _Array,
    lam: _Array,
    n: int,
    cap: _Array,
    threshold: _Array,
    sharpness: float,
    primer: _Array,
    norm: _Array,
    w: Workspace,
) -> float:
    """Write the primers; return lam . total - sum of the softened dual terms."""
    value = 0.0
    for i in range(6):
        value += lam[i] * total[i]
    for i in range(n):
        free = w.s[FREE, i] > 0.0
        size = (_ROUND * sharpness) ** 2 / w.s[WEIGHT, i] if free else 1e-12
        for j in range(3):
            p = 0.0
            for k in range(6):
                p += b[i, k, j] * lam[k]
            primer[i, j] = p
            size += p * p
        norm[i] = math.sqrt(size)
        if free:
            value -= w.s[FREE, i] * norm[i]
            continue
        u = (norm[i] - threshold[i]) / sharpness
        value -= cap[i] * sharpness * (max(u, 0.0) + math.log1p(math.exp(-abs(u))))
    return value


@inner_kernel
def least_propellant(
    b: _Array, total: _Array, lam: _Array, n: int, sharpness: float, linear: _Array, w: Workspace
) -> float:
    """Solve: least sum |dv_i| with sum b_i dv_i = total and |dv_i| <= cap_i; write linear.

    The dual in lam (6,) is lam . total - sum cap_i max(0, |b_i^T lam| - threshold_i):
    thrust where the primer exceeds the threshold. The maximum is softened to
    sharpness * log(1 + exp(./sharpness)), and damped Newton steps are taken on lam.
    The excess at free ends costs nothing within its bounds. Returns the part of `total` that is
    missing.
    """
    end = open_end(n, w)
    if end < 0:
        return _least_propellant(b, total, lam, n, sharpness, linear, end, w)
    turn_to_open_end(b, total, lam, n, end, w)
    for i in range(3):
        lam[i] = 0.0
    missing = _least_propellant(b, total, lam, n, sharpness, linear, end, w)
    close_by_open_end(b, total, n, end, linear)
    turn_back(b, total, lam, n, w)
    return missing


@inner_kernel
def _least_propellant(
    b: _Array,
    total: _Array,
    lam: _Array,
    n: int,
    sharpness: float,
    linear: _Array,
    end: int,
    w: Workspace,
) -> float:
    """As `least_propellant`, in coordinates that are turned to an open end, if there is one."""
    primer, norm, cap, threshold = w.n3[PRIMER], w.s[NORM], w.s[CAP], w.s[THRESHOLD]
    h, lower, step, trial = w.m[HESSIAN], w.m[HESSIAN_LOWER], w.v[STEP], w.v[TRIAL_LAM]
    along = w.v[WORK]
    value = _dual_value(b, total, lam, n, cap, threshold, sharpness, primer, norm, w)
    for _ in range(_NEWTON):
        for i in range(6):
            step[i] = total[i]
            for j in range(i + 1):
                h[i, j] = 0.0
        trace = 0.0
        for k in range(n):
            u = (norm[k] - threshold[k]) / sharpness
            share = 1.0 / (1.0 + math.exp(-min(max(u, -500.0), 500.0)))
            thrust = cap[k] * share
            stiff = thrust * (1.0 - share) / sharpness
            if w.s[FREE, k] > 0.0:
                thrust = w.s[FREE, k]
                stiff = 0.0
            turn = thrust / norm[k]
            for i in range(6):
                along[i] = (
                    b[k, i, 0] * primer[k, 0]
                    + b[k, i, 1] * primer[k, 1]
                    + b[k, i, 2] * primer[k, 2]
                ) / norm[k]
                step[i] -= thrust * along[i]
                for j in range(i + 1):
                    h[i, j] += (
                        turn
                        * (
                            b[k, i, 0] * b[k, j, 0]
                            + b[k, i, 1] * b[k, j, 1]
                            + b[k, i, 2] * b[k, j, 2]
                        )
                        + (stiff - turn) * along[i] * along[j]
                    )
        for i in range(6):
            trace += h[i, i]
        for i in range(6):
            h[i, i] += 1e-9 * trace + 1e-14
        if end >= 0:
            keep_out(h, step, step)
        if not cholesky(h, lower):
            break
        for i in range(6):
            along[i] = step[i]
        solve_lower(lower, step)
        solve_lower_transposed(lower, step)
        decrement = 0.0
        for i in range(6):
            decrement += step[i] * along[i]
        if not decrement > 1e-8 * abs(value):
            break
        fraction = 1.0
        better = False
        for _ in range(15):
            for i in range(6):
                trial[i] = lam[i] + fraction * step[i]
            new_value = _dual_value(b, total, trial, n, cap, threshold, sharpness, primer, norm, w)
            if new_value > value + 1e-4 * fraction * decrement:
                better = True
                break
            fraction *= 0.4
        if not better:
            break
        value = new_value
        for i in range(6):
            lam[i] = trial[i]
    _dual_value(b, total, lam, n, cap, threshold, sharpness, primer, norm, w)
    for k in range(n):
        u = (norm[k] - threshold[k]) / sharpness
        scale = cap[k] / (1.0 + math.exp(-min(max(u, -500.0), 500.0))) / norm[k]
        if w.s[FREE, k] > 0.0:
            scale = w.s[FREE, k] / norm[k]
        for j in range(3):
            linear[k, j] = scale * primer[k, j]
    missing = 0.0
    for i in range(3 if end >= 0 else 0, 6):
        gap = -total[i]
        for k in range(n):
            for j in range(3):
                gap += b[k, i, j] * linear[k, j]
        missing += gap * gap
    return math.sqrt(missing) / norm6(total)


@inner_kernel
def set_thresholds(
    linear: _Array,
    n: int,
    n_forward: int,
    c: float,
    norm: _Array,
    free: _Array,
    threshold: _Array,
) -> None:
    """Write the primer size at which each segment's thrust pays.

    1 for the propellant itself, less what the lighter spacecraft gains in later segments
    at full thrust: the derivative of the Lagrangian with bounds y_i exp(-S_i) <= z.
    """
    gained = 0.0
    for i in range(n - 1, -1, -1):
        if free[i] > 0.0:
            continue
        y = math.sqrt(linear[i, 0] ** 2 + linear[i, 1] ** 2 + linear[i, 2] ** 2) / c
        excess = max(norm[i] - threshold[i], 0.0)
        threshold[i] = 0.5 * (threshold[i] + max(1.0 - gained, 0.05))
        if i < n_forward:
            gained += excess * y
        else:
            gained += excess * y / max(1.0 - y, 0.1)


@inner_kernel
def softest_switching(total: float, n: int, free: _Array, cap: _Array) -> float:
    """Return the width of the softened switching to begin with.

    A coasting segment, whose primer is zero, still gets exp(-1 / width) of full thrust. On legs
    that need a few hundredths of full thrust this must be less than what they need.
    """
    full = 0.0
    for i in range(n):
        if free[i] == 0.0:
            full += cap[i]
    leak = _LEAK * total / full
    if leak > math.exp(-1.0 / _SOFTEST):
        return _SOFTEST
    return max(-1.0 / math.log(max(leak, 1e-300)), _SHARPEST)


@inner_kernel
def minimise_one(
    x0: _Array,
    target: _Array,
    c: float,
    z: float,
    n: int,
    n_forward: int,
    dv: _Array,
    w: Workspace,
) -> float:
    """Lower the impulses' sum of the closed, bounded arc `dv` in place; return it, inf if none."""
    b, gap, cap, lam, total = w.b[0], w.v[GAP], w.s[CAP], w.v[LAM], w.v[TOTAL]
    trial, linear, threshold, norm = w.n3[TRIAL], w.n3[LINEAR], w.s[THRESHOLD], w.s[NORM]
    size = linearise(x0, dv, n, target, w, gap)
    if not size < np.inf:
        return np.inf
    if not restore_bounded(x0, dv, n, n_forward, c, z, target, w):
        return np.inf
    for i in range(n):
        threshold[i] = 1.0
    for i in range(6):
        lam[i] = 0.0
    best = clip_to_thrust(dv, n, n_forward, c, z, w)
    softest = softest_switching(best, n, w.s[FREE], cap)
    sharpness = softest
    fraction = 1.0
    rejected = 0
    for _ in range(_OUTER):
        size = linearise(x0, dv, n, target, w, gap)
        if not size < np.inf:
            break
        for i in range(6):
            total[i] = -gap[i]
            for k in range(n):
                for j in range(3):
                    total[i] += b[k, i, j] * dv[k, j]
        # lam lives in element coordinates between linearisations.
        multiply_lower_transposed(w.m[LOWER], lam)
        clip_to_thrust(dv, n, n_forward, c, z, w)
        missing = least_propellant(b, total, lam, n, sharpness, linear, w)
        solve_lower_transposed(w.m[LOWER], lam)
        if not missing < _MISSING:
            # Lost in the saturated range: begin again, softly.
            rejected += 1
            if rejected >= _REJECTIONS:
                break
            for i in range(n):
                threshold[i] = 1.0
            for i in range(6):
                lam[i] = 0.0
            sharpness = softest
            continue
        set_thresholds(linear, n, n_forward, c, norm, w.s[FREE], threshold)
        predicted = 0.0
        for i in range(n):
            if w.s[FREE, i] > 0.0:
                continue
            predicted += math.sqrt(linear[i, 0] ** 2 + linear[i, 1] ** 2 + linear[i, 2] ** 2)
        sharp = sharpness <= _SHARPEST
        sharpness = max(0.4 * sharpness, _SHARPEST)
        if predicted > best * (1.0 - 1e-5):
            if sharp:
                break
            continue
        accepted = False
        for _ in range(7):
            for i in range(n):
                for j in range(3):
                    trial[i, j] = dv[i, j] + fraction * (linear[i, j] - dv[i, j])
            if restore_bounded(x0, trial, n, n_forward, c, z, target, w):
                new = clip_to_thrust(trial, n, n_forward, c, z, w)
                if new < best - 0.05 * fraction * (best - predicted):
                    accepted = True
                    break
            fraction *= 0.5
        if accepted:
            gain = (best - new) / best
            best = new
            for i in range(n):
                for j in range(3):
                    dv[i, j] = trial[i, j]
            fraction = min(1.0, 2.0 * fraction)
            if sharp and gain < 1e-5:
                break
        else:
            # A softer answer moves less abruptly where thrust switches on and off.
            rejected += 1
            if rejected >= _REJECTIONS:
                break
            fraction = 1.0
            sharpness = min(10.0 * sharpness, softest)
    return best


@kernel
def minimum_batch(
    rv0: _Array,
    rv1: _Array,
    tof: _Array,
    c: _Array,
    z: _Array,
    n: int,
    mu: float,
    throttles: _Array,
    mass_ratio: _Array,
) -> None:
    """Lower the propellant of every leg of a batch, SI units.

    Parameters
    ----------
    rv0, rv1 : (legs, 6) float64
        End states.
    tof, c : (legs,) float64
        Flight times and exhaust velocities.
    z : (legs,) float64
        T dt / (m0 c) at the wanted initial mass.
    n : int
        Segments.
    mu : float
        Gravitational parameter.
    throttles : (legs, n, 3) float64
        Holds throttles that close the leg at the wanted initial mass; receives better ones.
    mass_ratio : (legs,) float64
        Receives final over initial mass, 0 where the start did not close.
    """
    w = make_workspace(n)
    frame = np.empty((3, 3))
    x0 = np.empty(6)
    x1 = np.empty(6)
    target = w.v[E1]
    dv = w.n3[DV]
    for row in range(rv0.shape[0]):
        length, speed = scale_leg(rv0[row], rv1[row], mu, frame, x0, x1)
        if not to_elements(x1, target):
            continue
        ce = c[row] / speed
        read_throttles(throttles[row], z[row], ce, n, frame, dv)
        lay_timeline(tof[row] * speed / length, n, 0.0, 0.0, 1.0, w)
        if minimise_one(x0, target, ce, z[row], n, n // 2, dv, w) < np.inf:
            mass_ratio[row] = write_throttles(dv, z[row], ce, n, frame, throttles[row])
