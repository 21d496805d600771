"""Minimum propellant from two-impulse arcs, for legs that are far lighter than they could be.

The arc of m* thrusts all the time. Where a leg is many times lighter than m* it would rather
coast, wait on one of the two orbits, or go round another number of times: other arcs, which lie
near Lambert's. Everything here is in the scaled frame of the departure orbit (mu = 1, z along
its angular momentum), so that Lambert's prograde arcs turn as the departure orbit does.
"""

import math

import numpy as np
from numpy.typing import NDArray

from feasibility.orbits.kepler_kernels import propagate
from feasibility.orbits.lambert_kernels import lambert
from feasibility.runtime.jit import inner_kernel, kernel
from feasibility.sims_flanagan.fast.arc_kernels import close
from feasibility.sims_flanagan.fast.element_kernels import to_elements
from feasibility.sims_flanagan.fast.frame_kernels import (
    scale_leg,
    write_throttles,
)
from feasibility.sims_flanagan.fast.propellant_kernels import minimise_one
from feasibility.sims_flanagan.fast.workspace_kernels import DV, E1, lay_timeline, make_workspace

_Array = NDArray[np.float64]

_TURN = 2.0 * math.pi
_MOST_REVS = 4
_GRID = 20
_STARTS = 4
_DEARER = 1.2


@inner_kernel
def two_impulse_costs(
    x0: _Array,
    x1: _Array,
    tof: float,
    n: int,
    max_revs: int,
    departures: _Array,
    arrivals: _Array,
    v1: _Array,
    v2: _Array,
    costs: _Array,
) -> None:
    """Write the sum of both impulses for every pair of segments and every Lambert branch.

    The impulses are at the centres of segments i < j: until i the leg follows the departure
    orbit, from j on the arrival orbit.

    Parameters
    ----------
    x0, x1 : (6,) float64
        End states.
    departures, arrivals : (n, 6) float64
        Receive the two orbits' states at the centres of the segments.
    v1, v2 : (branches, 3) float64
        Scratch.
    costs : (branches, n, n) float64
        Receives the sums, inf where there is no arc.
    """
    dt = tof / n
    for i in range(n):
        propagate(x0, (i + 0.5) * dt, 1.0, departures[i])
        propagate(x1, -(n - i - 0.5) * dt, 1.0, arrivals[i])
    branches = 1 + 2 * max_revs
    costs[:, :, :] = np.inf
    # A long leg of many segments needs no finer grid than one of twenty.
    stride = (n + _GRID - 1) // _GRID
    for i in range(0, n, stride):
        for j in range(i + stride, n, stride):
            lambert(departures[i, :3], arrivals[j, :3], (j - i) * dt, max_revs, 1.0, v1, v2)
            for b in range(branches):
                if math.isnan(v1[b, 0]):
                    continue
                first = 0.0
                second = 0.0
                for k in range(3):
                    first += (v1[b, k] - departures[i, 3 + k]) ** 2
                    second += (arrivals[j, 3 + k] - v2[b, k]) ** 2
                costs[b, i, j] = math.sqrt(first) + math.sqrt(second)


@inner_kernel
def take_cheapest(costs: _Array, n: int) -> tuple[float, int, int, int]:
    """Return the least cost and its branch, i and j; cross the cell and its neighbours off."""
    apart = 3 * ((n + _GRID - 1) // _GRID)
    least = np.inf
    at_b, at_i, at_j = int(0), int(0), int(0)
    for b in range(costs.shape[0]):
        for i in range(n):
            for j in range(i + 1, n):
                if costs[b, i, j] < least:
                    least = costs[b, i, j]
                    at_b, at_i, at_j = b, i, j
    if least < np.inf:
        for i in range(max(at_i - apart, 0), min(at_i + apart + 1, n)):
            for j in range(max(at_j - apart, 0), min(at_j + apart + 1, n)):
                costs[at_b, i, j] = np.inf
    return least, at_b, at_i, at_j


@inner_kernel
def spread_impulse(impulse: _Array, centre: int, cap: float, n: int, dv: _Array) -> None:
    """Add an impulse to `dv`, on as many segments round `centre` as it takes at full thrust."""
    size = math.sqrt(impulse[0] ** 2 + impulse[1] ** 2 + impulse[2] ** 2)
    width = min(max(int(math.ceil(size / (0.9 * cap))), 1), n)
    first = min(max(centre - (width - 1) // 2, 0), n - width)
    for i in range(first, first + width):
        for k in range(3):
            dv[i, k] += impulse[k] / width


@inner_kernel
def two_impulse_starts(
    x0: _Array, x1: _Array, tof: float, cap: float, n: int, starts: _Array, sums: _Array
) -> int:
    """Write the impulses of the cheapest two-impulse arcs, cheapest first; return how many.

    Parameters
    ----------
    x0, x1 : (6,) float64
        End states.
    cap : float
        Impulse of a segment at full thrust and initial mass.
    starts : (k, n, 3) float64
        Receives the impulses, spread so that full thrust gives them; nearly closed.
    sums : (k,) float64
        Receives the sums of both impulses.
    """
    max_revs = min(int(tof / _TURN) + 1, int(_MOST_REVS))
    branches = 1 + 2 * max_revs
    departures = np.empty((n, 6))
    arrivals = np.empty((n, 6))
    v1 = np.empty((branches, 3))
    v2 = np.empty((branches, 3))
    costs = np.empty((branches, n, n))
    impulse = np.empty(3)
    two_impulse_costs(x0, x1, tof, n, max_revs, departures, arrivals, v1, v2, costs)
    for s in range(starts.shape[0]):
        sums[s], b, i, j = take_cheapest(costs, n)
        if not sums[s] < np.inf:
            return s
        lambert(departures[i, :3], arrivals[j, :3], (j - i) * tof / n, max_revs, 1.0, v1, v2)
        starts[s, :, :] = 0.0
        for k in range(3):
            impulse[k] = v1[b, k] - departures[i, 3 + k]
        spread_impulse(impulse, i, cap, n, starts[s])
        for k in range(3):
            impulse[k] = arrivals[j, 3 + k] - v2[b, k]
        spread_impulse(impulse, j, cap, n, starts[s])
    return len(starts)


@kernel
def minimum_restarts(
    rv0: _Array,
    rv1: _Array,
    tof_s: _Array,
    exhaust: _Array,
    z: _Array,
    n: int,
    mu: float,
    throttles: _Array,
    mass_ratio: _Array,
    winner: NDArray[np.int64],
) -> None:
    """Look for less propellant from two-impulse arcs, SI units; rows that gain are overwritten.

    Parameters
    ----------
    rv0, rv1 : (legs, 6) float64
        End states.
    tof_s, exhaust : (legs,) float64
        Flight times and exhaust velocities.
    z : (legs,) float64
        T dt / (m0 c) at the wanted initial mass.
    n : int
        Segments.
    mu : float
        Gravitational parameter.
    throttles : (legs, n, 3) float64
        Holds the solutions so far; receives better ones.
    mass_ratio : (legs,) float64
        Holds final over initial mass so far, 0 where there is no solution; receives larger ones.
    winner : (legs,) int64
        Receives the number of the start, 0 the cheapest arc, where it won.
    """
    w = make_workspace(n)
    frame = np.empty((3, 3))
    x0 = np.empty(6)
    x1 = np.empty(6)
    starts = np.empty((_STARTS, n, 3))
    sums = np.empty(_STARTS)
    dv, target = w.n3[DV], w.v[E1]
    for row in range(rv0.shape[0]):
        length, speed = scale_leg(rv0[row], rv1[row], mu, frame, x0, x1)
        if not to_elements(x1, target):
            continue
        tof = tof_s[row] * speed / length
        lay_timeline(tof, n, 0.0, 0.0, 1.0, w)
        c = exhaust[row] / speed
        best = -c * math.log(mass_ratio[row]) if mass_ratio[row] > 0.0 else np.inf
        count = two_impulse_starts(x0, x1, tof, c * z[row], n, starts, sums)
        for s in range(count):
            # The sum is not far above what the best thrust of this kind costs.
            if sums[s] > _DEARER * best:
                break
            dv[:, :] = starts[s]
            if not close(x0, dv, n, target, 1e-9, int(12), w):
                continue
            total = minimise_one(x0, target, c, z[row], n, n // 2, dv, w)
            if total < best:
                best = total
                winner[row] = s
                mass_ratio[row] = write_throttles(dv, z[row], c, n, frame, throttles[row])


@kernel
def two_impulse_batch(
    rv0: _Array, rv1: _Array, tof_s: _Array, push: _Array, mu: float, impulses: _Array
) -> NDArray[np.int64]:
    """Write (legs, k, n, 3) m/s, the starts of `two_impulse_starts`; return how many a leg has.

    For legs with `rv0`, `rv1` (legs, 6), `tof_s` and `push` (legs,), SI; `push` is thrust x
    segment time / initial mass, the impulse of a segment at full thrust.
    """
    k, n = impulses.shape[1], impulses.shape[2]
    frame = np.empty((3, 3))
    x0 = np.empty(6)
    x1 = np.empty(6)
    starts = np.empty((k, n, 3))
    sums = np.empty(k)
    counts = np.zeros(rv0.shape[0], dtype=np.int64)
    for row in range(rv0.shape[0]):
        length, speed = scale_leg(rv0[row], rv1[row], mu, frame, x0, x1)
        tof = tof_s[row] * speed / length
        counts[row] = two_impulse_starts(x0, x1, tof, push[row] / speed, n, starts, sums)
        for s in range(counts[row]):
            for i in range(n):
                for j in range(3):
                    impulses[row, s, i, j] = speed * (
                        frame[0, j] * starts[s, i, 0]
                        + frame[1, j] * starts[s, i, 1]
                        + frame[2, j] * starts[s, i, 2]
                    )
    return counts
