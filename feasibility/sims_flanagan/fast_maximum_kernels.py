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
def begin(
    s: int, turns: int, gentle: int, shape: _Array, tof: float, c: float, n: int, w: Workspace
) -> None:
    """Draw path `s` and take its first lifted steps; its z goes to w.v[Z, s], inf where none.

    The first `gentle` steps go for the least sum of squares instead of the least thrust,
    which often leads to another optimum.
    """
    nodes, dv, lam = w.n6[NODES + s], w.n3[STARTS + s], w.v[START_LAM + s]
    e0, e1 = w.v[E0], w.v[E1]
    w.v[Z, s] = np.inf
    longitude = draw_path(e0, e1, tof, turns, n, shape, nodes)
    w.v[LONGITUDE, s] = longitude
    if math.isnan(longitude):
        return
    for i in range(6):
        lam[i] = 0.0
    for i in range(n):
        for j in range(3):
            dv[i, j] = 0.0
    z = -1.0
    for sweep in range(_FIRST_SWEEPS + gentle):
        z, _ = lifted_sweep(
            e0,
            e1,
            longitude,
            tof / n,
            n,
            n // 2,
            c,
            sweep == 0,
            sweep < gentle,
            nodes,
            dv,
            z,
            lam,
            w,
        )
        if not z > 0.0 or advance(nodes, dv, n, 1.0, 0, w) < 0:
            return
        w.v[Z, s] = z


@kernel
def pursue(s: int, x0: _Array, tof: float, c: float, n: int, best: float, w: Workspace) -> float:
    """Bend path `s` to a closed arc and improve it; leave it in w.n3[DV], return its z or inf."""
    nodes, start, lam = w.n6[NODES + s], w.n3[STARTS + s], w.v[START_LAM + s]
    e0, e1 = w.v[E0], w.v[E1]
    dv = w.n3[DV]
    dt = tof / n
    n_forward = n // 2
    z = w.v[Z, s]
    count = 0
    for sweep in range(_SWEEPS):
        z, move = lifted_sweep(
            e0, e1, w.v[LONGITUDE, s], dt, n, n_forward, c, False, False, nodes, start, z, lam, w
        )
        if not z > 0.0 or move < 3e-3:
            break
        if sweep >= 3 and z > _LOST * best:
            return np.inf
        count = advance(nodes, start, n, _RELAX, count, w)
        if count < 0:
            break
    for i in range(n):
        for j in range(3):
            dv[i, j] = start[i, j]
    if not close(x0, dv, n, dt, e1, 1e-9, 12, w):
        return np.inf
    z = improve(x0, dv, n, n_forward, dt, c, e1, 30, 1e-4, _HOPELESS * best, lam, w)
    if z < best and close(x0, dv, n, dt, e1, 1e-12, 4, w):
        return z_of_impulses(dv, n, n_forward, c)
    return z


@kernel
def maximum_one(
    x0: _Array,
    x1: _Array,
    tof: float,
    c: float,
    n: int,
    bent: _Array,
    shapes: _Array,
    w: Workspace,
    best_dv: _Array,
) -> tuple[float, int]:
    """Find the least z of one scaled leg.

    Parameters
    ----------
    x0, x1 : (6,) float64
        End states; mu = 1, departure orbit in the plane z = 0.
    tof, c : float
        Flight time and exhaust velocity.
    n : int
        Segments.
    bent : (b, 5, 3) float64
        Path shapes to be tried besides the plain paths unless the leg is short.
    shapes : (k, 5, 3) float64
        Path shapes to be tried on every leg.
    w : Workspace
    best_dv : (n, 3) float64
        Receives the impulses.

    Returns
    -------
    float, int
        z = T dt / (m0 c) of the best arc, inf where none; the start that won: the number of
        turns for 0 to 4 (`turns_of`), then the bent paths, then any of the random ones.
    """
    best = np.inf
    winner = -1
    if not to_elements(x0, w.v[E0]) or not to_elements(x1, w.v[E1]):
        return best, winner
    plain = np.zeros((5, 3))
    for s in range(_N_TURNS):
        begin(s, turns_of(s), 0, plain, tof, c, n, w)
        w.v[TURN_Z, s] = w.v[Z, s]
    # On short legs all starts agree.
    n_bent = bent.shape[0] if w.v[LONGITUDE, 0] - w.v[E0, 5] > _SHORT else 0
    for attempt in range(_N_TURNS + n_bent + shapes.shape[0]):
        k = attempt - _N_TURNS
        if k < 0:
            s = int(np.argmin(w.v[Z, :_N_TURNS]))
            start = s
            if not w.v[Z, s] < _SCREEN * best:
                continue
        else:
            s = _N_TURNS
            start = attempt if k < n_bent else _N_TURNS + bent.shape[0]
            shape = bent[k] if k < n_bent else shapes[k - n_bent]
            begin(s, turns_of(likely_turn(k, best, w)), _GENTLE, shape, tof, c, n, w)
        z = np.inf
        if w.v[Z, s] < np.inf:
            z = pursue(s, x0, tof, c, n, best, w)
        w.v[Z, s] = np.inf
        if attempt < _N_TURNS and z < np.inf:
            w.v[TURN_Z, s] = z
        if z < best:
            best = z
            winner = start
            for i in range(n):
                for j in range(3):
                    best_dv[i, j] = w.n3[DV, i, j]
    return best, winner


@kernel
def maximum_batch(
    rv0: _Array,
    rv1: _Array,
    tof: _Array,
    c: _Array,
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
    tof, c : (legs,) float64
        Flight times and exhaust velocities.
    n : int
        Segments.
    mu : float
        Gravitational parameter.
    bent, shapes : (b, 5, 3) float64, (legs, k, 5, 3) float64
        Path shapes, see `maximum_one`.
    throttles : (legs, n, 3) float64
        Receives the throttles.
    z_out : (legs,) float64
        Receives T dt / (m0 c).
    winner : (legs,) int64
        Receives the start that won.
    mass_ratio : (legs,) float64
        Receives final over initial mass.
    """
    w = make_workspace(n)
    frame = np.empty((3, 3))
    x0 = np.empty(6)
    x1 = np.empty(6)
    dv = np.empty((n, 3))
    for row in range(rv0.shape[0]):
        length, speed = scale_leg(rv0[row], rv1[row], mu, frame, x0, x1)
        ce = c[row] / speed
        z, s = maximum_one(x0, x1, tof[row] * speed / length, ce, n, bent, shapes[row], w, dv)
        z_out[row] = z
        winner[row] = s
        if s < 0:
            continue
        mass_ratio[row] = write_throttles(dv, z, ce, n, frame, throttles[row])
