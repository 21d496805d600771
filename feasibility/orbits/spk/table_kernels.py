"""Kernel that evaluates a table of Chebyshev pieces: bare arrays in, bare arrays out."""

import numpy as np
from numpy.typing import NDArray

from feasibility.runtime.jit import kernel


@kernel
def table_states(
    first: NDArray[np.int64],
    start: NDArray[np.float64],
    end: NDArray[np.float64],
    coefficients: NDArray[np.float64],
    rows: NDArray[np.int64],
    t_mjd2000: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return states, m and m/s, and by how many days each epoch is outside the table.

    The pieces of body j are ``first[j]`` to ``first[j + 1] - 1``, in order of time; `start` and
    `end` are (p,) MJD2000, `coefficients` (p, 6, c). Outside, the state at the nearer end is
    returned; days before it are negative.
    """
    n_coefficients = coefficients.shape[2]
    states = np.empty((rows.size, 6))
    outside = np.zeros(rows.size)
    for j in range(rows.size):
        low = first[rows[j]]
        high = first[rows[j] + 1] - 1
        t = t_mjd2000[j]
        if t < start[low]:
            outside[j] = t - start[low]
            t = start[low]
        elif t > end[high]:
            outside[j] = t - end[high]
            t = end[high]
        while low < high:
            middle = (low + high + 1) // 2
            if start[middle] <= t:
                low = middle
            else:
                high = middle - 1
        x = (2.0 * t - start[low] - end[low]) / (end[low] - start[low])
        for component in range(6):
            # Clenshaw's recurrence.
            last = 0.0
            this = 0.0
            for k in range(n_coefficients - 1, 0, -1):
                this, last = coefficients[low, component, k] + 2.0 * x * this - last, this
            states[j, component] = coefficients[low, component, 0] + x * this - last
    return states, outside
