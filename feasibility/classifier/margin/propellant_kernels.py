"""The least propellant of a leg, estimated along a path through element space.

As in `path_kernels`, impulses u_i lead along a path from one orbit to the other if
sum_i C_i u_i = d. Here their sum is to be small, each of them at most what the engine can do
in a segment. At the optimum p with u_i = w_i C_i^T p, a segment coasts where |C_i^T p| < 1,
thrusts fully where it is above 1, and partly where it is 1. Reweighted least squares leads there:

    w_i <- min(w_i |C_i^T p|^1.5, bound_i / |C_i^T p|),    p <- (sum_i w_i C_i C_i^T)^-1 d.

The power 1 would be the classical rule for sums of norms; 1.5 has the same fixed points and gets
there in half the steps. The impulses added up give a better path, on which all is repeated.
"""

import math

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.margin.feature_kernels import least_motion, to_frame, wrapped
from feasibility.classifier.margin.path_kernels import (
    N_NODES,
    SATURATED,
    STRIDE,
    duals,
    first_path,
    flown_path,
    gauss_rows,
    weighted_solve,
    workspace,
)
from feasibility.runtime.jit import inner_kernel, kernel
from feasibility.sims_flanagan.fast.element_kernels import to_elements

_Array = NDArray[np.float64]

N_SUMS = 5
N_GROUPS = 5
N_HINTS = N_SUMS + 1 + N_GROUPS

_ROUNDS = 3
_FIRST_STEPS = 5
_NEXT_STEPS = 4
_DAMPING = 0.65
_TWO_PI = 2.0 * math.pi
_FULL = 0.95
_LEAST_WEIGHT = 1e-4
_MOST_BURNT = 3.0


@inner_kernel
def least_impulses(
    rows: _Array,
    d: _Array,
    exhaust_velocity: float,
    push: float,
    steps: int,
    p: _Array,
    weights: _Array,
    g: _Array,
    bound: _Array,
) -> float:
    """Return the sum of impulses after some steps, SATURATED where the problem is singular.

    `push` is the impulse of a segment at full thrust and initial mass; `weights` holds those of
    another path, and with `g` the impulses w_i g_i afterwards. `bound` receives the impulses at
    full thrust.
    """
    total = SATURATED
    for step in range(steps):
        if not weighted_solve(rows, weights, d, N_NODES, p):
            return SATURATED
        duals(rows, p, N_NODES, g)
        total = 0.0
        for i in range(N_NODES):
            if step == 0:
                bound[i] = push * math.exp(min(total / exhaust_velocity, _MOST_BURNT))
            total += weights[i] * g[3 * STRIDE + i]
        if step < steps - 1:
            least = _LEAST_WEIGHT * total / N_NODES
            for i in range(N_NODES):
                dual = g[3 * STRIDE + i] + 1e-9
                weights[i] = max(min(weights[i] * dual * math.sqrt(dual), bound[i] / dual), least)
    return total


@kernel
def propellant_batch(
    rv_dep: _Array,
    rv_arr: _Array,
    tof_s: _Array,
    exhaust: _Array,
    push: _Array,
    beside: _Array,
    mu: float,
    out: _Array,
) -> None:
    """Write what the hint of the least propellant says of n legs.

    Parameters
    ----------
    rv_dep, rv_arr : (n, 6) float64, m and m/s
        End states.
    tof_s, exhaust : (n,) float64, s and m/s
        Flight times and exhaust velocities.
    push : (n,) float64, m/s
        Impulse of a segment at full thrust and initial mass.
    beside : (n,) float64
        Turns beside the nearest number, of the path that is followed.
    mu : float, m3/s2
        Gravitational parameter.
    out : (n, N_HINTS) float64
        Receives sums of impulses in m/s: of the first path, of the last three rounds, and a lower
        bound by the last dual; the share of segments at full thrust; the shares of five groups
        of segments in the sum. All 0 where there is no hint.
    """
    path, rows, p, weights, g, bound, d, anomaly = workspace()
    flown = np.empty(6 * STRIDE)
    s0, s1, x0, x1 = np.empty(6), np.empty(6), np.empty(6), np.empty(6)
    for leg in range(len(tof_s)):
        said = out[leg]
        said[:] = 0.0
        a = to_frame(rv_dep[leg], rv_arr[leg], mu, s0, s1)
        if not a > 0.0 or not to_elements(s0, x0) or not to_elements(s1, x1):
            continue
        speed = math.sqrt(mu / a)
        tof = tof_s[leg] / math.sqrt(a * a * a / mu)
        mean = 0.5 * tof * (x0[0] + x1[0])
        excess = wrapped(x1[5] - x0[5] - mean) + _TWO_PI * beside[leg]
        for j in range(5):
            d[j] = x1[j] - x0[j]
        d[5] = mean + excess - x0[0] * tof
        least = least_motion(0) if beside[leg] == 0.0 else least_motion(1)
        first_path(x0, x1, tof, excess, least, N_NODES, path)
        if not gauss_rows(path, tof, N_NODES, rows, anomaly):
            continue
        for i in range(N_NODES):
            weights[i] = 1.0
        ve, most = exhaust[leg] / speed, push[leg] / speed
        total = least_impulses(rows, d, ve, most, int(_FIRST_STEPS), p, weights, g, bound)
        if not total < SATURATED:
            continue
        for j in range(4):
            said[j] = total
        for _ in range(_ROUNDS):
            flown_path(x0, rows, weights, g, tof, N_NODES, flown)
            for i in range(6 * STRIDE):
                path[i] += _DAMPING * (flown[i] - path[i])
            if not gauss_rows(path, tof, N_NODES, rows, anomaly):
                break
            total = least_impulses(rows, d, ve, most, int(_NEXT_STEPS), p, weights, g, bound)
            if not total < SATURATED:
                break
            said[1], said[2], said[3] = said[2], said[3], total
        _write_shares(p, d, weights, g, bound, said)
        for j in range(N_SUMS):
            said[j] *= speed


@inner_kernel
def _write_shares(
    p: _Array, d: _Array, weights: _Array, g: _Array, bound: _Array, said: _Array
) -> None:
    """Write the dual's bound, the share of full thrust and the groups' shares in the sum."""
    value, largest, total, full = 0.0, 0.0, 0.0, 0.0
    for j in range(6):
        value += p[j] * d[j]
    for i in range(N_NODES):
        largest = max(largest, g[3 * STRIDE + i])
        impulse = weights[i] * g[3 * STRIDE + i]
        total += impulse
        full += 1.0 if impulse > _FULL * bound[i] else 0.0
        said[N_SUMS + 1 + i * N_GROUPS // N_NODES] += impulse
    said[N_SUMS - 1] = value / largest
    said[N_SUMS] = full / N_NODES
    for k in range(N_GROUPS):
        said[N_SUMS + 1 + k] /= total
