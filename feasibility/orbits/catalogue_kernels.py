"""Kernel of the whole-catalogue propagation: bare arrays in, bare arrays out.

Columns of the packed orbits are named by the constants below.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from feasibility.constants import DAY_S
from feasibility.runtime.jit import inner_kernel, kernel

N_COLUMNS: Final = 10
ECCENTRICITY: Final = 0
MEAN_ANOMALY: Final = 1
"""rad, at the epoch of the elements."""
MEAN_MOTION: Final = 2
"""rad/s."""
EPOCH: Final = 3
"""MJD2000."""
AXIS_A: Final = 4
"""First of three columns, m: semi-major axis vector, see `elements.perifocal_axes`."""
AXIS_B: Final = 7
"""First of three columns, m: semi-minor axis vector."""

_MAX_NEWTON_STEPS: Final = 60


@inner_kernel
def eccentric_anomaly(mean_anomaly: float, e: float) -> float:
    """Solve Kepler's equation for one ellipse; method as in `elements.mean_to_eccentric`."""
    turns = np.round(mean_anomaly / (2.0 * math.pi))
    reduced = mean_anomaly - turns * 2.0 * math.pi
    target = abs(reduced)
    root: float = min(target + e, math.pi)
    if e > 0.5:
        root = min(root, target / (1.0 - e), np.cbrt(math.pi * math.pi * target))
    for _ in range(_MAX_NEWTON_STEPS):
        step = (root - e * math.sin(root) - target) / (1.0 - e * math.cos(root))
        root -= step
        # Quadratic convergence: after a step this small the next one is below rounding,
        # except where e is so near 1 that only the end of the descent tells.
        if step <= 1e-15 * root or (step < 1e-9 * root and e < 0.9):
            break
    return root if reduced >= 0.0 else -root


@kernel
def propagate_rows(
    orbits: NDArray[np.float64], rows: NDArray[np.int64], t_mjd2000: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return (k, 6), m and m/s: the state of body rows[j] at epoch t_mjd2000[j].

    `orbits` is (n, 10), `rows` (k,) within 0..n-1, `t_mjd2000` (k,).
    """
    states = np.empty((rows.size, 6))
    for j in range(rows.size):
        row = rows[j]
        e = orbits[row, ECCENTRICITY]
        motion = orbits[row, MEAN_MOTION]
        elapsed = (t_mjd2000[j] - orbits[row, EPOCH]) * DAY_S
        anomaly = eccentric_anomaly(orbits[row, MEAN_ANOMALY] + motion * elapsed, e)
        cos_e = math.cos(anomaly)
        sin_e = math.sin(anomaly)
        rate = motion / (1.0 - e * cos_e)
        for axis in range(3):
            a = orbits[row, AXIS_A + axis]
            b = orbits[row, AXIS_B + axis]
            states[j, axis] = (cos_e - e) * a + sin_e * b
            states[j, 3 + axis] = rate * (cos_e * b - sin_e * a)
    return states
