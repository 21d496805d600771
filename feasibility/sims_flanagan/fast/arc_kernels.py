"""Arcs of impulses: shooting, closing and improving."""

import math

import numpy as np
from numpy.typing import NDArray

from feasibility.orbits.kepler_kernels import propagate, propagate_stm
from feasibility.runtime.jit import inner_kernel
from feasibility.sims_flanagan.fast.algebra_kernels import (
    cholesky,
    multiply_lower_transposed,
    norm6,
    solve_lower,
    solve_lower_transposed,
)
from feasibility.sims_flanagan.fast.dual_kernels import (
    correction_matrix,
    least_thrust,
    whiten,
    z_of_impulses,
)
from feasibility.sims_flanagan.fast.element_kernels import element_derivatives, element_gap
from feasibility.sims_flanagan.fast.workspace_kernels import (
    ALONG,
    COAST,
    FREE,
    GAP,
    LIMIT,
    LINEAR,
    LOWER,
    M_ONE,
    M_TWO,
    TRIAL,
    TRIAL_GAP,
    WEIGHT,
    WORK,
    Workspace,
    X,
    has_free_ends,
)

_AT_BOUND = 0.999
_END_ATTEMPTS = 3

_Array = NDArray[np.float64]


@inner_kernel
def coast_to(x0: _Array, dt: float, x: _Array) -> None:
    """Write into `x` the state a time `dt`, zero or more, after `x0`."""
    if dt > 0.0:
        propagate(x0, dt, 1.0, x)
    else:
        for j in range(6):
            x[j] = x0[j]


@inner_kernel
def coast_to_stm(x0: _Array, dt: float, x: _Array, stm: _Array) -> None:
    """As `coast_to`; also writes the transition matrix (6, 6)."""
    if dt > 0.0:
        propagate_stm(x0, dt, 1.0, x, stm)
    else:
        for j in range(6):
            x[j] = x0[j]
            for k in range(6):
                stm[j, k] = 1.0 if j == k else 0.0


@inner_kernel
def shoot(x0: _Array, dv: _Array, n: int, coast: _Array, x: _Array) -> None:
    """Write into `x` the end of the arc from `x0` with the impulses `dv`.

    `coast` (n + 1,) are the times before each impulse and after the last one.
    """
    coast_to(x0, coast[0], x)
    for i in range(n):
        x[3] += dv[i, 0]
        x[4] += dv[i, 1]
        x[5] += dv[i, 2]
        coast_to(x, coast[i + 1], x)


@inner_kernel
def shoot_stm(x0: _Array, dv: _Array, n: int, coast: _Array, x: _Array, stm: _Array) -> None:
    """As `shoot`; also writes the transition matrix (n, 6, 6) of each arc after an impulse."""
    coast_to(x0, coast[0], x)
    for i in range(n):
        x[3] += dv[i, 0]
        x[4] += dv[i, 1]
        x[5] += dv[i, 2]
        coast_to_stm(x, coast[i + 1], x, stm[i])


@inner_kernel
def look_at_ends(dv: _Array, n: int, w: Workspace) -> None:
    """Write which free ends are at their bounds: these turn in corrections, and do not grow."""
    for i in range(0, n, max(n - 1, 1)):
        limit = w.s[LIMIT, i]
        if w.s[FREE, i] > 0.0:
            size = math.sqrt(dv[i, 0] ** 2 + dv[i, 1] ** 2 + dv[i, 2] ** 2)
            for j in range(3):
                w.n3[ALONG, i, j] = dv[i, j] / size if size > _AT_BOUND * limit else 0.0


@inner_kernel
def let_ends_grow(n: int, w: Workspace) -> None:
    """Forget which free ends are at their bounds."""
    for i in range(0, n, max(n - 1, 1)):
        for j in range(3):
            w.n3[ALONG, i, j] = 0.0


@inner_kernel
def clip_ends(dv: _Array, n: int, w: Workspace) -> None:
    """Shorten the excess velocities of free ends to their bounds."""
    for i in range(0, n, max(n - 1, 1)):
        limit = w.s[LIMIT, i]
        if w.s[FREE, i] > 0.0:
            size = math.sqrt(dv[i, 0] ** 2 + dv[i, 1] ** 2 + dv[i, 2] ** 2)
            if size > limit:
                for j in range(3):
                    dv[i, j] *= limit / size


@inner_kernel
def sensitivities(
    stm: _Array, end_jacobian: _Array, n: int, b: _Array, m: _Array, m_next: _Array
) -> None:
    """Write b_i (6, 3) = d(end elements)/d(dv_i) from the arcs' matrices, last arc first."""
    for i in range(6):
        for j in range(6):
            m[i, j] = end_jacobian[i, j]
    for k in range(n - 1, -1, -1):
        for i in range(6):
            for j in range(6):
                total = 0.0
                for col in range(6):
                    total += m[i, col] * stm[k, col, j]
                m_next[i, j] = total
        for i in range(6):
            for j in range(6):
                m[i, j] = m_next[i, j]
            for j in range(3):
                b[k, i, j] = m[i, 3 + j]


@inner_kernel
def linearise(x0: _Array, dv: _Array, n: int, target: _Array, w: Workspace, gap: _Array) -> float:
    """Write whitened sensitivities and the whitened gap; return its norm, inf where it fails."""
    x = w.v[X]
    shoot_stm(x0, dv, n, w.s[COAST], x, w.m)
    if not element_gap(x, target, gap):
        return np.inf
    if not element_derivatives(x, int(0), w.m[LOWER], w.v):
        return np.inf
    sensitivities(w.m, w.m[LOWER], n, w.b[0], w.m[M_ONE], w.m[M_TWO])
    look_at_ends(dv, n, w)
    if not whiten(w.b[0], n, w.m[M_ONE], w.m[LOWER], w):
        return np.inf
    solve_lower(w.m[LOWER], gap)
    return norm6(gap)


@inner_kernel
def subtract(b: _Array, gap: _Array, fraction: float, n: int, dv: _Array, w: Workspace) -> None:
    """Take a fraction of the least-norm impulses with sum b_i dv_i = gap off `dv`.

    Free ends take part with their weights and stay within their bounds.
    """
    for i in range(n):
        if w.s[FREE, i] > 0.0:
            _subtract_end(b[i], gap, fraction * w.s[WEIGHT, i], w.n3[ALONG, i], dv[i])
            continue
        for j in range(3):
            total = 0.0
            for k in range(6):
                total += b[i, k, j] * gap[k]
            dv[i, j] -= fraction * total
    clip_ends(dv, n, w)


@inner_kernel
def _subtract_end(b: _Array, gap: _Array, fraction: float, along: _Array, dv: _Array) -> None:
    """Take a fraction of b^T gap, less what is along the excess at its bound, off `dv` (3,)."""
    d0 = d1 = d2 = 0.0
    for k in range(6):
        d0 += b[k, 0] * gap[k]
        d1 += b[k, 1] * gap[k]
        d2 += b[k, 2] * gap[k]
    radial = d0 * along[0] + d1 * along[1] + d2 * along[2]
    dv[0] -= fraction * (d0 - radial * along[0])
    dv[1] -= fraction * (d1 - radial * along[1])
    dv[2] -= fraction * (d2 - radial * along[2])


@inner_kernel
def whitened_gap(
    x0: _Array, dv: _Array, n: int, target: _Array, w: Workspace, gap: _Array
) -> float:
    """Write the whitened gap of an arc; return its norm, inf where the end is not elliptic."""
    x = w.v[X]
    shoot(x0, dv, n, w.s[COAST], x)
    if not element_gap(x, target, gap):
        return np.inf
    solve_lower(w.m[LOWER], gap)
    return norm6(gap)


@inner_kernel
def close(
    x0: _Array,
    dv: _Array,
    n: int,
    target: _Array,
    tolerance: float,
    iterations: int,
    w: Workspace,
) -> bool:
    """Close the arc by least-norm Gauss-Newton corrections; return whether it closed."""
    gap = w.v[GAP]
    trial_gap = w.v[TRIAL_GAP]
    trial = w.n3[TRIAL]
    for _ in range(iterations):
        size = linearise(x0, dv, n, target, w, gap)
        if not size < np.inf:
            return False
        if size < tolerance:
            return True
        fraction = 1.0
        accepted = False
        for _ in range(6):
            for i in range(n):
                for j in range(3):
                    trial[i, j] = dv[i, j]
            subtract(w.b[0], gap, fraction, n, trial, w)
            trial_size = whitened_gap(x0, trial, n, target, w, trial_gap)
            if trial_size < (1.0 - 0.3 * fraction) * size or trial_size < tolerance:
                accepted = True
                break
            fraction *= 0.4
        if not accepted:
            return False
        for i in range(n):
            for j in range(3):
                dv[i, j] = trial[i, j]
        if trial_size < tolerance:
            return True
    return False


@inner_kernel
def restore(
    x0: _Array, dv: _Array, n: int, target: _Array, tolerance: float, w: Workspace
) -> bool:
    """As `close` with the sensitivities at hand; gives up where it does not contract."""
    if not has_free_ends(n, w):
        return _contract(x0, dv, n, target, tolerance, bool(False), w)
    # An end that reaches its bound on the way spoils the contraction, once.
    for _ in range(_END_ATTEMPTS):
        look_at_ends(dv, n, w)
        correction_matrix(w.b[0], n, w.m[M_ONE], w)
        if not cholesky(w.m[M_ONE], w.m[M_TWO]):
            return False
        if _contract(x0, dv, n, target, tolerance, bool(True), w):
            return True
    return False


@inner_kernel
def _contract(
    x0: _Array, dv: _Array, n: int, target: _Array, tolerance: float, ends: bool, w: Workspace
) -> bool:
    """Correct while each step halves the gap; `ends` if the factor for them is in w.m[M_TWO]."""
    gap = w.v[TRIAL_GAP]
    size = whitened_gap(x0, dv, n, target, w, gap)
    for _ in range(8):
        if size < tolerance:
            return True
        if not size < np.inf:
            return False
        if ends:
            solve_lower(w.m[M_TWO], gap)
            solve_lower_transposed(w.m[M_TWO], gap)
        subtract(w.b[0], gap, 1.0, n, dv, w)
        new_size = whitened_gap(x0, dv, n, target, w, gap)
        if not new_size < 0.5 * size and not new_size < tolerance:
            return False
        size = new_size
    return size < tolerance


@inner_kernel
def improve(
    x0: _Array,
    dv: _Array,
    n: int,
    n_forward: int,
    c: float,
    target: _Array,
    iterations: int,
    gain_tolerance: float,
    z_stop: float,
    lam: _Array,
    w: Workspace,
) -> float:
    """Lower z of the closed arc `dv`; return its z (dv stays closed)."""
    gap = w.v[GAP]
    work = w.v[WORK]
    b = w.b[0]
    trial = w.n3[TRIAL]
    linear = w.n3[LINEAR]
    z = z_of_impulses(dv, n, n_forward, c, w.s[FREE])
    fraction = 1.0
    for _ in range(iterations):
        size = linearise(x0, dv, n, target, w, gap)
        if not size < np.inf:
            break
        for i in range(6):
            total = -gap[i]
            for k in range(n):
                for j in range(3):
                    total += b[k, i, j] * dv[k, j]
            work[i] = total
        # lam lives in element coordinates between linearisations.
        multiply_lower_transposed(w.m[LOWER], lam)
        z_linear = least_thrust(b, work, n, n_forward, c, lam, z, dv, linear, w)
        solve_lower_transposed(w.m[LOWER], lam)
        if not z_linear > 0.0:
            break
        gain = math.log(z / z_linear)
        if gain < gain_tolerance or z_linear > z_stop:
            break
        accepted = False
        for _ in range(10):
            for i in range(n):
                for j in range(3):
                    trial[i, j] = dv[i, j] + fraction * (linear[i, j] - dv[i, j])
            if restore(x0, trial, n, target, 1e-9, w):
                trial_z = z_of_impulses(trial, n, n_forward, c, w.s[FREE])
                if math.log(z / trial_z) > 0.1 * fraction * gain:
                    accepted = True
                    break
            fraction *= 0.5
        if not accepted:
            break
        for i in range(n):
            for j in range(3):
                dv[i, j] = trial[i, j]
        z = trial_z
        fraction = min(1.0, 2.0 * fraction)
    return z
