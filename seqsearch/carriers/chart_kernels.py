"""A beam of predicted legs over a chart: everything is looked up, nothing is solved.

With n bodies, intervals of epochs, and q flight times. Curves are those of
`seqsearch.chart.curve_kernels`: what is stored is 1/m* and the velocity change of the Lambert arc,
at three departures of an interval.
"""

import math

import numpy as np
from numpy.typing import NDArray

from feasibility.runtime.jit import inner_kernel, kernel
from seqsearch.chart.curve_kernels import (
    NEVER,
    Work,
    is_among,
    looked_up,
    mass_after,
    value_at,
)

_Codes = NDArray[np.uint16]
_Array = NDArray[np.float64]
_Index = NDArray[np.int32]

Chart = tuple[NDArray[np.int64], _Index, _Codes, _Codes, _Array]
"""Offsets, targets, 1/m*, velocity changes, logarithms of flight times, as `LegChart` has them."""

Grid = tuple[float, float, int]
"""Where the first interval begins, how long each is, how many there are."""

Home = tuple[int, _Index, _Codes, _Codes, _Array]
"""First interval, index, 1/m*, velocity changes and logarithms of flight times of `Ways`."""

Craft = tuple[float, float, float, float, float]
"""Dry and first mass (kg), thrust (N), exhaust velocity (m/s), reserve in log(m*)."""

HOME_TRIALS = 6
HOME_STRETCH = 0.12
"""Flights to the end that are tried: by how much each is longer, in the logarithm."""

_LEAST = 1e-6


@inner_kernel
def home_days(
    there: tuple[float, float, float],
    row: int,
    grid: Grid,
    home: Home,
    units: tuple[float, float],
    craft: Craft,
    work: Work,
) -> float:
    """Return the shortest flight to the end; NEVER where there is none.

    `there` are the epoch from which it may begin, the mass, and the days that are left.
    """
    ready, mass, left = there
    t0, step, _ = grid
    first, index, inverse, speed, log_tof = home
    m_dry, _, thrust, exhaust, reserve = craft
    place = (ready - t0) / step
    k = math.floor(place) - first
    if k < 0 or k >= index.shape[0]:
        return NEVER
    h = index[k, row]
    if h < 0:
        return NEVER
    share = place - math.floor(place)
    level = math.log(mass) + reserve
    least = looked_up(inverse[h], speed[h], share, units, log_tof, level, work)
    if least >= NEVER:
        return NEVER
    last = min(math.log(max(left, 1.0)), log_tof[-1])
    # Longer flights burn less.
    for trial in range(HOME_TRIALS):
        at = least + HOME_STRETCH * trial
        if at > last:
            at = last
        if at < least:
            return NEVER
        days = math.exp(at)
        after = mass_after(
            mass,
            value_at(log_tof, work[0], at, work[2]),
            value_at(log_tof, work[1], at, work[2]),
            days * 86400.0,
            thrust,
            exhaust,
        )
        if after >= m_dry:
            return days
        if at >= last:
            break
    return NEVER


@kernel
def expand(
    nodes: tuple[_Index, _Array, _Array, _Array],
    own: _Index,
    closed: NDArray[np.bool_],
    chart: Chart,
    units: tuple[float, float],
    grid: Grid,
    home: Home,
    distance: tuple[int, NDArray[np.float32]],
    stretches: _Array,
    limits: tuple[float, float, float, float, float],
    craft: Craft,
    weights: tuple[float, float],
    out: tuple[_Index, _Index, _Array, _Array, _Array, _Array],
) -> int:
    """Write all children of a rank and return how many; as many as there is room for.

    `nodes` are rows, epochs from which they are ready, first departures and masses; `own` their
    bodies. `units` are those of 1/m* and of velocity changes. `limits` are the longest duration,
    the stay, the longest flight (days), and the shares of the duration after which a way home is
    looked for, and has to be there. `weights` are those of the propellant and of the distance from
    the end, which `distance` has from an interval on. `out` gets rows, parents, arrivals, masses,
    scores and durations of tours that go to the end from there.
    """
    row, ready, first, mass = nodes
    offsets, target, inverse, speed, log_tof = chart
    t0, step, intervals = grid
    duration, stay, longest, homeward, must = limits
    m_dry, m_first, thrust, exhaust, reserve = craft
    w_mass, w_distance = weights
    out_row, out_parent, out_arrival, out_mass, out_score, out_home = out
    total = 1.0 + w_mass
    work = np.empty(len(log_tof)), np.empty(len(log_tof)), np.empty(4)
    home_work = np.empty(len(home[4])), np.empty(len(home[4])), np.empty(4)
    count = 0
    for i in range(len(row)):
        place = (ready[i] - t0) / step
        k = math.floor(place)
        if k < 0 or k >= intervals:
            continue
        share = place - k
        base = k * len(closed) + row[i]
        end_k = round((first[i] + duration - t0) / step) - distance[0]
        end_k = min(max(end_k, 0), distance[1].shape[0] - 1)
        level = math.log(mass[i]) + reserve
        for p in range(offsets[base], offsets[base + 1]):
            j = target[p]
            if closed[j] or is_among(own[i], j):
                continue
            least = looked_up(inverse[p], speed[p], share, units, log_tof, level, work)
            if least >= NEVER:
                continue
            for stretch in stretches:
                at = least + stretch
                if at > log_tof[-1]:
                    break
                tof = math.exp(at)
                arrival = ready[i] + tof
                elapsed = arrival - first[i]
                if tof > longest or elapsed + stay > duration:
                    break
                after = mass_after(
                    mass[i],
                    value_at(log_tof, work[0], at, work[2]),
                    value_at(log_tof, work[1], at, work[2]),
                    tof * 86400.0,
                    thrust,
                    exhaust,
                )
                if after <= m_dry:
                    continue
                part = elapsed / duration
                days = NEVER
                if part > homeward:
                    left = duration - elapsed - stay
                    there = arrival + stay, after, left
                    days = home_days(there, j, grid, home, units, craft, home_work)
                    if days > left and part > must:
                        continue
                time_left = max(1.0 - part, _LEAST)
                mass_left = max((after - m_dry) / (m_first - m_dry), _LEAST)
                score = total - total * total / (1.0 / time_left + w_mass / mass_left)
                score += w_distance * part * part * float(distance[1][end_k, j])
                if count == len(out_row):
                    return count
                out_row[count], out_parent[count] = j, i
                out_arrival[count], out_mass[count] = arrival, after
                out_score[count], out_home[count] = score, elapsed + stay + days
                count += 1
    return count
