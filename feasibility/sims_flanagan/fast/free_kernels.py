"""Maximum initial mass of legs with free ends: excess velocities within bounds, for free.

A leg that a Kepler arc flies within the bounds needs no thrust at all and has no largest mass.
Of the others the excess velocities are two more impulses, and there are more starts than for a
rendezvous: paths between the bodies' own orbits, between those with the excess of the best Lambert
arc, cut to the bounds, and Lambert's arcs themselves.
"""

import math

import numpy as np
from numpy.typing import NDArray

from feasibility.orbits.kepler_kernels import propagate
from feasibility.orbits.lambert_kernels import lambert
from feasibility.runtime.jit import inner_kernel, kernel
from feasibility.sims_flanagan.fast.arc_kernels import clip_ends, close
from feasibility.sims_flanagan.fast.dual_kernels import z_of_impulses
from feasibility.sims_flanagan.fast.element_kernels import to_elements, wrap
from feasibility.sims_flanagan.fast.frame_kernels import scale_leg, write_throttles
from feasibility.sims_flanagan.fast.lifted_kernels import draw_path
from feasibility.sims_flanagan.fast.maximum_kernels import (
    bend,
    lay_hop,
    pursue,
    spent,
    turns_of,
)
from feasibility.sims_flanagan.fast.newton_kernels import polish
from feasibility.sims_flanagan.fast.workspace_kernels import (
    BEST,
    COAST,
    DV,
    E0,
    E1,
    FREE,
    INNER_0,
    INNER_1,
    LIMIT,
    LONGITUDE,
    N_STARTS,
    NODES,
    OPEN,
    START_LAM,
    STARTS,
    TURN_Z,
    WORK,
    Workspace,
    X,
    Z,
    lay_timeline,
    make_workspace,
)

MOST_REVS = 8
BRANCHES = 1 + 2 * MOST_REVS
"""Branches of Lambert's problem up to this number of revolutions, in one sense of rotation."""

BALLISTIC = 60
"""Start of a leg that needs no thrust."""

MODERATE = 0.7
"""Squared eccentricity below which an ellipse is moderate."""

_N_TURNS = 5
# Slots of paths: own ends, one that waits for nothing, cut ends, Lambert's arcs, and from 20 on
# along the departure orbit, from 23 on along the arrival orbit.
_SPARE = 5
_CUT = 6
_ARCS = 11
_OWN = 20
_FIRST_SWEEPS = 2
_GENTLE = 3
_SCREEN = 3.0
_LIKELY = 1.3
_RIVAL = 1.1
_SAME = 1e-3
_AGREEMENT = 5
_WINDING = 0.5
_HOPS = 8
# Impulses together, in exhaust velocities, beyond which starts hardly agree: short legs take bent
# paths too, and those that need much take more than the first few of them.
_DEEP = 1.0
_ROUGH = 0.7
_FEW = 16
_TURN = 2.0 * math.pi
_SHORT = math.pi
_MET = 1e-9
_TYPICAL = (1e-5, 0.02)
_FASTEST = 1.5
_IN_LINE = 1e-9
_NUDGE = 1e-7

_Array = NDArray[np.float64]


@inner_kernel
def largest_excess(x: _Array, bound: float) -> float:
    """Return the bound of the excess at a state, less where no ellipse could use it.

    `OPEN` is added where there is no bound.
    """
    radius = math.sqrt(x[0] ** 2 + x[1] ** 2 + x[2] ** 2)
    speed = math.sqrt(x[3] ** 2 + x[4] ** 2 + x[5] ** 2)
    most = speed + _FASTEST * math.sqrt(2.0 / radius)
    return most + OPEN if bound == np.inf else min(bound, most)


@inner_kernel
def lambert_arcs(
    x0: _Array, x1: _Array, tof: float, dep: float, arr: float, v: _Array, over: _Array
) -> int:
    """Write the velocities of Lambert's arcs at both ends and by how much they exceed the bounds.

    Parameters
    ----------
    x0, x1 : (6,) float64
        End states, in the frame of the departure orbit.
    tof, dep, arr : float
        Time of flight and bounds of the excess velocities.
    v : (2, 2, BRANCHES, 3) float64
        Receives the velocities: turning as the departure orbit does or the other way, at
        departure or arrival.
    over : (2, BRANCHES) float64
        Receives the sums of what both velocities exceed their bounds by; inf without an arc.

    Returns
    -------
    int
        Number of branches that were looked for, in each sense of rotation.
    """
    fastest = 0.0
    for x in (x0, x1):
        radius = math.sqrt(x[0] ** 2 + x[1] ** 2 + x[2] ** 2)
        energy = max(2.0 / radius - (x[3] ** 2 + x[4] ** 2 + x[5] ** 2), 0.0)
        fastest = max(fastest, energy * math.sqrt(energy))
    revs = min(int(tof * fastest / _TURN) + 1, int(MOST_REVS))
    branches = 1 + 2 * revs
    r0, r1 = np.empty(3), np.empty(3)
    for sense in range(2):
        # In the mirror an arc that turns the other way is an ordinary one.
        flip = -1.0 if sense == 1 else 1.0
        for j in range(3):
            r0[j] = x0[j]
            r1[j] = x1[j]
        cross = abs(r0[1] * r1[2] - r0[2] * r1[1]) + abs(r0[2] * r1[0] - r0[0] * r1[2])
        cross += abs(r0[0] * r1[1] - r0[1] * r1[0])
        if cross < _IN_LINE * abs(r0[0] * r1[0]):
            # Exactly in line the plane is free: that of the departure orbit.
            r1[1] += _NUDGE * r1[0]
        r0[1] *= flip
        r1[1] *= flip
        lambert(r0, r1, tof, revs, 1.0, v[sense, 0], v[sense, 1])
        for b in range(BRANCHES):
            over[sense, b] = np.inf
            if b >= branches or math.isnan(v[sense, 0, b, 0]):
                continue
            v[sense, 0, b, 1] *= flip
            v[sense, 1, b, 1] *= flip
            first = second = 0.0
            for j in range(3):
                first += (v[sense, 0, b, j] - x0[3 + j]) ** 2
                second += (x1[3 + j] - v[sense, 1, b, j]) ** 2
            over[sense, b] = max(math.sqrt(first) - dep, 0.0) + max(math.sqrt(second) - arr, 0.0)
    return branches


@inner_kernel
def cut_towards(own: _Array, wanted: _Array, bound: float, cut: _Array) -> None:
    """Write the velocity (3,) nearest to `wanted` within `bound` of that in the state `own`."""
    size = 0.0
    for j in range(3):
        size += (wanted[j] - own[3 + j]) ** 2
    size = math.sqrt(size)
    share = 1.0 if size <= bound else bound / size
    for j in range(3):
        cut[j] = own[3 + j] + share * (wanted[j] - own[3 + j])


@inner_kernel
def _ballistic(x0: _Array, x1: _Array, v: _Array, over: _Array) -> tuple[int, int]:
    """Return sense and branch of the gentlest arc within the bounds; -1, -1 if there is none."""
    best = np.inf
    at_sense = at_branch = -1
    for sense in range(2):
        for b in range(BRANCHES):
            if over[sense, b] < _MET:
                cost = 0.0
                for j in range(3):
                    cost += (v[sense, 0, b, j] - x0[3 + j]) ** 2
                    cost += (x1[3 + j] - v[sense, 1, b, j]) ** 2
                if cost < best:
                    best = cost
                    at_sense, at_branch = sense, b
    return at_sense, at_branch


@inner_kernel
def _lay(
    s: int,
    turns: int,
    x0: _Array,
    x1: _Array,
    v0: _Array,
    v1: _Array,
    shape: _Array,
    tof: float,
    n: int,
    w: Workspace,
) -> bool:
    """Draw path `s` between the end positions with the velocities `v0` and `v1` (3,).

    What these differ by from those of the bodies becomes the first excess. Returns whether there
    is a path.
    """
    e0, e1, x = w.v[INNER_0], w.v[INNER_1], w.v[X]
    w.p[Z, s] = np.inf
    w.p[LONGITUDE, s] = np.nan
    for end in range(2):
        for j in range(3):
            x[j] = x0[j] if end == 0 else x1[j]
            x[3 + j] = v0[j] if end == 0 else v1[j]
        e, own = (e0, w.v[E0]) if end == 0 else (e1, w.v[E1])
        if not to_elements(x, e):
            return False
        e[5] = own[5] + wrap(e[5] - own[5])
    longitude = draw_path(e0, e1, tof, turns, n, shape, w.n6[NODES + s], w.s[COAST])
    if math.isnan(longitude):
        return False
    w.p[LONGITUDE, s] = longitude + w.v[E1, 5] - e1[5]
    for j in range(6):
        w.v[START_LAM + s, j] = 0.0
    for i in range(n):
        for j in range(3):
            w.n3[STARTS + s, i, j] = 0.0
    if w.s[FREE, 0] > 0.0:
        for j in range(6):
            w.n6[NODES + s, 0, j] = w.v[E0, j]
        for j in range(3):
            w.n3[STARTS + s, 0, j] = v0[j] - x0[3 + j]
    if w.s[FREE, n - 1] > 0.0:
        for j in range(3):
            w.n3[STARTS + s, n - 1, j] = x1[3 + j] - v1[j]
    return True


@inner_kernel
def _coasted(x: _Array, tof: float, there: _Array, w: Workspace) -> None:
    """Write into w.v[WORK] the position `there` with the velocity that an orbit has at that time.

    The velocity keeps its parts along the radius and across it in the reference plane, as the
    orbit arrives at another place.
    """
    at, out = w.v[X], w.v[WORK]
    propagate(x, tof, 1.0, at)
    radial = (at[0] * at[3] + at[1] * at[4] + at[2] * at[5]) / math.sqrt(
        at[0] ** 2 + at[1] ** 2 + at[2] ** 2
    )
    across = (at[0] * at[4] - at[1] * at[3]) / math.sqrt(at[0] ** 2 + at[1] ** 2)
    radius = math.sqrt(there[0] ** 2 + there[1] ** 2 + there[2] ** 2)
    flat = math.sqrt(there[0] ** 2 + there[1] ** 2)
    for j in range(3):
        out[j] = there[j]
    out[3] = radial * there[0] / radius - across * there[1] / flat
    out[4] = radial * there[1] / radius + across * there[0] / flat
    out[5] = at[5]


@inner_kernel
def make_moderate(x: _Array, other: _Array, tof: float, w: Workspace) -> None:
    """Replace the velocity at an end where any is right, if it is not that of a moderate ellipse.

    By that of the other end's orbit, or else by that of a circle.
    """
    e = w.v[INNER_0]
    for attempt in range(3):
        if to_elements(x, e) and e[1] ** 2 + e[2] ** 2 < MODERATE:
            return
        if attempt == 0:
            _coasted(other, tof, x, w)
        else:
            radius = math.sqrt(x[0] ** 2 + x[1] ** 2 + x[2] ** 2)
            scale = 1.0 / math.sqrt(radius * (x[0] ** 2 + x[1] ** 2))
            w.v[WORK, 3] = -scale * x[1]
            w.v[WORK, 4] = scale * x[0]
            w.v[WORK, 5] = 0.0
        for j in range(3):
            x[3 + j] = w.v[WORK, 3 + j]


@inner_kernel
def _lay_starts(
    x0: _Array,
    x1: _Array,
    tof: float,
    c: float,
    n: int,
    n_forward: int,
    v: _Array,
    over: _Array,
    ends: _Array,
    turns: NDArray[np.int64],
    w: Workspace,
) -> None:
    """Lay all starts and bend them a little; write the velocities and turns they begin with."""
    straight = np.zeros((5, 3))
    no_sweeps = int(0)
    best_branch = int(0)
    for b in range(BRANCHES):
        if over[0, b] < over[0, best_branch]:
            best_branch = b
    known = over[0, best_branch] < np.inf
    for s in range(N_STARTS):
        w.p[Z, s] = np.inf
        turns[s] = 0
        if s < _N_TURNS or s >= _CUT:
            for j in range(3):
                ends[s, 0, j] = x0[3 + j]
                ends[s, 1, j] = x1[3 + j]
        if s < _N_TURNS:
            turns[s] = turns_of(s)
        elif s >= _OWN:
            # Close to an orbit after a turn or half a turn Lambert's arcs are of no use.
            turns[s] = turns_of((s - _OWN) % 3)
            end = int(1) if s < _OWN + 3 else int(0)
            at = n - 1 if end == 1 else int(0)
            if not w.s[FREE, at] > 0.0:
                continue
            _coasted(x0 if end == 1 else x1, tof if end == 1 else -tof, x1 if end == 1 else x0, w)
            cut_towards(x1 if end == 1 else x0, w.v[WORK, 3:], w.s[LIMIT, at], ends[s, end])
        elif s == _SPARE or not known:
            continue
        elif s < _ARCS:
            turns[s] = turns_of(s - _CUT)
            dep = w.s[LIMIT, 0] if w.s[FREE, 0] > 0.0 else 0.0
            arr = w.s[LIMIT, n - 1] if w.s[FREE, n - 1] > 0.0 else 0.0
            cut_towards(x0, v[0, 0, best_branch], dep, ends[s, 0])
            cut_towards(x1, v[0, 1, best_branch], arr, ends[s, 1])
        else:
            b = int(0)
            for other in range(BRANCHES):
                if over[0, other] < over[0, b]:
                    b = other
            if not over[0, b] < np.inf:
                continue
            over[0, b] = np.inf
            for j in range(3):
                ends[s, 0, j] = v[0, 0, b, j]
                ends[s, 1, j] = v[0, 1, b, j]
        if _lay(s, turns[s], x0, x1, ends[s, 0], ends[s, 1], straight, tof, n, w):
            bend(s, int(_FIRST_SWEEPS), no_sweeps, c, n, n_forward, np.inf, w)
    for s in range(N_STARTS):
        w.p[TURN_Z, s] = w.p[Z, s]


@inner_kernel
def _leading(w: Workspace) -> int:
    """Return the number of the waiting start of least z."""
    s = int(0)
    for other in range(1, N_STARTS):
        if w.p[Z, other] < w.p[Z, s]:
            s = other
    return s


@inner_kernel
def _likely(k: int, best: float, w: Workspace) -> int:
    """Return the k-th, cyclically, of the starts not far from `best`."""
    likely = 0
    for s in range(N_STARTS):
        if w.p[TURN_Z, s] < _LIKELY * best:
            likely += 1
    if likely == 0:
        return k % _N_TURNS
    k = k % likely
    for s in range(N_STARTS):
        if w.p[TURN_Z, s] < _LIKELY * best:
            if k == 0:
                return s
            k -= 1
    return 0


@inner_kernel
def _travel(w: Workspace) -> float:
    """Return the largest change of mean longitude among the best starts."""
    least = np.inf
    for s in range(N_STARTS):
        least = min(least, w.p[TURN_Z, s])
    longest = 0.0
    for s in range(N_STARTS):
        if w.p[TURN_Z, s] < _RIVAL * least:
            longest = max(longest, w.p[LONGITUDE, s] - w.v[E0, 5])
    return longest


@inner_kernel
def _best_free_arc(
    x0: _Array,
    x1: _Array,
    tof: float,
    c: float,
    n: int,
    n_forward: int,
    v: _Array,
    over: _Array,
    bent: _Array,
    shapes: _Array,
    w: Workspace,
) -> tuple[float, int, bool]:
    """Try one start after the other; leave the best arc in w.n3[BEST].

    Returns as `maximum_kernels._best_arc` does.
    """
    ends = np.zeros((N_STARTS, 2, 3))
    turns = np.zeros(N_STARTS, dtype=np.int64)
    _lay_starts(x0, x1, tof, c, n, n_forward, v, over, ends, turns, w)
    best = np.inf
    best_start = -1
    agreed = 0
    travel = _travel(w)
    long = travel > _SHORT
    lost = False
    needed = _AGREEMENT + int(_WINDING * max(travel - _TURN, 0.0))
    n_bent = bent.shape[0]
    n_hops = int(_HOPS)
    spare = int(_SPARE)
    for attempt in range(N_STARTS + n_bent + n_hops + shapes.shape[0]):
        k = attempt - N_STARTS
        hop = k - n_bent
        # Bent paths are for long legs, for those that burn most of their mass, and for those
        # that nothing else has closed; most of them for the latter two alone.
        if k == 0:
            lost = not best < np.inf
        burnt = spent(n, c, w) if best < np.inf else 0.0
        thorough = long or lost or burnt > _DEEP
        if hop < n_hops and (agreed >= needed or (k >= 0 and not thorough)):
            continue
        if _FEW <= k < n_bent and best < np.inf and burnt < _ROUGH:
            continue
        if k < 0:
            s = _leading(w)
            start = s
            if not w.p[Z, s] < _SCREEN * best:
                continue
        elif 0 <= hop < n_hops:
            s = spare
            start = N_STARTS + int(_FEW) + 1
            if not (best < np.inf and lay_hop(s, x0, bent[1 + hop], n, best, w)):
                continue
        else:
            s = spare
            start = N_STARTS + (k if k < _FEW else int(_FEW) + (2 if k < n_bent else 0))
            shape = bent[k] if hop < 0 else shapes[hop - n_hops]
            like = _likely(k, best, w)
            if _lay(s, turns[like], x0, x1, ends[like, 0], ends[like, 1], shape, tof, n, w):
                sweeps = int(_FIRST_SWEEPS + _GENTLE)
                bend(s, sweeps, int(_GENTLE), c, n, n_forward, best, w)
        z = pursue(s, x0, c, n, n_forward, best, thorough, w)
        if k < 0 and z < np.inf:
            w.p[TURN_Z, s] = z
        if z < best:
            agreed = agreed + 1 if z > (1.0 - _SAME) * best else 1
        elif z < (1.0 + _SAME) * best and not 0 <= hop < n_hops:
            agreed += 1
        if z < best:
            best = z
            best_start = start
            for i in range(n):
                for j in range(3):
                    w.n3[BEST, i, j] = w.n3[DV, i, j]
    return best, best_start, long and (agreed < needed or travel > _TURN)


@inner_kernel
def write_excess(e: _Array, sign: float, speed: float, frame: _Array, excess: _Array) -> None:
    """Write a scaled excess velocity (3,), times `sign`, in the outer frame and units."""
    for j in range(3):
        excess[j] = sign * speed * (frame[0, j] * e[0] + frame[1, j] * e[1] + frame[2, j] * e[2])


@kernel
def free_maximum_batch(
    rv0: _Array,
    rv1: _Array,
    tof_s: _Array,
    exhaust: _Array,
    vinf_dep: _Array,
    vinf_arr: _Array,
    n: int,
    mu: float,
    bent: _Array,
    shapes: _Array,
    throttles: _Array,
    z_out: _Array,
    winner: NDArray[np.int64],
    mass_ratio: _Array,
    excess: _Array,
) -> None:
    """Solve every leg of a batch as `maximum_batch` does, with its parameters, and with these.

    vinf_dep, vinf_arr : (legs,) float64
        Largest excess velocities, at least one of a leg above 0.
    z_out : (legs,) float64
        Receives T dt / (m0 c), 0 for a leg that needs no thrust.
    winner : (legs,) int64
        Receives the start that won: for 0 to 4 the number of turns between the bodies' orbits,
        for 6 to 10 between those of the cut Lambert arc, then Lambert's arcs, along the bodies'
        orbits, 16 bent paths, random ones, disturbed ones, further bent paths; `BALLISTIC`
        without thrust.
    excess : (legs, 2, 3) float64
        Receives the velocities relative to the bodies at departure and arrival.
    """
    w = make_workspace(n + 2)
    frame = np.empty((3, 3))
    x0 = np.empty(6)
    x1 = np.empty(6)
    v = np.empty((2, 2, BRANCHES, 3))
    over = np.empty((2, BRANCHES))
    body0 = np.empty(3)
    body1 = np.empty(3)
    for row in range(rv0.shape[0]):
        length, speed = scale_leg(rv0[row], rv1[row], mu, frame, x0, x1)
        tof = tof_s[row] * speed / length
        c = exhaust[row] / speed
        dep = largest_excess(x0, vinf_dep[row] / speed)
        arr = largest_excess(x1, vinf_arr[row] / speed)
        lambert_arcs(x0, x1, tof, vinf_dep[row] / speed, vinf_arr[row] / speed, v, over)
        sense, branch = _ballistic(x0, x1, v, over)
        if sense >= 0:
            for j in range(3):
                w.n3[DV, 0, j] = v[sense, 0, branch, j] - x0[3 + j]
                w.n3[DV, 1, j] = v[sense, 1, branch, j] - x1[3 + j]
            if vinf_dep[row] > 0.0:
                write_excess(w.n3[DV, 0], 1.0, speed, frame, excess[row, 0])
            if vinf_arr[row] > 0.0:
                write_excess(w.n3[DV, 1], 1.0, speed, frame, excess[row, 1])
            z_out[row] = 0.0
            winner[row] = BALLISTIC
            mass_ratio[row] = 1.0
            throttles[row, :, :] = 0.0
            continue
        for j in range(3):
            body0[j] = x0[3 + j]
            body1[j] = x1[3 + j]
        if vinf_arr[row] == np.inf:
            make_moderate(x1, x0, tof, w)
        if vinf_dep[row] == np.inf:
            make_moderate(x0, x1, -tof, w)
        if not to_elements(x0, w.v[E0]) or not to_elements(x1, w.v[E1]):
            continue
        least = np.inf
        for b in range(BRANCHES):
            least = min(least, over[0, b])
        low, high = _TYPICAL
        rows, forward = lay_timeline(tof, n, dep, arr, min(max(least / n, low), high), w)
        best, start, unsure = _best_free_arc(
            x0, x1, tof, c, rows, forward, v, over, bent, shapes[row], w
        )
        if not best < np.inf:
            continue
        arc = w.n3[BEST]
        if unsure:
            polish(x0, arc, rows, forward, c, w.v[E1], w)
        clip_ends(arc, rows, w)
        close(x0, arc, rows, w.v[E1], 1e-12, int(6), w)
        winner[row] = start
        z_out[row] = z_of_impulses(arc, rows, forward, c, w.s[FREE])
        first = int(0)
        if dep > 0.0:
            first = int(1)
            for j in range(3):
                body0[j] = x0[3 + j] + arc[0, j] - body0[j]
            write_excess(body0, 1.0, speed, frame, excess[row, 0])
        if arr > 0.0:
            for j in range(3):
                body1[j] = x1[3 + j] - arc[rows - 1, j] - body1[j]
            write_excess(body1, 1.0, speed, frame, excess[row, 1])
        for i in range(n):
            for j in range(3):
                w.n3[DV, i, j] = arc[first + i, j]
        mass_ratio[row] = write_throttles(w.n3[DV], z_out[row], c, n, frame, throttles[row])
