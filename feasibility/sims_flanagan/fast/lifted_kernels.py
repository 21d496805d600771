"""Paths drawn in element space, bent to arcs by lifted Newton steps."""

import math

import numpy as np
from numpy.typing import NDArray

from feasibility.runtime.jit import inner_kernel
from feasibility.sims_flanagan.fast.algebra_kernels import (
    cholesky,
    divide,
    multiply_lower_transposed,
    solve_lower,
    solve_lower_transposed,
)
from feasibility.sims_flanagan.fast.arc_kernels import clip_ends, coast_to, let_ends_grow
from feasibility.sims_flanagan.fast.dual_kernels import least_thrust, whiten, z_of_impulses
from feasibility.sims_flanagan.fast.element_kernels import (
    element_derivatives,
    from_elements,
    to_elements,
    wrap,
)
from feasibility.sims_flanagan.fast.workspace_kernels import (
    COAST,
    D_DV,
    D_MOVED,
    D_NODES,
    D_RESIDUAL,
    FREE,
    GAP,
    JUMPS,
    LINEAR,
    LOWER,
    M_ONE,
    M_TWO,
    MEMORY,
    MOVED,
    MOVED_BEFORE,
    PREVIOUS,
    RESIDUAL,
    TOTAL,
    WEIGHT,
    WORK,
    Workspace,
    X,
)

_TWO_PI = 2.0 * math.pi

_Array = NDArray[np.float64]


@inner_kernel
def draw_path(
    e0: _Array,
    e1: _Array,
    tof: float,
    turns: int,
    n: int,
    shape: _Array,
    nodes: _Array,
    coast: _Array,
) -> float:
    """Draw the elements before each impulse along a path with a number of turns.

    Linear in time, the mean motion with a parabola on top that makes the mean
    longitude arrive after the wanted number of turns. Returns the mean longitude
    at arrival, NaN where the path would need an absurd mean motion.

    `shape` (5, 3) adds sin(k pi t), k = 1, 2, 3 to each element but the longitude.
    `coast` are the times before each impulse; those of free ends act at the ends.
    """
    mean_motion = 0.5 * (e0[0] + e1[0])
    travel = mean_motion * tof + wrap(e1[5] - e0[5] - mean_motion * tof) + _TWO_PI * turns
    bump = travel / tof - mean_motion
    low = min(e0[0], e1[0])
    high = max(e0[0], e1[0])
    if turns != 0 and not mean_motion + 1.5 * bump > 0.2 * low:
        return np.nan
    first = 1 if coast[0] == 0.0 else 0
    segments = n - first - (1 if coast[n] == 0.0 else 0)
    for i in range(n):
        t = min(max((i - first + 0.5) / segments, 0.0), 1.0)
        for j in range(1, 5):
            nodes[i, j] = e0[j] + t * (e1[j] - e0[j])
        motion = e0[0] + t * (e1[0] - e0[0]) + 6.0 * bump * t * (1.0 - t)
        for k in range(3):
            wave = math.sin((k + 1) * math.pi * t)
            motion += e0[0] * shape[0, k] * wave
            for j in range(1, 5):
                nodes[i, j] += shape[j, k] * wave
        nodes[i, 0] = min(max(motion, 0.5 * low), 2.0 * high)
        nodes[i, 5] = e0[5] + tof * (
            e0[0] * t + 0.5 * (e1[0] - e0[0]) * t * t + bump * t * t * (3.0 - 2.0 * t)
        )
    return float(e0[5] + travel)


@inner_kernel
def draw_arc(
    x0: _Array,
    dv: _Array,
    e0: _Array,
    e1: _Array,
    coast: _Array,
    n: int,
    nodes: _Array,
    x: _Array,
) -> float:
    """Write the elements before each impulse of an arc; return its mean longitude at arrival.

    NaN where the arc leaves the ellipses.
    """
    longitude = e0[5] + coast[0] * e0[0]
    coast_to(x0, coast[0], x)
    for i in range(n):
        if not to_elements(x, nodes[i]):
            return np.nan
        nodes[i, 5] = longitude + wrap(nodes[i, 5] - longitude)
        span = coast[i + 1] if i < n - 1 else 2.0 * coast[n]
        longitude = nodes[i, 5] + span * nodes[i, 0]
        for j in range(3):
            x[3 + j] += dv[i, j]
        coast_to(x, span, x)
    longitude -= coast[n] * nodes[n - 1, 0]
    return float(longitude - wrap(longitude - e1[5]))


@inner_kernel
def _linearise_nodes(nodes: _Array, dv: _Array, n: int, first: bool, w: Workspace) -> bool:
    """Write the jump of each node in elements, and its derivatives by impulse and node.

    They go to w.n6[JUMPS], w.b[1] and the first n matrices of w.m. Returns False where an
    orbit is no ellipse.
    """
    jumps, response, x = w.n6[JUMPS], w.b[1], w.v[X]
    one, two = w.m[M_ONE], w.m[M_TWO]
    for i in range(n):
        from_elements(nodes[i], x)
        # Paths begin without impulses, but for those of free ends.
        bare = first and w.s[FREE, i] == 0.0
        if not bare:
            if not element_derivatives(x, int(0), one, w.v):
                return False
            for j in range(3):
                x[3 + j] += dv[i, j]
        if not to_elements(x, jumps[i]):
            return False
        for j in range(6):
            jumps[i, j] -= nodes[i, j]
        jumps[i, 5] = wrap(jumps[i, 5])
        if bare:
            if not element_derivatives(x, int(3), two, w.v):
                return False
            for j in range(6):
                for k in range(3):
                    response[i, j, k] = two[j, k]
                for k in range(6):
                    w.m[i, j, k] = 1.0 if j == k else 0.0
        else:
            if not element_derivatives(x, int(0), two, w.v):
                return False
            for j in range(6):
                for k in range(3):
                    response[i, j, k] = two[j, 3 + k]
            if not divide(two, one, w.m[i]):
                return False
    return True


@inner_kernel
def _condense(
    e0: _Array, e1: _Array, longitude: float, n: int, nodes: _Array, w: Workspace
) -> None:
    """Write how the end moves with each impulse, w.b[0], and by how much it is missed, w.v[GAP].

    Also by how much the flow from the node before misses each node: w.n6[MOVED].
    """
    jumps, moved = w.n6[JUMPS], w.n6[MOVED]
    b, response, coast = w.b[0], w.b[1], w.s[COAST]
    one, two, gap = w.m[M_ONE], w.m[M_TWO], w.v[GAP]
    # Last node first: m = d(end)/d(elements after impulse i).
    for j in range(6):
        gap[j] = e1[j] - nodes[n - 1, j] - jumps[n - 1, j]
        for k in range(6):
            one[j, k] = 1.0 if j == k else 0.0
    gap[5] = longitude - nodes[n - 1, 5] - jumps[n - 1, 5]
    one[5, 0] = coast[n]
    gap[5] -= coast[n] * (nodes[n - 1, 0] + jumps[n - 1, 0])
    for i in range(n - 1, -1, -1):
        for j in range(6):
            for k in range(3):
                value = 0.0
                for q in range(6):
                    value += one[j, q] * response[i, q, k]
                b[i, j, k] = value
        for j in range(6):
            for k in range(6):
                value = 0.0
                for q in range(6):
                    value += one[j, q] * w.m[i, q, k]
                two[j, k] = value
        span = coast[i]
        for j in range(6):
            before = nodes[i - 1, j] + jumps[i - 1, j] if i > 0 else e0[j]
            moved[i, j] = before - nodes[i, j]
        motion = nodes[i - 1, 0] + jumps[i - 1, 0] if i > 0 else e0[0]
        moved[i, 5] += motion * span
        for j in range(6):
            for k in range(6):
                one[j, k] = two[j, k]
                gap[j] -= one[j, k] * moved[i, k]
            one[j, 0] += one[j, 5] * span


@inner_kernel
def lifted_sweep(
    e0: _Array,
    e1: _Array,
    longitude: float,
    n: int,
    n_forward: int,
    c: float,
    first: bool,
    gentle: bool,
    nodes: _Array,
    dv: _Array,
    z: float,
    lam: _Array,
    w: Workspace,
) -> tuple[float, float]:
    """Bend a path of nodes and its impulses towards a true arc of least thrust.

    One lifted Newton step: every node is an unknown of its own, condensed to the
    impulses; in elements the coasts between nodes are exactly linear. Returns the
    new z, -1 where the step fails, and the relative change of the impulses; leaves the
    full step in w.n3[RESIDUAL] and w.n6[MOVED], for `advance` to take.
    """
    b, response, moved = w.b[0], w.b[1], w.n6[MOVED]
    linear, residual = w.n3[LINEAR], w.n3[RESIDUAL]
    gap, total, work = w.v[GAP], w.v[TOTAL], w.v[WORK]
    if not _linearise_nodes(nodes, dv, n, first, w):
        return -1.0, np.inf
    _condense(e0, e1, longitude, n, nodes, w)
    for j in range(6):
        total[j] = gap[j]
        for i in range(n):
            for k in range(3):
                total[j] += b[i, j, k] * dv[i, k]
    let_ends_grow(n, w)
    if not whiten(b, n, w.m[M_ONE], w.m[LOWER], w):
        return -1.0, np.inf
    solve_lower(w.m[LOWER], total)
    if gentle:
        for i in range(n):
            for k in range(3):
                linear[i, k] = 0.0
                for j in range(6):
                    linear[i, k] += b[i, j, k] * total[j]
            if w.s[FREE, i] > 0.0:
                for k in range(3):
                    linear[i, k] *= w.s[WEIGHT, i]
        clip_ends(linear, n, w)
        z = z_of_impulses(linear, n, n_forward, c, w.s[FREE])
    else:
        multiply_lower_transposed(w.m[LOWER], lam)
        z = least_thrust(b, total, n, n_forward, c, lam, z, dv, linear, w)
        solve_lower_transposed(w.m[LOWER], lam)
    if not z > 0.0:
        return -1.0, np.inf
    # How the nodes move with the impulses.
    for j in range(6):
        work[j] = moved[0, j]
    change = 0.0
    size = 0.0
    for i in range(n):
        for j in range(6):
            moved_next = moved[i, j] if i == 0 else work[j] + moved[i, j]
            moved[i, j] = moved_next
        for j in range(6):
            value = 0.0
            for k in range(6):
                value += w.m[i, j, k] * moved[i, k]
            for k in range(3):
                value += response[i, j, k] * (linear[i, k] - dv[i, k])
            work[j] = value
        work[5] += work[0] * w.s[COAST, i + 1]
        for k in range(3):
            residual[i, k] = linear[i, k] - dv[i, k]
            change += abs(residual[i, k])
            size += abs(linear[i, k])
    return z, change / size


@inner_kernel
def advance(nodes: _Array, dv: _Array, n: int, relax: float, count: int, w: Workspace) -> int:
    """Move nodes and impulses by Anderson's rule; return the number of steps remembered.

    A plain lifted step overshoots, and with it oscillates, where the dynamics bend
    more than the thrust bound does. Anderson 1965 ("Iterative procedures for
    nonlinear integral equations") combines the last few steps, here up to six, so
    that the predicted change of the impulses is least. `count` is the number of
    steps remembered so far; 0 takes a plain step. Where an orbit would open, the
    memory is dropped and the plain step halved.
    """
    moved, residual, previous = w.n6[MOVED], w.n3[RESIDUAL], w.n3[PREVIOUS]
    gram, lower, gamma = w.m[M_ONE], w.m[M_TWO], w.v[WORK]
    if count > 0:
        slot = (count - 1) % MEMORY
        for i in range(n):
            for k in range(3):
                w.n3[D_RESIDUAL + slot, i, k] = residual[i, k] - previous[i, k]
            for k in range(6):
                w.n6[D_MOVED + slot, i, k] = moved[i, k] - w.n6[MOVED_BEFORE, i, k]
    used = min(count, MEMORY)
    for a in range(6):
        gamma[a] = 0.0
        for b in range(6):
            gram[a, b] = 1.0 if a == b else 0.0
    trace = 0.0
    for a in range(used):
        for b in range(a + 1):
            total = 0.0
            for i in range(n):
                for k in range(3):
                    total += w.n3[D_RESIDUAL + a, i, k] * w.n3[D_RESIDUAL + b, i, k]
            gram[a, b] = total
        trace += gram[a, a]
        for i in range(n):
            for k in range(3):
                gamma[a] += w.n3[D_RESIDUAL + a, i, k] * residual[i, k]
    for a in range(used):
        gram[a, a] += 1e-8 * trace
    if cholesky(gram, lower):
        solve_lower(lower, gamma)
        solve_lower_transposed(lower, gamma)
    else:
        used = 0
    for i in range(n):
        for k in range(3):
            previous[i, k] = residual[i, k]
            step = relax * residual[i, k]
            for a in range(used):
                step -= gamma[a] * (w.n3[D_DV + a, i, k] + relax * w.n3[D_RESIDUAL + a, i, k])
            residual[i, k] = step
        for k in range(6):
            w.n6[MOVED_BEFORE, i, k] = moved[i, k]
            step = relax * moved[i, k]
            for a in range(used):
                step -= gamma[a] * (w.n6[D_NODES + a, i, k] + relax * w.n6[D_MOVED + a, i, k])
            moved[i, k] = step
    if not inside(nodes, moved, 1.0, n):
        count = 0
        for i in range(n):
            for k in range(3):
                residual[i, k] = previous[i, k]
            for k in range(6):
                moved[i, k] = w.n6[MOVED_BEFORE, i, k]
    fraction = 1.0
    for _ in range(8):
        if inside(nodes, moved, fraction, n):
            break
        fraction *= 0.5
    else:
        return -1
    slot = count % MEMORY
    for i in range(n):
        for k in range(3):
            step = fraction * residual[i, k]
            w.n3[D_DV + slot, i, k] = step
            dv[i, k] += step
        for k in range(6):
            step = fraction * moved[i, k]
            w.n6[D_NODES + slot, i, k] = step
            nodes[i, k] += step
    return count + 1


@inner_kernel
def inside(nodes: _Array, moved: _Array, fraction: float, n: int) -> bool:
    """Tell whether the moved nodes are moderate ellipses."""
    for i in range(n):
        ex = nodes[i, 1] + fraction * moved[i, 1]
        ey = nodes[i, 2] + fraction * moved[i, 2]
        motion = nodes[i, 0] + fraction * moved[i, 0]
        if not (ex * ex + ey * ey < 0.9 and 0.05 < motion < 20.0):
            return False
    return True
