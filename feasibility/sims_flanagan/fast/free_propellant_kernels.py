"""Minimum propellant of legs with free ends."""

import numpy as np
from numpy.typing import NDArray

from feasibility.runtime.jit import inner_kernel, kernel
from feasibility.sims_flanagan.fast.arc_kernels import close
from feasibility.sims_flanagan.fast.element_kernels import to_elements
from feasibility.sims_flanagan.fast.frame_kernels import (
    read_throttles,
    scale_leg,
    write_throttles,
)
from feasibility.sims_flanagan.fast.free_kernels import (
    BRANCHES,
    MODERATE,
    cut_towards,
    lambert_arcs,
    largest_excess,
    make_moderate,
    write_excess,
)
from feasibility.sims_flanagan.fast.propellant_kernels import minimise_one
from feasibility.sims_flanagan.fast.restart_kernels import spread_impulse
from feasibility.sims_flanagan.fast.workspace_kernels import (
    DV,
    E1,
    FREE,
    INNER_0,
    LIMIT,
    STARTS,
    WORK,
    Workspace,
    lay_timeline,
    make_workspace,
)

_DEARER = 1.2
_MOST_STARTS = 4

_Array = NDArray[np.float64]


@inner_kernel
def _put(
    arc: _Array,
    first: int,
    n: int,
    z: float,
    c: float,
    speed: float,
    rows: int,
    frame: _Array,
    throttles: _Array,
    excess: _Array,
    leads: _Array,
    w: Workspace,
) -> float:
    """Write throttles and excess velocities of an arc in the outer frame; return m_final / m0.

    Its excess velocities are those beyond `leads` (2, 3).
    """
    for end in range(2):
        for j in range(3):
            excess[end, j] = 0.0
    total = w.v[WORK]
    if first > 0:
        for j in range(3):
            total[j] = arc[0, j] + leads[0, j]
        write_excess(total, 1.0, speed, frame, excess[0])
    if w.s[FREE, rows - 1] > 0.0:
        for j in range(3):
            total[j] = leads[1, j] - arc[rows - 1, j]
        write_excess(total, 1.0, speed, frame, excess[1])
    segments = w.n3[STARTS]
    for i in range(n):
        for j in range(3):
            segments[i, j] = arc[first + i, j]
    return write_throttles(segments, z, c, n, frame, throttles)


@inner_kernel
def _lay_arc(
    x0: _Array,
    x1: _Array,
    v0: _Array,
    v1: _Array,
    cap: float,
    first: int,
    n: int,
    rows: int,
    arc: _Array,
    w: Workspace,
) -> None:
    """Write the impulses of a Lambert arc: excess up to its bounds, thrust for the rest."""
    rest, cut = np.empty(3), np.empty(3)
    segments = w.n3[STARTS]
    for i in range(rows):
        for j in range(3):
            segments[i, j] = 0.0
            arc[i, j] = 0.0
    cut_towards(x0, v0, w.s[LIMIT, 0] if first > 0 else 0.0, cut)
    for j in range(3):
        rest[j] = v0[j] - cut[j]
        if first > 0:
            arc[0, j] = cut[j] - x0[3 + j]
    spread_impulse(rest, int(0), cap, n, segments)
    last = w.s[LIMIT, rows - 1] if w.s[FREE, rows - 1] > 0.0 else 0.0
    cut_towards(x1, v1, last, cut)
    for j in range(3):
        rest[j] = cut[j] - v1[j]
        if w.s[FREE, rows - 1] > 0.0:
            arc[rows - 1, j] = x1[3 + j] - cut[j]
    spread_impulse(rest, n - 1, cap, n, segments)
    for i in range(n):
        for j in range(3):
            arc[first + i, j] = segments[i, j]


@inner_kernel
def _take_lead(
    dep: bool, arr: bool, excess: _Array, speed: float, frame: _Array, leads: _Array
) -> None:
    """Write the scaled excess velocities (2, 3) of open ends, zero of others.

    Where any velocity is right, that of the start is as good as the body's, if it is that of a
    moderate ellipse (`_follow`).
    """
    for j in range(3):
        leads[0, j] = leads[1, j] = 0.0
        for k in range(3):
            if dep:
                leads[0, j] += frame[j, k] * excess[0, k] / speed
            if arr:
                leads[1, j] += frame[j, k] * excess[1, k] / speed


@inner_kernel
def _follow(x: _Array, other: _Array, tof: float, lead: _Array, w: Workspace) -> None:
    """Add the lead to the velocity of an end; replace both where that leaves no moderate ellipse.

    Elements are of ellipses alone, and a light spacecraft may well pass its target on a hyperbola:
    the rest of its velocity is then an excess beyond that of the ellipse.

    Parameters
    ----------
    x : (6,) float64
        State of the body at the open end; receives the state with the lead.
    other : (6,) float64
        State at the other end.
    tof : float
        Time from there to here, negative for a departure.
    lead : (3,) float64
        Excess velocity of the start; receives by how much `x` has changed.
    w : Workspace
        Scratch.
    """
    own = np.empty(3)
    e = w.v[INNER_0]
    for j in range(3):
        own[j] = x[3 + j]
        x[3 + j] += lead[j]
    if to_elements(x, e) and e[1] ** 2 + e[2] ** 2 < MODERATE:
        return
    for j in range(3):
        x[3 + j] = own[j]
    make_moderate(x, other, tof, w)
    for j in range(3):
        lead[j] = x[3 + j] - own[j]


@inner_kernel
def _load(
    first: int,
    n: int,
    rows: int,
    speed: float,
    frame: _Array,
    excess: _Array,
    leads: _Array,
    dv: _Array,
    w: Workspace,
) -> None:
    """Write the impulses of a start: those in w.n3[STARTS], and its excess beyond `leads`."""
    for i in range(n):
        for j in range(3):
            dv[first + i, j] = w.n3[STARTS, i, j]
    for j in range(3):
        if first > 0:
            dv[0, j] = -leads[0, j]
            for k in range(3):
                dv[0, j] += frame[j, k] * excess[0, k] / speed
        if w.s[FREE, rows - 1] > 0.0:
            dv[rows - 1, j] = leads[1, j]
            for k in range(3):
                dv[rows - 1, j] -= frame[j, k] * excess[1, k] / speed


@kernel
def free_minimum_batch(
    rv0: _Array,
    rv1: _Array,
    tof_s: _Array,
    exhaust: _Array,
    vinf_dep: _Array,
    vinf_arr: _Array,
    z: _Array,
    light: NDArray[np.bool_],
    n: int,
    mu: float,
    throttles: _Array,
    mass_ratio: _Array,
    excess: _Array,
    winner: NDArray[np.int64],
) -> None:
    """Lower the propellant of a batch as `minimum_batch` does, with its parameters and these.

    vinf_dep, vinf_arr : (legs,) float64
        Largest excess velocities.
    light : (legs,) bool
        Where Lambert's arcs are tried as well.
    excess : (legs, 2, 3) float64
        Holds the excess velocities of the start; receives those of the solution.
    winner : (legs,) int64
        Receives the number of the Lambert arc, 0 the cheapest, where one won.
    """
    w = make_workspace(n + 2)
    frame = np.empty((3, 3))
    x0 = np.empty(6)
    x1 = np.empty(6)
    v = np.empty((2, 2, BRANCHES, 3))
    over = np.empty((2, BRANCHES))
    target, dv = w.v[E1], w.n3[DV]
    leads = np.empty((2, 3))
    for row in range(rv0.shape[0]):
        if not throttles[row].any():
            # No thrust is needed, and none can be less.
            mass_ratio[row] = 1.0
            continue
        length, speed = scale_leg(rv0[row], rv1[row], mu, frame, x0, x1)
        _take_lead(
            vinf_dep[row] == np.inf, vinf_arr[row] == np.inf, excess[row], speed, frame, leads
        )
        c = exhaust[row] / speed
        tof = tof_s[row] * speed / length
        if vinf_arr[row] == np.inf:
            _follow(x1, x0, tof, leads[1], w)
        if vinf_dep[row] == np.inf:
            _follow(x0, x1, -tof, leads[0], w)
        if not to_elements(x1, target):
            continue
        dep = largest_excess(x0, vinf_dep[row] / speed)
        arr = largest_excess(x1, vinf_arr[row] / speed)
        rows, forward = lay_timeline(tof, n, dep, arr, c * z[row], w)
        first = 1 if dep > 0.0 else 0
        read_throttles(throttles[row], z[row], c, n, frame, w.n3[STARTS])
        _load(first, n, rows, speed, frame, excess[row], leads, dv, w)
        best = minimise_one(x0, target, c, z[row], rows, forward, dv, w)
        if best < np.inf:
            mass_ratio[row] = _put(
                dv, first, n, z[row], c, speed, rows, frame, throttles[row], excess[row], leads, w
            )
        if not light[row]:
            continue
        lambert_arcs(x0, x1, tof, dep, arr, v, over)
        for s in range(_MOST_STARTS):
            b = int(0)
            for other in range(BRANCHES):
                if over[0, other] < over[0, b]:
                    b = other
            if not over[0, b] < _DEARER * best:
                break
            over[0, b] = np.inf
            _lay_arc(x0, x1, v[0, 0, b], v[0, 1, b], c * z[row], first, n, rows, dv, w)
            if not close(x0, dv, rows, target, 1e-9, int(12), w):
                continue
            total = minimise_one(x0, target, c, z[row], rows, forward, dv, w)
            if total < best:
                best = total
                winner[row] = s
                mass_ratio[row] = _put(
                    dv,
                    first,
                    n,
                    z[row],
                    c,
                    speed,
                    rows,
                    frame,
                    throttles[row],
                    excess[row],
                    leads,
                    w,
                )
