"""Kernel: the flight time whose two-impulse transfer is cheapest, by grid search."""

import math

import numpy as np
from numpy.typing import NDArray

from feasibility.orbits.kepler_kernels import propagate
from feasibility.orbits.lambert_kernels import lambert
from feasibility.runtime.jit import inner_kernel, kernel

_Array = NDArray[np.float64]


@inner_kernel
def _cheapest(
    rv_dep: _Array,
    rv_arr: _Array,
    tof: float,
    times: tuple[float, float, float],
    max_revs: int,
    mu: float,
    scratch: tuple[_Array, _Array, _Array],
) -> float:
    """Return the cheapest time on the grid from times[0] to times[1] by steps of times[2]."""
    target, v1, v2 = scratch
    first, last, step = times
    best = np.inf
    chosen = first
    count = math.ceil((last - first) / step - 1e-9) + 1
    for j in range(count):
        time = min(first + j * step, last)
        propagate(rv_arr, time - tof, mu, target)
        lambert(rv_dep[:3], target[:3], time, max_revs, mu, v1, v2)
        for b in range(1 + 2 * max_revs):
            s1 = 0.0
            s2 = 0.0
            for i in range(3):
                s1 += (v1[b, i] - rv_dep[3 + i]) ** 2
                s2 += (v2[b, i] - target[3 + i]) ** 2
            cost = math.sqrt(s1) + math.sqrt(s2)
            if cost < best:
                best = cost
                chosen = time
    return chosen


@kernel
def cheapest_tof_batch(
    rv_dep: _Array,
    rv_arr: _Array,
    tof: _Array,
    first: float,
    last: float,
    coarse: float,
    fine: float,
    max_revs: int,
    mu: float,
) -> _Array:
    """Return (n,) s: the flight time in [first, last] with the lowest velocity change.

    `rv_dep` (n, 6) is the departure state, `rv_arr` (n, 6) the arrival body's
    state `tof` (n,) s later; SI. The grid has steps of `coarse`, and of `fine`
    up to one coarse step to either side of the best.
    """
    n = rv_dep.shape[0]
    best = np.empty(n)
    branches = 1 + 2 * max_revs
    scratch = (np.empty(6), np.empty((branches, 3)), np.empty((branches, 3)))
    for i in range(n):
        rough = _cheapest(
            rv_dep[i], rv_arr[i], tof[i], (first, last, coarse), max_revs, mu, scratch
        )
        low = max(rough - coarse, first)
        high = min(rough + coarse, last)
        best[i] = _cheapest(rv_dep[i], rv_arr[i], tof[i], (low, high, fine), max_revs, mu, scratch)
    return best
