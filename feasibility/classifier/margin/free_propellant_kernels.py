"""The excess velocities with which a leg with free ends needs the least propellant.

The problem is that of `propellant_kernels`, with the two impulses at the ends of
`free_path_kernels`: these cost nothing within their bounds. The best excess velocities depend on
the initial mass: the lighter the spacecraft, the nearer is a path to a Lambert arc. So there are
two starts: the path of the hint of m*, and one between the ends of the cheapest Lambert arc, cut
to the bounds. With the ends found, `propellant_kernels` makes the hint.
"""

import math

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.margin.feature_kernels import MAX_REVS, least_motion, wrapped
from feasibility.classifier.margin.free_path_kernels import (
    SEGMENTS,
    EndsWork,
    cheapest_branch,
    cut_excess,
    ends_workspace,
    lay_ends,
    lay_problem,
    move_part,
    read_excess,
    to_leg_frame,
    turn_back,
    weigh_alike,
)
from feasibility.classifier.margin.path_kernels import (
    SATURATED,
    STRIDE,
    PathWork,
    duals,
    first_path,
    flown_path,
    weighted_solve,
)
from feasibility.orbits.lambert_kernels import lambert
from feasibility.runtime.jit import inner_kernel, kernel

_Array = NDArray[np.float64]

_ROUNDS = 3
_FIRST_STEPS = 5
_NEXT_STEPS = 4
_DAMPING = 0.65
_TWO_PI = 2.0 * math.pi
_LEAST_WEIGHT = 1e-4
_MOST_BURNT = 3.0
_STIFF = 1e6
_TYPICAL_IMPULSE = 0.1


@inner_kernel
def least_bounded_impulses(
    ve: float,
    push: float,
    dep: float,
    arr: float,
    steps: int,
    bound: _Array,
    path_work: PathWork,
) -> float:
    """Return the sum of impulses after some steps, SATURATED where the problem is singular.

    `push` is the impulse of a segment at full thrust and initial mass; the weights of the first
    step are given. `bound` (SEGMENTS,) receives the impulses at full thrust.
    """
    _, rows, p, weights, g, _, d, _ = path_work
    total = SATURATED
    for step in range(steps):
        if not weighted_solve(rows, weights, d, int(SEGMENTS + 2), p):
            return SATURATED
        duals(rows, p, int(SEGMENTS + 2), g)
        total = 0.0
        for i in range(SEGMENTS):
            if step == 0:
                bound[i] = push * math.exp(min(total / ve, _MOST_BURNT))
            total += weights[i] * g[3 * STRIDE + i]
        if step == steps - 1:
            break
        least = _LEAST_WEIGHT * total / SEGMENTS
        for i in range(SEGMENTS):
            dual = g[3 * STRIDE + i] + 1e-9
            weights[i] = max(min(weights[i] * dual * math.sqrt(dual), bound[i] / dual), least)
        stiff = _STIFF * max(total, 1e-12) / SEGMENTS
        for end in range(2):
            i = SEGMENTS + end
            limit = dep if end == 0 else arr
            weights[i] = min(limit / max(g[3 * STRIDE + i], 1e-30), stiff)
    return total


@inner_kernel
def follow(
    beside: float,
    guess: float,
    s0: _Array,
    s1: _Array,
    tof: float,
    ve: float,
    push: float,
    dep: float,
    arr: float,
    bound: _Array,
    work: EndsWork,
) -> float:
    """Return the sum of impulses between ends whose excess velocities are in `ends`.

    These are replaced by better ones. SATURATED where there is no path.
    """
    path_work, ends, elements, flown, _, _, _, _, _, _, _, _ = work
    path, rows, _, weights, g, _, _, _ = path_work
    before = ends[5:]
    if not lay_ends(s0, s1, ends, elements):
        return SATURATED
    x0, x1 = elements[0], elements[1]
    mean = 0.5 * tof * (x0[0] + x1[0])
    excess = wrapped(x1[5] - x0[5] - mean) + _TWO_PI * beside
    x1[5] = x0[5] + mean + excess
    least = least_motion(0) if beside == 0.0 else least_motion(1)
    first_path(x0, x1, tof, excess, least, int(SEGMENTS), path)
    if not lay_problem(tof, dep, arr, int(SEGMENTS), ends, elements, path_work):
        return SATURATED
    weigh_alike(guess, dep, arr, int(SEGMENTS), path_work)
    total = least_bounded_impulses(ve, push, dep, arr, int(_FIRST_STEPS), bound, path_work)
    for _ in range(_ROUNDS):
        if not total < SATURATED:
            return SATURATED
        read_excess(int(0), dep, s0, int(SEGMENTS), work)
        read_excess(int(1), arr, s1, int(SEGMENTS), work)
        for j in range(6):
            before[0, j], before[1, j] = ends[0, j], ends[1, j]
        move_part(s0, before[0], ends[2])
        move_part(s1, before[1], ends[3])
        if not lay_ends(s0, s1, ends, elements):
            return SATURATED
        flown_path(elements[0], rows, weights, g, tof, int(SEGMENTS), flown)
        last = SEGMENTS - 1
        longitude = flown[5 * STRIDE + last] + 0.5 * tof / SEGMENTS * flown[last]
        elements[1, 5] += _TWO_PI * np.rint((longitude - elements[1, 5]) / _TWO_PI)
        for i in range(SEGMENTS):
            for j in range(6):
                path[j * STRIDE + i] += _DAMPING * (flown[j * STRIDE + i] - path[j * STRIDE + i])
        if not lay_problem(tof, dep, arr, int(SEGMENTS), ends, elements, path_work):
            return SATURATED
        total = least_bounded_impulses(ve, push, dep, arr, int(_NEXT_STEPS), bound, path_work)
    read_excess(int(0), dep, s0, int(SEGMENTS), work)
    read_excess(int(1), arr, s1, int(SEGMENTS), work)
    return total


@kernel
def free_propellant_batch(
    rv_dep: _Array,
    rv_arr: _Array,
    tof_s: _Array,
    exhaust: _Array,
    push: _Array,
    bounds: _Array,
    beside: _Array,
    mu: float,
    excess: _Array,
    out: _Array,
) -> None:
    """Replace excess velocities by those of the least propellant, of n legs.

    Parameters
    ----------
    rv_dep, rv_arr : (n, 6) float64, m and m/s
        States of the bodies.
    tof_s, exhaust : (n,) float64, s and m/s
        Flight times and exhaust velocities.
    push : (n,) float64, m/s
        Impulse of the whole flight at full thrust and initial mass.
    bounds : (n, 2) float64, m/s
        Largest excess velocities at departure and arrival, inf allowed.
    beside : (n,) float64
        Turns beside the nearest number, of the path between the given ends; replaced by that of
        the path found.
    mu : float, m3/s2
        Gravitational parameter.
    excess : (n, 6) float64, m/s
        Excess velocities of the hint of m*; overwritten where a path is found.
    out : (n, 3) float64, m/s
        Receives the sums of impulses of the path of m* and of that from the cut Lambert arc, and
        what the bounds leave of the cheapest Lambert arc; 0 where there is none.
    """
    work = ends_workspace()
    _, ends, elements, _, _, v1, v2, over, _, _, _, best_ends = work
    axes, bound = np.empty((3, 3)), np.empty(SEGMENTS)
    s0, s1 = np.empty(6), np.empty(6)
    for leg in range(len(tof_s)):
        out[leg, :] = 0.0
        length = to_leg_frame(rv_dep[leg], rv_arr[leg], mu, axes, s0, s1)
        if not length > 0.0:
            continue
        speed = math.sqrt(mu / length)
        tof, ve = tof_s[leg] * speed / length, exhaust[leg] / speed
        most = push[leg] / speed / SEGMENTS
        dep, arr = bounds[leg, 0] / speed, bounds[leg, 1] / speed
        lambert(s0[:3], s1[:3], tof, MAX_REVS, 1.0, v1, v2)
        branch = cheapest_branch(s0, s1, dep, arr, work)
        if branch >= 0:
            out[leg, 2] = over[branch] * speed
        best = SATURATED
        turns_found = 0.0
        for start in range(2):
            turns, guess = 0.0, _TYPICAL_IMPULSE / SEGMENTS
            if start == 0:
                turns = beside[leg]
                for end in range(2):
                    for j in range(3):
                        u = 0.0
                        for k in range(3):
                            u += axes[j, k] * excess[leg, 3 * end + k]
                        ends[2 + end, j] = u / speed
            elif branch < 0 or over[branch] == 0.0:
                break
            else:
                guess = over[branch] / SEGMENTS
                cut_excess(v1[branch], s0, dep, ends[2])
                cut_excess(v2[branch], s1, arr, ends[3])
            total = follow(turns, guess, s0, s1, tof, ve, most, dep, arr, bound, work)
            if total < SATURATED:
                out[leg, start] = total * speed
            if total < best:
                best = total
                for j in range(3):
                    best_ends[0, j], best_ends[1, j] = ends[2, j], ends[3, j]
                difference = elements[1, 5] - elements[0, 5]
                difference -= 0.5 * tof * (elements[0, 0] + elements[1, 0])
                turns_found = np.rint(difference / _TWO_PI)
        if best < SATURATED:
            beside[leg] = turns_found
            for end in range(2):
                turn_back(axes, speed, best_ends[end], excess[leg, 3 * end : 3 * end + 3])
