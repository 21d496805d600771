"""Maximum initial mass: which starts, in which order, for one leg and for a batch."""

import math

import numpy as np
from numpy.typing import NDArray

from feasibility.runtime.jit import inner_kernel, kernel
from feasibility.sims_flanagan.fast.arc_kernels import clip_ends, close, improve
from feasibility.sims_flanagan.fast.dual_kernels import z_of_impulses
from feasibility.sims_flanagan.fast.element_kernels import to_elements
from feasibility.sims_flanagan.fast.frame_kernels import scale_leg, write_throttles
from feasibility.sims_flanagan.fast.lifted_kernels import (
    advance,
    draw_arc,
    draw_path,
    lifted_sweep,
)
from feasibility.sims_flanagan.fast.newton_kernels import polish
from feasibility.sims_flanagan.fast.workspace_kernels import (
    BEST,
    COAST,
    DV,
    E0,
    E1,
    FREE,
    LONGITUDE,
    NODES,
    START_LAM,
    STARTS,
    TURN_Z,
    Workspace,
    X,
    Z,
    lay_timeline,
    make_workspace,
)

_N_TURNS = 5
_FIRST_SWEEPS = 2
_SWEEPS = 20
_SCREEN = 3.0
_RELAX = 0.5
_GENTLE = 3
_SHORT = math.pi
_AGREEMENT = 5
_TURN = 2.0 * math.pi
_WINDING = 0.5
_SAME = 1e-3
_STILL = 3e-3
_LOST = 1.25
_HOPELESS = 1.03
_LIKELY = 1.3
_RIVAL = 1.1
_HOPS = 8
_HOP = 7.5
# Impulses together, in exhaust velocities, beyond which not even short legs' starts agree.
_DEEP = 2.0

_Array = NDArray[np.float64]


@inner_kernel
def turns_of(s: int) -> int:
    """Return the number of whole turns of start `s`: 0, 1, -1, 2, -2 beside the nearest."""
    return (s + 1) // 2 * (1 if s % 2 else -1)


@inner_kernel
def likely_turn(k: int, best: float, w: Workspace) -> int:
    """Return the start number of the k-th, cyclically, of the turns not far from `best`."""
    likely = 0
    for s in range(_N_TURNS):
        if w.p[TURN_Z, s] < _LIKELY * best:
            likely += 1
    if likely == 0:
        return k % _N_TURNS
    k = k % likely
    for s in range(_N_TURNS):
        if w.p[TURN_Z, s] < _LIKELY * best:
            if k == 0:
                return s
            k -= 1
    return 0


@inner_kernel
def leading_turn(w: Workspace) -> int:
    """Return the start number of the waiting turn of least z."""
    s = int(0)
    for other in range(1, _N_TURNS):
        if w.p[Z, other] < w.p[Z, s]:
            s = other
    return s


@inner_kernel
def longest_travel(w: Workspace) -> float:
    """Return the largest change of mean longitude among the likely numbers of turns."""
    least = np.inf
    for s in range(_N_TURNS):
        least = min(least, w.p[TURN_Z, s])
    longest = 0.0
    for s in range(_N_TURNS):
        if w.p[TURN_Z, s] < _RIVAL * least:
            longest = max(longest, w.p[LONGITUDE, s] - w.v[E0, 5])
    return longest


@inner_kernel
def lay_path(s: int, turns: int, shape: _Array, tof: float, n: int, w: Workspace) -> bool:
    """Draw path `s`, without impulses yet; return whether there is one."""
    w.p[Z, s] = np.inf
    w.p[LONGITUDE, s] = draw_path(
        w.v[E0], w.v[E1], tof, turns, n, shape, w.n6[NODES + s], w.s[COAST]
    )
    for i in range(6):
        w.v[START_LAM + s, i] = 0.0
    for i in range(n):
        for j in range(3):
            w.n3[STARTS + s, i, j] = 0.0
    return not math.isnan(w.p[LONGITUDE, s])


@inner_kernel
def bend(
    s: int,
    sweeps: int,
    gentle: int,
    c: float,
    n: int,
    n_forward: int,
    best: float,
    w: Workspace,
) -> bool:
    """Take up to `sweeps` lifted steps on path `s`; return False where it lags behind `best`.

    A path without impulses takes plain steps, the first `gentle` of them to the least sum
    of squares instead of the least thrust, which often leads to another optimum; its z goes
    to w.p[Z, s]. A path under way follows Anderson's rule until it stands still.
    """
    nodes, start, lam = w.n6[NODES + s], w.n3[STARTS + s], w.v[START_LAM + s]
    fresh = not w.p[Z, s] < np.inf
    z = -1.0 if fresh else w.p[Z, s]
    relax = 1.0 if fresh else _RELAX
    count = int(0)
    for sweep in range(sweeps):
        z, move = lifted_sweep(
            w.v[E0],
            w.v[E1],
            w.p[LONGITUDE, s],
            n,
            n_forward,
            c,
            fresh and sweep == 0,
            fresh and sweep < gentle,
            nodes,
            start,
            z,
            lam,
            w,
        )
        if not z > 0.0:
            break
        if not fresh:
            if move < _STILL:
                break
            if sweep >= 3 and z > _LOST * best:
                return False
        if fresh:
            count = int(0)
        count = advance(nodes, start, n, relax, count, w)
        if count < 0:
            break
        if fresh:
            w.p[Z, s] = z
    return True


@inner_kernel
def lay_hop(s: int, x0: _Array, wave: _Array, n: int, best: float, w: Workspace) -> bool:
    """Lay path `s` along the arc in w.n3[BEST], its impulses turned by waves; return whether."""
    w.p[LONGITUDE, s] = draw_arc(
        x0, w.n3[BEST], w.v[E0], w.v[E1], w.s[COAST], n, w.n6[NODES + s], w.v[X]
    )
    if math.isnan(w.p[LONGITUDE, s]):
        return False
    w.p[Z, s] = best
    for i in range(n):
        t = (i + 0.5) / n
        size = 0.0
        new_size = 0.0
        for j in range(3):
            size += w.n3[BEST, i, j] ** 2
        size = math.sqrt(size)
        if w.s[FREE, i] > 0.0:
            for j in range(3):
                w.n3[STARTS + s, i, j] = w.n3[BEST, i, j]
            continue
        for j in range(3):
            turned = w.n3[BEST, i, j] / size
            for k in range(3):
                turned += _HOP * wave[j, k] * math.cos(k * math.pi * t)
            w.n3[STARTS + s, i, j] = turned
            new_size += turned * turned
        for j in range(3):
            w.n3[STARTS + s, i, j] *= size / math.sqrt(new_size)
    for i in range(6):
        w.v[START_LAM + s, i] = 0.0
    return True


@inner_kernel
def pursue(
    s: int,
    x0: _Array,
    c: float,
    n: int,
    n_forward: int,
    best: float,
    thorough: bool,
    w: Workspace,
) -> float:
    """Make path `s` an arc and improve it; leave it in w.n3[DV], return its z or inf.

    With `thorough` the second-order finish follows if the arc is neither the best so far
    nor far behind it.
    """
    dv, target = w.n3[DV], w.v[E1]
    z = np.inf
    if w.p[Z, s] < np.inf and bend(s, int(_SWEEPS), int(0), c, n, n_forward, best, w):
        for i in range(n):
            for j in range(3):
                dv[i, j] = w.n3[STARTS + s, i, j]
        clip_ends(dv, n, w)
        if close(x0, dv, n, target, 1e-9, int(12), w):
            lam = w.v[START_LAM + s]
            z = improve(x0, dv, n, n_forward, c, target, 30, 1e-4, _HOPELESS * best, lam, w)
            if thorough and z < _HOPELESS * best and abs(z - best) > _SAME * best:
                z = polish(x0, dv, n, n_forward, c, target, w)
    w.p[Z, s] = np.inf
    return z


@inner_kernel
def spent(n: int, c: float, w: Workspace) -> float:
    """Return the sum of the impulses of the arc in w.n3[BEST], without excesses, over `c`."""
    total = 0.0
    for i in range(n):
        if not w.s[FREE, i] > 0.0:
            size = 0.0
            for j in range(3):
                size += w.n3[BEST, i, j] ** 2
            total += math.sqrt(size)
    return total / c


@inner_kernel
def _best_arc(
    x0: _Array, tof: float, c: float, n: int, bent: _Array, shapes: _Array, w: Workspace
) -> tuple[float, int, bool]:
    """Try one start after the other; leave the best arc in w.n3[BEST].

    Returns its z, inf if there is none, the start that led to it, -1 if none, and whether it
    is worth the second-order finish: where starts disagree, or the way is long.
    """
    straight = np.zeros((5, 3))
    # Literal integers would make numba compile a kernel once for each value.
    no_sweeps = int(0)
    last = int(_N_TURNS)
    first_and_gentle = int(_FIRST_SWEEPS + _GENTLE)
    best = np.inf
    best_start = -1
    agreed = 0
    for s in range(_N_TURNS):
        if lay_path(s, turns_of(s), straight, tof, n, w):
            bend(s, int(_FIRST_SWEEPS), no_sweeps, c, n, n // 2, best, w)
        w.p[TURN_Z, s] = w.p[Z, s]
    travel = longest_travel(w)
    # On short legs all starts agree, unless none closes or they burn nearly everything.
    long = travel > _SHORT
    lost = False
    # With every further turn there are more optima, and agreement says less.
    needed = _AGREEMENT + int(_WINDING * max(travel - _TURN, 0.0))
    n_bent = bent.shape[0]
    n_hops = int(_HOPS)
    for attempt in range(_N_TURNS + n_bent + n_hops + shapes.shape[0]):
        k = attempt - _N_TURNS
        hop = k - n_bent
        start = min(attempt, _N_TURNS + n_bent)
        if k == 0:
            lost = not best < np.inf
        thorough = long or lost or (best < np.inf and spent(n, c, w) > _DEEP)
        if k >= 0 and hop < n_hops and (agreed >= needed or not thorough):
            continue
        if k < 0:
            s = leading_turn(w)
            start = s
            if not w.p[Z, s] < _SCREEN * best:
                continue
        elif 0 <= hop < n_hops:
            s = last
            start = _N_TURNS + bent.shape[0] + 1
            if not (best < np.inf and lay_hop(s, x0, bent[1 + hop], n, best, w)):
                continue
        else:
            s = last
            if hop >= 0:
                start = _N_TURNS + bent.shape[0]
            shape = bent[k] if hop < 0 else shapes[hop - n_hops]
            if lay_path(s, turns_of(likely_turn(k, best, w)), shape, tof, n, w):
                bend(s, first_and_gentle, int(_GENTLE), c, n, n // 2, best, w)
        z = pursue(s, x0, c, n, n // 2, best, thorough, w)
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


@kernel
def maximum_batch(
    rv0: _Array,
    rv1: _Array,
    tof_s: _Array,
    exhaust: _Array,
    n: int,
    mu: float,
    bent: _Array,
    shapes: _Array,
    throttles: _Array,
    z_out: _Array,
    winner: NDArray[np.int64],
    mass_ratio: _Array,
) -> None:
    """Solve every leg of a batch, SI units; rows without a solution keep z = inf, winner = -1.

    Parameters
    ----------
    rv0, rv1 : (legs, 6) float64
        End states.
    tof_s, exhaust : (legs,) float64
        Flight times and exhaust velocities.
    n : int
        Segments.
    mu : float
        Gravitational parameter.
    bent : (b, 5, 3) float64
        Path shapes to be tried besides the plain paths unless the leg is short, until enough
        starts have led to the best z.
    shapes : (legs, k, 5, 3) float64
        Path shapes to be tried on every leg.
    throttles : (legs, n, 3) float64
        Receives the throttles.
    z_out : (legs,) float64
        Receives T dt / (m0 c).
    winner : (legs,) int64
        Receives the start that won: the number of turns for 0 to 4 (`turns_of`), then the
        bent paths, then any of the random ones.
    mass_ratio : (legs,) float64
        Receives final over initial mass.
    """
    w = make_workspace(n)
    frame = np.empty((3, 3))
    x0 = np.empty(6)
    x1 = np.empty(6)
    for row in range(rv0.shape[0]):
        length, speed = scale_leg(rv0[row], rv1[row], mu, frame, x0, x1)
        tof = tof_s[row] * speed / length
        c = exhaust[row] / speed
        if not to_elements(x0, w.v[E0]) or not to_elements(x1, w.v[E1]):
            continue
        lay_timeline(tof, n, 0.0, 0.0, 1.0, w)
        best, start, unsure = _best_arc(x0, tof, c, n, bent, shapes[row], w)
        if best < np.inf:
            winner[row] = start
            if unsure:
                polish(x0, w.n3[BEST], n, n // 2, c, w.v[E1], w)
            close(x0, w.n3[BEST], n, w.v[E1], 1e-12, int(4), w)
            z_out[row] = z_of_impulses(w.n3[BEST], n, n // 2, c, w.s[FREE])
            mass_ratio[row] = write_throttles(w.n3[BEST], z_out[row], c, n, frame, throttles[row])
