"""Maximum initial mass: which starts, in which order, for one leg and for a batch."""

import math

import numpy as np
from numpy.typing import NDArray

from feasibility.jit import kernel
from feasibility.sims_flanagan.fast_arc_kernels import close, improve
from feasibility.sims_flanagan.fast_dual_kernels import z_of_impulses
from feasibility.sims_flanagan.fast_element_kernels import to_elements
from feasibility.sims_flanagan.fast_frame_kernels import scale_leg, write_throttles
from feasibility.sims_flanagan.fast_lifted_kernels import advance, draw_path, lifted_sweep
from feasibility.sims_flanagan.fast_workspace_kernels import (
    DV,
    E0,
    E1,
    LONGITUDE,
    NODES,
    START_LAM,
    STARTS,
    TURN_Z,
    Workspace,
    Z,
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
_SAME = 1e-3
_STILL = 3e-3
_LOST = 1.25
_HOPELESS = 1.03
_LIKELY = 1.3

_Array = NDArray[np.float64]


@kernel
def turns_of(s: int) -> int:
    """Return the number of whole turns of start `s`: 0, 1, -1, 2, -2 beside the nearest."""
    return (s + 1) // 2 * (1 if s % 2 else -1)


@kernel
def likely_turn(k: int, best: float, w: Workspace) -> int:
    """Return the start number of the k-th, cyclically, of the turns not far from `best`."""
    likely = 0
    for s in range(_N_TURNS):
        if w.v[TURN_Z, s] < _LIKELY * best:
            likely += 1
    if likely == 0:
        return k % _N_TURNS
    k = k % likely
    for s in range(_N_TURNS):
        if w.v[TURN_Z, s] < _LIKELY * best:
            if k == 0:
                return s
            k -= 1
    return 0


@kernel
def lay_path(s: int, turns: int, shape: _Array, tof: float, n: int, w: Workspace) -> bool:
    """Draw path `s`, without impulses yet; return whether there is one."""
    w.v[Z, s] = np.inf
    w.v[LONGITUDE, s] = draw_path(w.v[E0], w.v[E1], tof, turns, n, shape, w.n6[NODES + s])
    for i in range(6):
        w.v[START_LAM + s, i] = 0.0
    for i in range(n):
        for j in range(3):
            w.n3[STARTS + s, i, j] = 0.0
    return not math.isnan(w.v[LONGITUDE, s])


@kernel
def bend(
    s: int, sweeps: int, gentle: int, tof: float, c: float, n: int, best: float, w: Workspace
) -> bool:
    """Take up to `sweeps` lifted steps on path `s`; return False where it lags behind `best`.

    A path without impulses takes plain steps, the first `gentle` of them to the least sum
    of squares instead of the least thrust, which often leads to another optimum; its z goes
    to w.v[Z, s]. A path under way follows Anderson's rule until it stands still.
    """
    nodes, start, lam = w.n6[NODES + s], w.n3[STARTS + s], w.v[START_LAM + s]
    fresh = not w.v[Z, s] < np.inf
    z = -1.0 if fresh else w.v[Z, s]
    relax = 1.0 if fresh else _RELAX
    count = int(0)
    for sweep in range(sweeps):
        z, move = lifted_sweep(
            w.v[E0],
            w.v[E1],
            w.v[LONGITUDE, s],
            tof / n,
            n,
            n // 2,
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
            w.v[Z, s] = z
    return True


@kernel
def finish(s: int, x0: _Array, tof: float, c: float, n: int, best: float, w: Workspace) -> float:
    """Close the arc of path `s` and improve it; leave it in w.n3[DV], return its z or inf."""
    dv, target = w.n3[DV], w.v[E1]
    dt = tof / n
    for i in range(n):
        for j in range(3):
            dv[i, j] = w.n3[STARTS + s, i, j]
    if not close(x0, dv, n, dt, target, 1e-9, int(12), w):
        return np.inf
    lam = w.v[START_LAM + s]
    z = improve(x0, dv, n, n // 2, dt, c, target, 30, 1e-4, _HOPELESS * best, lam, w)
    if z < best and close(x0, dv, n, dt, target, 1e-12, int(4), w):
        return z_of_impulses(dv, n, n // 2, c)
    return z


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
    best_dv = np.empty((n, 3))
    straight = np.zeros((5, 3))
    # Literal integers would make numba compile a kernel once for each value.
    no_sweeps = int(0)
    first_and_gentle = int(_FIRST_SWEEPS + _GENTLE)
    for row in range(rv0.shape[0]):
        length, speed = scale_leg(rv0[row], rv1[row], mu, frame, x0, x1)
        tof = tof_s[row] * speed / length
        c = exhaust[row] / speed
        if not to_elements(x0, w.v[E0]) or not to_elements(x1, w.v[E1]):
            continue
        best = np.inf
        agreed = 0
        for s in range(_N_TURNS):
            if lay_path(s, turns_of(s), straight, tof, n, w):
                bend(s, int(_FIRST_SWEEPS), no_sweeps, tof, c, n, best, w)
            w.v[TURN_Z, s] = w.v[Z, s]
        # On short legs all starts agree.
        n_bent = bent.shape[0] if w.v[LONGITUDE, 0] - w.v[E0, 5] > _SHORT else 0
        for attempt in range(_N_TURNS + n_bent + shapes.shape[1]):
            k = attempt - _N_TURNS
            if 0 <= k < n_bent and agreed >= _AGREEMENT:
                continue
            if k < 0:
                s = int(np.argmin(w.v[Z, :_N_TURNS]))
                start = s
                if not w.v[Z, s] < _SCREEN * best:
                    continue
            else:
                s = int(_N_TURNS)
                start = attempt if k < n_bent else _N_TURNS + bent.shape[0]
                shape = bent[k] if k < n_bent else shapes[row, k - n_bent]
                if lay_path(s, turns_of(likely_turn(k, best, w)), shape, tof, n, w):
                    bend(s, first_and_gentle, int(_GENTLE), tof, c, n, best, w)
            z = np.inf
            if w.v[Z, s] < np.inf and bend(s, int(_SWEEPS), no_sweeps, tof, c, n, best, w):
                z = finish(s, x0, tof, c, n, best, w)
            w.v[Z, s] = np.inf
            if k < 0 and z < np.inf:
                w.v[TURN_Z, s] = z
            if z < best:
                agreed = agreed + 1 if z > (1.0 - _SAME) * best else 1
            elif z < (1.0 + _SAME) * best:
                agreed += 1
            if z < best:
                best = z
                winner[row] = start
                for i in range(n):
                    for j in range(3):
                        best_dv[i, j] = w.n3[DV, i, j]
        if best < np.inf:
            z_out[row] = best
            mass_ratio[row] = write_throttles(best_dv, best, c, n, frame, throttles[row])
