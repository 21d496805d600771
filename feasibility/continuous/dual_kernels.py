"""The convex problem of one iteration, solved by its dual, which has six unknowns.

With the arc linearised about throttles v_k (sizes z_k), the least of

    sum dt_k s_k + prox/2 sum dt_k |u_k - v_k|^2 + price e + bend/2 e^2 + stiff/2 |miss|^2

over throttles |u_k| <= s_k <= 1, a delay of the arrival e in [low, high] and the miss, where

    sum (B_k u_k + N_k s_k) + g e + miss = b.

Given the multipliers `lam` of these six equations, each segment's best throttle has a closed
form: along p = B_k^T lam + prox dt_k v_k, with the size of which the switching function
|p| + N_k lam - dt_k decides. The dual function is concave with a continuous gradient; Newton's
method with backtracking finds its maximum. At a fixed point u = v the proximal term is gone, so
the result is the optimum of the problem itself, bang-bang where that is.
"""

import math

import numpy as np
from numpy.typing import NDArray

from feasibility.runtime.jit import inner_kernel, kernel

_ITERATIONS = 120
_HALVINGS = 40
_ARMIJO = 1e-4
_TINY = 1e-300

_Array = NDArray[np.float64]


@inner_kernel
def evaluate(
    lam: _Array,
    b: _Array,
    by_u: _Array,
    by_s: _Array,
    dt: _Array,
    v: _Array,
    prox: float,
    stiff: float,
    g: _Array,
    delay: _Array,
    u: _Array,
    residual: _Array,
    hessian: _Array,
    with_hessian: bool,
) -> float:
    """Return the dual function; write the best throttles, what they miss, and the curvature.

    `delay` has price, bend, low, high and, written, the best delay.
    """
    value = 0.0
    for i in range(6):
        value += lam[i] * b[i] - 0.5 * lam[i] * lam[i] / stiff
        residual[i] = b[i] - lam[i] / stiff
        if with_hessian:
            for j in range(6):
                hessian[i, j] = 1.0 / stiff if i == j else 0.0
    p = np.empty(3)
    along = np.empty(6)
    for k in range(len(dt)):
        size = 0.0
        for c in range(3):
            total = prox * dt[k] * v[k, c]
            for i in range(6):
                total += by_u[k, i, c] * lam[i]
            p[c] = total
            size += total * total
        size = math.sqrt(size) + _TINY
        switch = size - dt[k]
        for i in range(6):
            switch += by_s[k, i] * lam[i]
        s = switch / (prox * dt[k])
        partial = s > 0.0 and s < 1.0
        s = min(max(s, 0.0), 1.0)
        value += s * (0.5 * prox * dt[k] * s - switch)
        # The constant of the proximal term.
        value += 0.5 * prox * dt[k] * (v[k, 0] ** 2 + v[k, 1] ** 2 + v[k, 2] ** 2)
        for c in range(3):
            u[k, c] = s * p[c] / size
        if s == 0.0:
            continue
        for i in range(6):
            total = 0.0
            for c in range(3):
                total += by_u[k, i, c] * p[c]
            along[i] = total / size
            residual[i] -= s * (along[i] + by_s[k, i])
        if not with_hessian:
            continue
        turn = s / size
        rise = 1.0 / (prox * dt[k]) if partial else 0.0
        for i in range(6):
            whole = along[i] + by_s[k, i]
            for j in range(i + 1):
                total = -along[i] * along[j]
                for c in range(3):
                    total += by_u[k, i, c] * by_u[k, j, c]
                hessian[i, j] += turn * total + rise * whole * (along[j] + by_s[k, j])
    slope = -delay[0]
    for i in range(6):
        slope += g[i] * lam[i]
    e = min(max(slope / delay[1], delay[2]), delay[3])
    value += e * (0.5 * delay[1] * e - slope)
    for i in range(6):
        residual[i] -= g[i] * e
        if with_hessian:
            for j in range(i + 1):
                if e > delay[2] and e < delay[3]:
                    hessian[i, j] += g[i] * g[j] / delay[1]
    delay[4] = e
    return float(value)


@inner_kernel
def cholesky_solve(matrix: _Array, damping: float, rhs: _Array, lower: _Array, x: _Array) -> bool:
    """Solve (matrix + damping diag(matrix)) x = rhs for a symmetric matrix of six rows."""
    for i in range(6):
        for j in range(i + 1):
            total = matrix[i, j] * (1.0 + damping if i == j else 1.0)
            for k in range(j):
                total -= lower[i, k] * lower[j, k]
            if i == j:
                if not total > 0.0:
                    return False
                lower[i, i] = math.sqrt(total)
            else:
                lower[i, j] = total / lower[j, j]
    for i in range(6):
        total = rhs[i]
        for k in range(i):
            total -= lower[i, k] * x[k]
        x[i] = total / lower[i, i]
    for i in range(5, -1, -1):
        total = x[i]
        for k in range(i + 1, 6):
            total -= lower[k, i] * x[k]
        x[i] = total / lower[i, i]
    return True


@kernel
def least_thrust(
    lam: _Array,
    b: _Array,
    by_u: _Array,
    by_s: _Array,
    dt: _Array,
    v: _Array,
    prox: float,
    stiff: float,
    g: _Array,
    delay: _Array,
    tolerance: float,
    u: _Array,
) -> float:
    """Solve the problem; return the largest residual of the equations, `miss` accounted for.

    Parameters
    ----------
    lam : (6,) array
        Multipliers to begin with; overwritten by those of the solution.
    b, by_u, by_s, dt, v, prox, stiff, g
        (6,), (n, 6, 3), (n, 6), (n,), (n, 3), numbers and (6,): the problem as above.
    delay : (5,) array
        Price, bend, low and high of the delay; the last entry is overwritten by the delay.
    tolerance : float
        Residual at which to stop.
    u : (n, 3) array
        Written: the throttles.
    """
    residual, trial_residual = np.empty(6), np.empty(6)
    hessian, lower = np.empty((6, 6)), np.zeros((6, 6))
    step, trial = np.empty(6), np.empty(6)
    value = evaluate(lam, b, by_u, by_s, dt, v, prox, stiff, g, delay, u, residual, hessian, True)
    worst = float(np.abs(residual).max())
    damping = 1e-12
    for _ in range(_ITERATIONS):
        if worst < tolerance:
            break
        while not cholesky_solve(hessian, damping, residual, lower, step):
            damping *= 10.0
        slope = 0.0
        for i in range(6):
            slope += residual[i] * step[i]
        fraction = 1.0
        better = False
        for _ in range(_HALVINGS):
            for i in range(6):
                trial[i] = lam[i] + fraction * step[i]
            trial_value = evaluate(
                trial,
                b,
                by_u,
                by_s,
                dt,
                v,
                prox,
                stiff,
                g,
                delay,
                u,
                trial_residual,
                hessian,
                False,
            )
            shrunk = np.abs(trial_residual).max() < 0.5 * worst
            if trial_value >= value + _ARMIJO * fraction * slope or shrunk:
                better = True
                break
            fraction *= 0.5
        if not better:
            break
        for i in range(6):
            lam[i] = trial[i]
        value = evaluate(
            lam, b, by_u, by_s, dt, v, prox, stiff, g, delay, u, residual, hessian, True
        )
        worst = float(np.abs(residual).max())
    # The last trial may have been refused: the throttles are those of `lam`.
    evaluate(lam, b, by_u, by_s, dt, v, prox, stiff, g, delay, u, residual, hessian, False)
    return worst
