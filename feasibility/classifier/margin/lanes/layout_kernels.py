"""Where the numbers of eight legs stand in one flat array of work.

A row has one number of each leg; `at` is the place of a lane in a row. One array with fixed rows
lets the compiler see that rows do not overlap, without which it makes no vectors.
"""

import numpy as np
from numpy.typing import NDArray

from feasibility.runtime.jit import lane_function, lane_kernel

LANES = 8
"""Legs at a time: as many as the widest vectors hold."""

NODES = 12
"""Segments of a path, as in the features of one leg."""

MOST = NODES + 2
"""Nodes with both ends."""

# States and elements of both ends; what is to be done and its dual.
S0, S1, X0, X1, D, P = 0, 6, 12, 18, 24, 30
# The bodies' states, and the velocities of Lambert's arc.
BODY0, BODY1, V1, V2 = 36, 42, 48, 51
# Excess velocities, scratch, the first of two sums, a coasted state, axes.
EXCESS0, EXCESS1, SCRATCH, FIRST, COASTED, AXES = 54, 57, 60, 66, 72, 78
MATRIX = 87
ONES = MATRIX + 36
TOF, VE, NEAR, IMPULSE, VALUE, TOTAL = ONES, ONES + 1, ONES + 2, ONES + 3, ONES + 4, ONES + 5
DONE, GAP, LENGTH, DEP, ARR, ODD = ONES + 6, ONES + 7, ONES + 8, ONES + 9, ONES + 10, ONES + 11
LEFT, MIMA, SIZE, UNIT, SPEED, GUESS = (ONES + 12 + k for k in range(6))
LAM, Q, TARGET, DIRECT, X, STEP = (ONES + 18 + k for k in range(6))
LOOSE, OVER = ONES + 24, ONES + 25
# Direction of both positions and along the motion, and sizes.
ARC = ONES + 26
PATH = ARC + 18
ROWS = PATH + 6 * MOST
DUALS = ROWS + 13 * MOST
WEIGHTS = DUALS + 4 * MOST
RATIO = WEIGHTS + MOST
REMAINING = RATIO + MOST
ROOT = REMAINING + MOST
ANGLE = ROOT + MOST
SINE = ANGLE + MOST
COSINE = SINE + MOST
FEATURES = COSINE + MOST
N_ROWS = FEATURES + 56


@lane_function
def at(row: int, lane: int) -> int:
    """Return the place of a lane in a row."""
    return row * LANES + lane


@lane_kernel
def lane_workspace() -> NDArray[np.float64]:
    """Return the array of work."""
    return np.zeros(N_ROWS * LANES)
