"""Scratch arrays of the fast leg solvers, allocated once a batch.

A few stacked arrays rather than many: every array in a kernel's signature costs
compile time in each kernel that it passes through.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from feasibility.runtime.jit import inner_kernel

N_STARTS = 26
"""Paths that can be under way at once: five numbers of turns, one random path, and for legs with
free ends five more numbers of turns, nine Lambert arcs and six along the bodies' own orbits."""

MEMORY = 6
"""Steps that Anderson's rule remembers; at most 6, the size of the matrices at hand."""

_LIGHTEST = 0.1
_HEAVIEST = 300.0
_NEXT_TO_NOTHING = 1e-30

OPEN = 1e3
"""Added to the largest excess of an end where any velocity is right."""

# Rows of Workspace.n3: per segment, three components.
DV, TRIAL, LINEAR, RESIDUAL, PREVIOUS, PRIMER, TRIAL_PRIMER, THRUST, BEST = range(9)
D_RESIDUAL = 9
D_DV = D_RESIDUAL + MEMORY
# Of a free end at its bound the direction of the excess, otherwise zero.
ALONG = D_DV + MEMORY
STARTS = ALONG + 1
# Rows of Workspace.n6: per segment, six components.
JUMPS, MOVED, MOVED_BEFORE = range(3)
D_MOVED = 3
D_NODES = D_MOVED + MEMORY
NODES = D_NODES + MEMORY
# Rows of Workspace.s: per segment, one number.
NORM, TRIAL_NORM, Y, SLOPE, PINNED, CAP, THRESHOLD = range(7)
# ... of a free end the largest excess, 0 for segments, and next to nothing for an open end, where
# any velocity is right and linear problems leave the excess out; what no excess may exceed; its
# weight in corrections; the coast before each impulse, and after the last one. `lay_timeline`
# writes them.
FREE, LIMIT, WEIGHT, COAST = range(7, 11)
# Rows of Workspace.m after the n transition matrices, counted from the end.
HESSIAN, HESSIAN_LOWER, TURNED, LOWER, M_ONE, M_TWO = range(-1, -7, -1)
# Rows of Workspace.v: six components; the first three are scratch of element_derivatives.
X, GAP, TRIAL_GAP, TOTAL, WORK, E0, E1, LAM, STEP, TRIAL_LAM, INNER_0, INNER_1 = range(3, 15)
START_LAM = 15
# Rows of Workspace.p: per path, one number.
Z, LONGITUDE, TURN_Z = range(3)


class Workspace(NamedTuple):
    """Scratch arrays for legs of n impulses; the rows are named above.

    A leg has an impulse for each segment. Where an end is free, its excess velocity is one more
    impulse, at the end itself, with a bound of its own.
    """

    n3: NDArray[np.float64]
    n6: NDArray[np.float64]
    b: NDArray[np.float64]
    m: NDArray[np.float64]
    v: NDArray[np.float64]
    s: NDArray[np.float64]
    p: NDArray[np.float64]


@inner_kernel
def make_workspace(n: int) -> Workspace:
    """Allocate a `Workspace` for legs of up to n impulses."""
    return Workspace(
        np.zeros((STARTS + N_STARTS, n, 3)),
        np.zeros((NODES + N_STARTS, n, 6)),
        np.zeros((2, n, 6, 3)),
        np.zeros((n + 6, 6, 6)),
        np.zeros((START_LAM + N_STARTS, 6)),
        np.zeros((11, n + 1)),
        np.zeros((3, N_STARTS)),
    )


@inner_kernel
def lay_timeline(
    tof: float,
    n: int,
    dep: float,
    arr: float,
    typical: float,
    w: Workspace,
) -> tuple[int, int]:
    """Write when the impulses act and which are free ends; return how many, and in the first half.

    Parameters
    ----------
    tof : float
        Time of flight.
    n : int
        Segments.
    dep, arr : float
        Largest excess at departure and arrival; an end with 0 has no impulse. `OPEN` or more
        marks the one end where any velocity is right.
    typical : float
        Size of a segment's impulse: the excess may change as easily in corrections as they.
    w : Workspace
        Receives the coasts, bounds and weights.

    Returns
    -------
    rows, forward : int
        Impulses in all, and before the middle of the leg.
    """
    dt = tof / n
    free, limit, weight, coast = w.s[FREE], w.s[LIMIT], w.s[WEIGHT], w.s[COAST]
    first = 1 if dep > 0.0 else 0
    last = 1 if arr > 0.0 else 0
    rows = n + first + last
    for i in range(rows):
        free[i] = 0.0
        weight[i] = 1.0
        coast[i] = dt
        for j in range(3):
            w.n3[ALONG, i, j] = 0.0
    coast[first] = 0.5 * dt
    coast[first + n] = 0.5 * dt
    if first > 0:
        free[0] = dep
        coast[0] = 0.0
    if last > 0:
        free[rows - 1] = arr
        coast[rows] = 0.0
    for i in range(rows):
        if free[i] > 0.0:
            limit[i] = free[i]
            weight[i] = min(max(free[i] / typical, _LIGHTEST), _HEAVIEST) ** 2
            if free[i] >= OPEN:
                limit[i] = free[i] - OPEN
                weight[i] = _HEAVIEST**2
                free[i] = _NEXT_TO_NOTHING
    return rows, first + n // 2


@inner_kernel
def has_free_ends(n: int, w: Workspace) -> bool:
    """Tell whether any of the leg's n impulses is the excess of a free end."""
    return bool(w.s[FREE, 0] > 0.0 or w.s[FREE, n - 1] > 0.0)


@inner_kernel
def open_end(n: int, w: Workspace) -> int:
    """Return which of the leg's n impulses is the excess of an open end; -1 if none."""
    for i in range(0, n, max(n - 1, 1)):
        if w.s[FREE, i] > 0.0 and w.s[LIMIT, i] > w.s[FREE, i]:
            return i
    return -1
