"""The second-order finish: Newton's method on the thrust directions of a closed arc.

At the maximum initial mass every segment thrusts fully, so the arc is a function of its
thrust directions and of z, and the optimum is where the primers B_i^T lambda are
along (or against) the thrust. Linearisation alone crawls, or stops, where the curvature
of the dynamics outweighs that of the thrust bound: where primers are short.
"""

import math

import numpy as np
from numpy.typing import NDArray

from feasibility.runtime.jit import inner_kernel, kernel
from feasibility.sims_flanagan.fast.algebra_kernels import (
    cholesky,
    solve_lower,
    solve_lower_transposed,
)
from feasibility.sims_flanagan.fast.arc_kernels import (
    coast_to,
    coast_to_stm,
    linearise,
    whitened_gap,
)
from feasibility.sims_flanagan.fast.dual_kernels import full_thrust_profile, z_of_impulses
from feasibility.sims_flanagan.fast.element_kernels import element_derivatives
from feasibility.sims_flanagan.fast.workspace_kernels import (
    CAP,
    COAST,
    D_MOVED,
    D_RESIDUAL,
    FREE,
    GAP,
    HESSIAN,
    HESSIAN_LOWER,
    LAM,
    LIMIT,
    LOWER,
    M_ONE,
    NORM,
    PINNED,
    SLOPE,
    STEP,
    THRESHOLD,
    TOTAL,
    TRIAL_GAP,
    TRIAL_LAM,
    WORK,
    Workspace,
    X,
    Y,
)

_DIFFERENCE = 1e-4
_DAMPINGS = 12
_STIFF = 10.0
_ITERATIONS = 12
_GAIN = 2e-5
_FIRST_DAMPING = 0.03
_CLOSED = 1e-9
_CORRECTIONS = 12
_LARGEST_TURN = 1.5
_LARGEST_RISE = 1.03
# Rows of Workspace.n3 that belong to Anderson's rule, which is at rest here.
_U, _FIRST, _SECOND, _PRIMER, _TRIAL_U, _ARC = range(D_RESIDUAL, D_RESIDUAL + 6)
# Rows of Workspace.s that are free here: lengths of the excess velocities at free ends, now and
# before the step, whether they may change, and the unit of each impulse's steps.
_EXCESS, _EXCESS_BEFORE, _LOOSE, _STEP = THRESHOLD, CAP, PINNED, NORM
_SHORTEST = 1e-6
_AT_BOUND = 0.999

_Array = NDArray[np.float64]


@kernel
def factor(table: _Array, size: int, shift: float) -> bool:
    """Write the Cholesky factor of the matrix in the first `size` rows, `shift` added, below it.

    Returns whether the matrix is positive definite; only its lower triangle is read.
    """
    for i in range(size):
        for j in range(i + 1):
            total = table[i, j]
            if i == j:
                total += shift
            for k in range(j):
                total -= table[size + i, k] * table[size + j, k]
            if i == j:
                if not total > 0.0:
                    return False
                table[size + i, i] = math.sqrt(total)
            else:
                table[size + i, j] = total / table[size + j, j]
    return True


@kernel
def solve_columns(table: _Array, size: int) -> None:
    """Write into the six columns right of the factor its solutions for the six above them."""
    for q in range(size, size + 6):
        for i in range(size):
            total = table[i, q]
            for k in range(i):
                total -= table[size + i, k] * table[size + k, q]
            table[size + i, q] = total / table[size + i, i]
        for i in range(size - 1, -1, -1):
            total = table[size + i, q]
            for k in range(i + 1, size):
                total -= table[size + k, i] * table[size + k, q]
            table[size + i, q] = total / table[size + i, i]


@inner_kernel
def _stiffness(
    table: _Array, size: int, below: int, pull: _Array, gram: _Array, lower: _Array
) -> float:
    """Write and factor the response of the end to turns, M = A W^-1 A^T + ease a a^T.

    At the optimum turns alone move the end in five dimensions only, A^T lambda = 0: the
    sixth is left to z. Returns the weight of z, 0 where there is no factor.
    """
    trace = 0.0
    square = 0.0
    for q in range(6):
        for p in range(q + 1):
            total = 0.0
            for row in range(size):
                total += table[row, size + q] * table[below + row, size + p]
            gram[q, p] = total
        trace += gram[q, q]
        square += pull[q] * pull[q]
    ease = trace / square
    for q in range(6):
        for p in range(q + 1):
            gram[q, p] += ease * pull[q] * pull[p]
    return ease if cholesky(gram, lower) else 0.0


@inner_kernel
def _tangents(u: _Array, first: _Array, second: _Array) -> None:
    """Write two unit vectors across the unit vector `u`."""
    axis = int(0)
    for j in range(3):
        if abs(u[j]) < abs(u[axis]):
            axis = j
    size = math.sqrt(1.0 - u[axis] * u[axis])
    for j in range(3):
        first[j] = ((1.0 if j == axis else 0.0) - u[axis] * u[j]) / size
    second[0] = u[1] * first[2] - u[2] * first[1]
    second[1] = u[2] * first[0] - u[0] * first[2]
    second[2] = u[0] * first[1] - u[1] * first[0]


@inner_kernel
def _thrust(
    u: _Array, z: float, n: int, n_forward: int, c: float, arc: _Array, w: Workspace
) -> None:
    """Write the impulses of full thrust along the unit vectors `u`, and the excess of ends."""
    full_thrust_profile(z, n, n_forward, c, w.s[_EXCESS], w.s[Y], w.s[SLOPE])
    for i in range(n):
        for j in range(3):
            arc[i, j] = c * w.s[Y, i] * u[i, j]


@inner_kernel
def _turn(
    table: _Array, size: int, nu: _Array, n: int, u: _Array, trial: _Array, w: Workspace
) -> float:
    """Write the directions `u` turned by the step of the multipliers `nu`; return the largest."""
    largest = 0.0
    unknown = 2 * n
    for i in range(n):
        t0 = t1 = 0.0
        for q in range(6):
            t0 -= table[size + 2 * i, size + q] * nu[q]
            t1 -= table[size + 2 * i + 1, size + q] * nu[q]
        excess = w.s[_EXCESS, i]
        if excess > 0.0:
            t2 = 0.0
            if w.s[_LOOSE, i] > 0.0:
                for q in range(6):
                    t2 -= table[size + unknown, size + q] * nu[q]
                unknown += 1
            _turn_end(i, w.s[_STEP, i], t0, t1, t2, u[i], trial[i], w)
            largest = max(largest, w.s[_STEP, i] / excess * max(abs(t0), abs(t1), abs(t2)))
            continue
        length = 0.0
        for j in range(3):
            trial[i, j] = u[i, j] + t0 * w.n3[_FIRST, i, j] + t1 * w.n3[_SECOND, i, j]
            length += trial[i, j] * trial[i, j]
        length = math.sqrt(length)
        for j in range(3):
            trial[i, j] /= length
        largest = max(largest, abs(t0), abs(t1))
    return largest


@inner_kernel
def _turn_end(
    i: int,
    step: float,
    t0: float,
    t1: float,
    t2: float,
    u: _Array,
    trial: _Array,
    w: Workspace,
) -> None:
    """Write the excess velocity of a free end after a step: its direction and its length."""
    excess = w.s[_EXCESS, i]
    length = 0.0
    for j in range(3):
        trial[j] = (excess + step * t2) * u[j] + step * (
            t0 * w.n3[_FIRST, i, j] + t1 * w.n3[_SECOND, i, j]
        )
        length += trial[j] * trial[j]
    length = math.sqrt(length)
    for j in range(3):
        trial[j] /= length
    if w.s[_LOOSE, i] > 0.0:
        w.s[_EXCESS, i] = min(length, w.s[LIMIT, i])


@inner_kernel
def _curvature(x0: _Array, n: int, lam: _Array, table: _Array, size: int, w: Workspace) -> bool:
    """Write the Hessian of the Lagrangian in the tangent steps; return False where it cannot.

    By differences of the primers: a disturbed impulse changes the arc after it only.
    """
    arc, primer, step, coast = w.n3[_ARC], w.n3[_PRIMER], w.s[_STEP], w.s[COAST]
    states, x, psi, jacobian = w.n6[D_MOVED], w.v[X], w.v[WORK], w.m[M_ONE]
    coast_to(x0, coast[0], x)
    for i in range(n):
        for j in range(6):
            states[i, j] = x[j]
        for j in range(3):
            x[3 + j] += arc[i, j]
        coast_to(x, coast[i + 1], x)
    for row in range(size):
        i = row // 2
        across = w.n3[_FIRST if row % 2 == 0 else _SECOND, i]
        if row >= 2 * n:
            # A loose end may be longer too; only the last of them can be the arrival.
            i = int(0) if row == 2 * n and w.s[_LOOSE, 0] > 0.0 else n - 1
            across = w.n3[_U, i]
        for j in range(6):
            x[j] = states[i, j]
        for j in range(3):
            x[3 + j] += step[i] * _DIFFERENCE * across[j]
        for k in range(i, n):
            for j in range(3):
                x[3 + j] += arc[k, j]
            coast_to_stm(x, coast[k + 1], x, w.m[k])
        if not element_derivatives(x, int(0), jacobian, w.v):
            return False
        for j in range(6):
            psi[j] = 0.0
            for q in range(6):
                psi[j] += jacobian[q, j] * lam[q]
        for k in range(n - 1, i - 1, -1):
            for j in range(6):
                x[j] = psi[j]
            for j in range(6):
                psi[j] = 0.0
                for q in range(6):
                    psi[j] += w.m[k, q, j] * x[q]
            scale = step[k] / _DIFFERENCE
            d0 = scale * (psi[3] - primer[k, 0])
            d1 = scale * (psi[4] - primer[k, 1])
            d2 = scale * (psi[5] - primer[k, 2])
            first = d0 * w.n3[_FIRST, k, 0] + d1 * w.n3[_FIRST, k, 1] + d2 * w.n3[_FIRST, k, 2]
            second = d0 * w.n3[_SECOND, k, 0] + d1 * w.n3[_SECOND, k, 1] + d2 * w.n3[_SECOND, k, 2]
            if row < 2 * n:
                table[2 * k, row] = first
                table[2 * k + 1, row] = second
            else:
                table[row, 2 * k] = first
                table[row, 2 * k + 1] = second
            if w.s[_LOOSE, k] > 0.0:
                loose = size - 1 if k == n - 1 else 2 * n
                table[loose, row] = d0 * w.n3[_U, k, 0] + d1 * w.n3[_U, k, 1] + d2 * w.n3[_U, k, 2]
        if row < 2 * n:
            along = 0.0
            for j in range(3):
                along += primer[i, j] * w.n3[_U, i, j]
            if w.s[_EXCESS, i] > 0.0:
                along *= step[i] / w.s[_EXCESS, i]
            table[row, row] -= step[i] * along
    return True


@inner_kernel
def _directions(dv: _Array, n: int, u: _Array) -> None:
    """Write the unit vectors along the impulses."""
    for i in range(n):
        length = 1e-300
        for j in range(3):
            length += dv[i, j] ** 2
        for j in range(3):
            u[i, j] = dv[i, j] / math.sqrt(length)


@inner_kernel
def _responses(n: int, c: float, pull: _Array, table: _Array, size: int, w: Workspace) -> None:
    """Write how the end moves with z, `pull`, and with turns, right of the Hessian in `table`."""
    u, y, slope, b = w.n3[_U], w.s[Y], w.s[SLOPE], w.b[0]
    mean = 0.0
    for i in range(n):
        if w.s[_EXCESS, i] == 0.0:
            mean += c * y[i] / n
    unknown = 2 * n
    for q in range(6):
        pull[q] = 0.0
    for i in range(n):
        _tangents(u[i], w.n3[_FIRST, i], w.n3[_SECOND, i])
        # Free ends move in steps like the segments'.
        step = c * y[i] if w.s[_EXCESS, i] == 0.0 else mean
        w.s[_STEP, i] = step
        loose = w.s[_LOOSE, i] > 0.0
        for q in range(6):
            t0 = t1 = along = 0.0
            for j in range(3):
                along += b[i, q, j] * u[i, j]
                t0 += b[i, q, j] * w.n3[_FIRST, i, j]
                t1 += b[i, q, j] * w.n3[_SECOND, i, j]
            pull[q] += c * slope[i] * along
            table[2 * i, size + q] = step * t0
            table[2 * i + 1, size + q] = step * t1
            if loose:
                table[unknown, size + q] = step * along
        if loose:
            unknown += 1


@inner_kernel
def _multipliers(n: int, c: float, pull: _Array, table: _Array, size: int, w: Workspace) -> float:
    """Write the multipliers, w.v[LAM], and primers by least squares across the thrust.

    The multipliers before whitening go to w.v[TRIAL_LAM]. Returns the mean of the primers,
    weighted with the impulses; 0 where there are no multipliers.
    """
    lam, lam_end, primer, b = w.v[LAM], w.v[TRIAL_LAM], w.n3[_PRIMER], w.b[0]
    gram, lower = w.m[HESSIAN], w.m[HESSIAN_LOWER]
    for q in range(6):
        lam[q] = pull[q]
    if not _stiffness(table, size, int(0), pull, gram, lower) > 0.0:
        return 0.0
    solve_lower(lower, lam)
    solve_lower_transposed(lower, lam)
    total = 0.0
    for q in range(6):
        total += pull[q] * lam[q]
    for q in range(6):
        lam[q] /= -total
        lam_end[q] = lam[q]
    solve_lower_transposed(w.m[LOWER], lam_end)
    mean = 0.0
    for i in range(n):
        long = 0.0
        for j in range(3):
            total = 0.0
            for q in range(6):
                total += b[i, q, j] * lam[q]
            primer[i, j] = total
            long += total * total
        if w.s[_EXCESS, i] == 0.0:
            mean += c * w.s[Y, i] * math.sqrt(long) / n
    return mean


@inner_kernel
def _stiffen(table: _Array, size: int, mean: float) -> None:
    """Add to the Hessian what asks positive definite only of turns that keep the end."""
    total = 0.0
    for row in range(size):
        for q in range(6):
            total += table[row, size + q] ** 2
    stiff = _STIFF * mean * size / total
    for row in range(size):
        for col in range(row + 1):
            total = 0.0
            for q in range(6):
                total += table[row, size + q] * table[col, size + q]
            table[row, col] += stiff * total


@inner_kernel
def _newton_step(
    ease: float, pull: _Array, gap: _Array, rise: _Array, lam: _Array, lower: _Array
) -> float:
    """Return the step of z; write that of the multipliers to `lam`. `rise` is overwritten."""
    for q in range(6):
        rise[q] = pull[q]
        lam[q] = gap[q]
    solve_lower(lower, rise)
    solve_lower_transposed(lower, rise)
    solve_lower(lower, lam)
    solve_lower_transposed(lower, lam)
    along = 0.0
    total = 1.0
    for q in range(6):
        along += pull[q] * rise[q]
        total += pull[q] * lam[q]
    dz = ease - total / along
    for q in range(6):
        lam[q] += (dz - ease) * rise[q]
    return dz


@inner_kernel
def _close_again(
    x0: _Array,
    n: int,
    n_forward: int,
    c: float,
    target: _Array,
    z: float,
    ease: float,
    pull: _Array,
    table: _Array,
    size: int,
    w: Workspace,
) -> float:
    """Close the arc of the turned directions by steps of the same metric; return its z or inf."""
    trial, arc, gap, lower = w.n3[_TRIAL_U], w.n3[_ARC], w.v[TRIAL_GAP], w.m[HESSIAN_LOWER]
    before = np.inf
    for _ in range(_CORRECTIONS):
        _thrust(trial, z, n, n_forward, c, arc, w)
        miss = whitened_gap(x0, arc, n, target, w, gap)
        if miss < _CLOSED:
            return z
        if not miss < 0.5 * before:
            break
        before = miss
        solve_lower(lower, gap)
        solve_lower_transposed(lower, gap)
        _turn(table, size, gap, n, trial, trial, w)
        for q in range(6):
            z -= ease * pull[q] * gap[q]
    return np.inf


@inner_kernel
def _look_at_ends(dv: _Array, n: int, w: Workspace) -> int:
    """Write the lengths of the excess velocities, and which are loose; return how many are."""
    count = 0
    for i in range(n):
        w.s[_EXCESS, i] = 0.0
        w.s[_LOOSE, i] = 0.0
        if w.s[FREE, i] > 0.0:
            size = math.sqrt(dv[i, 0] ** 2 + dv[i, 1] ** 2 + dv[i, 2] ** 2)
            w.s[_EXCESS, i] = max(size, _SHORTEST * w.s[LIMIT, i])
            if size < _AT_BOUND * w.s[LIMIT, i]:
                w.s[_LOOSE, i] = 1.0
                count += 1
    return count


@inner_kernel
def _keep_excess(n: int, w: Workspace) -> None:
    """Remember the lengths of the excess velocities before a step."""
    for i in range(0, n, max(n - 1, 1)):
        w.s[_EXCESS_BEFORE, i] = w.s[_EXCESS, i]


@inner_kernel
def _recall_excess(n: int, w: Workspace) -> None:
    """Take back what a step made of the excess velocities."""
    for i in range(0, n, max(n - 1, 1)):
        w.s[_EXCESS, i] = w.s[_EXCESS_BEFORE, i]


@inner_kernel
def polish(
    x0: _Array,
    dv: _Array,
    n: int,
    n_forward: int,
    c: float,
    target: _Array,
    w: Workspace,
) -> float:
    """Lower z of the closed arc `dv` by Newton steps on its thrust directions; return its z.

    Least z with the arc closed, in the tangent steps t_i of the directions and in z. The
    Hessian of the Lagrangian is damped (Levenberg 1944) until it is positive definite and
    the step, closed again by its own metric, lowers z. The excess of a free end turns as well;
    where it is shorter than its bound, it is loose: its length is one more unknown.
    """
    size = 2 * n + _look_at_ends(dv, n, w)
    table = np.empty((2 * size, size + 6))
    u, trial, arc = w.n3[_U], w.n3[_TRIAL_U], w.n3[_ARC]
    gap, lam, pull, rise = w.v[GAP], w.v[LAM], w.v[TOTAL], w.v[STEP]
    gram, lower = w.m[HESSIAN], w.m[HESSIAN_LOWER]
    z = z_of_impulses(dv, n, n_forward, c, w.s[FREE])
    _directions(dv, n, u)
    bound = _LARGEST_RISE * z
    best = z
    damping = 0.0
    for _ in range(_ITERATIONS):
        _thrust(u, z, n, n_forward, c, arc, w)
        if not linearise(x0, arc, n, target, w, gap) < np.inf:
            break
        _responses(n, c, pull, table, size, w)
        mean = _multipliers(n, c, pull, table, size, w)
        if not mean > 0.0 or not _curvature(x0, n, w.v[TRIAL_LAM], table, size, w):
            break
        _stiffen(table, size, mean)
        new_z = np.inf
        for _ in range(_DAMPINGS):
            if factor(table, size, damping * mean):
                solve_columns(table, size)
                ease = _stiffness(table, size, size, pull, gram, lower)
                if not ease > 0.0:
                    break
                dz = _newton_step(ease, pull, gap, rise, lam, lower)
                _keep_excess(n, w)
                if abs(dz) < 0.3 * z and _turn(table, size, lam, n, u, trial, w) < _LARGEST_TURN:
                    new_z = _close_again(
                        x0, n, n_forward, c, target, z + dz, ease, pull, table, size, w
                    )
                    if new_z < bound:
                        break
                _recall_excess(n, w)
            damping = max(2.5 * damping, _FIRST_DAMPING)
        if not new_z < bound:
            break
        gain = bound / new_z - 1.0
        z = new_z
        bound = z
        damping *= 0.4
        for i in range(n):
            for j in range(3):
                u[i, j] = trial[i, j]
        if z < best:
            best = z
            for i in range(n):
                for j in range(3):
                    dv[i, j] = arc[i, j]
        if gain < _GAIN:
            break
    return best
