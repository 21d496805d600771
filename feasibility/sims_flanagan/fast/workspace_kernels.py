"""Scratch arrays of the fast leg solvers, allocated once a batch.

A few stacked arrays rather than many: every array in a kernel's signature costs
compile time in each kernel that it passes through.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from feasibility.runtime.jit import inner_kernel

N_STARTS = 6
"""Paths that can be under way at once: five numbers of turns and one random path."""

MEMORY = 6
"""Steps that Anderson's rule remembers; at most 6, the size of the matrices at hand."""

# Rows of Workspace.n3: per segment, three components.
DV, TRIAL, LINEAR, RESIDUAL, PREVIOUS, PRIMER, TRIAL_PRIMER, THRUST, BEST = range(9)
D_RESIDUAL = 9
D_DV = D_RESIDUAL + MEMORY
STARTS = D_DV + MEMORY
# Rows of Workspace.n6: per segment, six components.
JUMPS, MOVED, MOVED_BEFORE = range(3)
D_MOVED = 3
D_NODES = D_MOVED + MEMORY
NODES = D_NODES + MEMORY
# Rows of Workspace.s: per segment, one number.
NORM, TRIAL_NORM, Y, SLOPE, PINNED, CAP, THRESHOLD = range(7)
# Rows of Workspace.m after the n transition matrices, counted from the end.
HESSIAN, HESSIAN_LOWER, TURNED, LOWER, M_ONE, M_TWO = range(-1, -7, -1)
# Rows of Workspace.v: six components; the first three are scratch of element_derivatives.
X, GAP, TRIAL_GAP, TOTAL, WORK, E0, E1, LAM, Z, LONGITUDE, TURN_Z, STEP, TRIAL_LAM = range(3, 16)
START_LAM = 16


class Workspace(NamedTuple):
    """Scratch arrays for legs of n segments; the rows are named above."""

    n3: NDArray[np.float64]
    n6: NDArray[np.float64]
    b: NDArray[np.float64]
    m: NDArray[np.float64]
    v: NDArray[np.float64]
    s: NDArray[np.float64]


@inner_kernel
def make_workspace(n: int) -> Workspace:
    """Allocate a `Workspace` for legs of n segments."""
    return Workspace(
        np.zeros((STARTS + N_STARTS, n, 3)),
        np.zeros((NODES + N_STARTS, n, 6)),
        np.zeros((2, n, 6, 3)),
        np.zeros((n + 6, 6, 6)),
        np.zeros((START_LAM + N_STARTS, 6)),
        np.zeros((7, n)),
    )
