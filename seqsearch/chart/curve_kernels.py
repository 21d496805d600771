"""Kernels of beams over a `CurveChart`: everything is looked up, nothing is solved.

Over the departure epoch the squares of 1/m* and of velocity changes are parabolas through three
points. Over the logarithm of the flight time, log(m*) and velocity changes are cubics through the
four nearest points.
"""

import math

import numpy as np
from numpy.typing import NDArray

from feasibility.runtime.jit import inner_kernel, kernel

_Codes = NDArray[np.uint16]
_Array = NDArray[np.float64]
_Index = NDArray[np.int32]

Chart = tuple[NDArray[np.int64], _Index, _Codes, _Codes, _Array]
"""Offsets, targets, 1/m*, velocity changes, logarithms of flight times, as `CurveChart` has
them."""

Grid = tuple[float, float, int]
"""Where the first interval begins, how long each is, how many there are."""

Craft = tuple[float, float, float, float, float]
"""Least and first mass (kg), thrust (N), exhaust velocity (m/s), reserve in log(m*)."""

Work = tuple[_Array, _Array, _Array]
"""Room for both curves of a leg, and for four differences."""

BURN_A = 4.18
BURN_B = 0.82
"""Of `feasibility.classifier.predictor.bounded_final_mass`."""

NEVER = 1e9
_LEAST = 1e-6
_LEAST_SQUARE = 0.05
_ROOT_STEPS = 8
_ROOT_ERROR = 2e-4
"""Least share of the smallest of three squares that a parabola may reach; how precisely the
shortest flight is found."""


@kernel
def squares(codes: _Codes, share: float, unit: float, out: _Array) -> None:
    """Write the squares of a pair's values at a share of the interval."""
    first = 2.0 * (share - 0.5) * (share - 1.0)
    middle = 4.0 * share * (1.0 - share)
    last = 2.0 * share * (share - 0.5)
    for q in range(codes.shape[1]):
        a, b, c = float(codes[0, q]), float(codes[1, q]), float(codes[2, q])
        a, b, c = a * a, b * b, c * c
        least = max(_LEAST_SQUARE * min(a, b, c), 1.0)
        out[q] = max(first * a + middle * b + last * c, least) * unit * unit


@inner_kernel
def _differences(x: _Array, y: _Array, k: int, out: _Array) -> None:
    """Write Newton's divided differences of four points from k on."""
    a = (y[k + 1] - y[k]) / (x[k + 1] - x[k])
    b = (y[k + 2] - y[k + 1]) / (x[k + 2] - x[k + 1])
    c = (y[k + 3] - y[k + 2]) / (x[k + 3] - x[k + 2])
    ab, bc = (b - a) / (x[k + 2] - x[k]), (c - b) / (x[k + 3] - x[k + 1])
    out[0], out[1], out[2] = y[k], a, ab
    out[3] = (bc - ab) / (x[k + 3] - x[k])


@inner_kernel
def _cubic(x: _Array, d: _Array, k: int, at: float) -> float:
    """Return the value of a cubic, given by its divided differences."""
    inner: float = d[1] + (at - x[k + 1]) * (d[2] + (at - x[k + 2]) * d[3])
    value: float = d[0] + (at - x[k]) * inner
    return value


@kernel
def value_at(x: _Array, y: _Array, at: float, work: _Array) -> float:
    """Return a curve of four or more points at the logarithm of a flight time."""
    k = 0
    while k < len(x) - 4 and at >= x[k + 2]:
        k += 1
    _differences(x, y, k, work)
    return _cubic(x, work, k, at)


@kernel
def shortest_flight(x: _Array, y: _Array, level: float, work: _Array) -> float:
    """Return the logarithm of the flight time at which a curve reaches a level; NEVER for none."""
    if y[0] >= level:
        first: float = x[0]
        return first
    for q in range(1, len(x)):
        if y[q] < level:
            continue
        k = min(max(q - 2, 0), len(x) - 4)
        _differences(x, y, k, work)
        low, high = x[q - 1], x[q]
        below, above = y[q - 1] - level, y[q] - level
        at: float = high
        for _ in range(_ROOT_STEPS):
            at = low - below * (high - low) / (above - below)
            here = _cubic(x, work, k, at) - level
            if abs(here) < _ROOT_ERROR:
                break
            if here < 0.0:
                low, below = at, here
            else:
                high, above = at, here
        return at
    return NEVER


@inner_kernel
def looked_up(
    inverse: _Codes,
    speed: _Codes,
    share: float,
    units: tuple[float, float],
    x: _Array,
    level: float,
    work: Work,
) -> float:
    """Write both curves of a leg; return its shortest flight for a log(m*), NEVER for none."""
    y, v, differences = work
    squares(inverse, share, units[0], y)
    if y.min() > math.exp(-2.0 * level):
        return NEVER
    for q in range(len(x)):
        y[q] = -0.5 * math.log(y[q])
    shortest: float = shortest_flight(x, y, level, differences)
    if shortest < NEVER:
        squares(speed, share, units[1], v)
        for q in range(len(x)):
            v[q] = math.sqrt(v[q])
    return shortest


@kernel
def mass_after(
    mass: float, log_m_star: float, delta_v: float, tof_s: float, thrust: float, exhaust: float
) -> float:
    """Return the mass at arrival, as `bounded_final_mass` estimates it."""
    beyond = max(math.exp(log_m_star) / mass - 1.0, 0.0)
    most = thrust / exhaust * tof_s / (1.0 + beyond)
    least = min(mass * (1.0 - math.exp(-max(delta_v, 0.0) / exhaust)), most)
    more: float = (most - least) / (1.0 + BURN_A * beyond**BURN_B)
    return mass - least - more


@inner_kernel
def is_among(bodies: _Index, body: int) -> bool:
    """Tell whether a body is one of some."""
    for other in bodies:  # noqa: SIM110 (numba has no generators here)
        if other == body:
            return True
    return False


@kernel
def expand(
    nodes: tuple[_Index, _Array, _Array, _Array],
    own: _Index,
    closed: NDArray[np.bool_],
    chart: Chart,
    units: tuple[float, float],
    grid: Grid,
    stretches: _Array,
    limits: tuple[float, float],
    craft: Craft,
    w_mass: float,
    out: tuple[_Index, _Index, _Array, _Array, _Array],
) -> int:
    """Write all children of a rank and return how many; as many as there is room for.

    `nodes` are rows, epochs from which they are ready, first departures and masses; `own` their
    bodies. `units` are those of 1/m* and of velocity changes, `limits` the longest duration and
    the longest flight in days. `out` gets rows, parents, arrivals, masses and scores.
    """
    row, ready, first, mass = nodes
    offsets, target, inverse, speed, x = chart
    t0, step, intervals = grid
    duration, longest = limits
    m_least, m_first, thrust, exhaust, reserve = craft
    out_row, out_parent, out_arrival, out_mass, out_score = out
    total = 1.0 + w_mass
    work = np.empty(len(x)), np.empty(len(x)), np.empty(4)
    count = 0
    for i in range(len(row)):
        place = (ready[i] - t0) / step
        k = math.floor(place)
        if k < 0 or k >= intervals:
            continue
        base = k * len(closed) + row[i]
        level = math.log(mass[i]) + reserve
        for p in range(offsets[base], offsets[base + 1]):
            j = target[p]
            if closed[j] or is_among(own[i], j):
                continue
            shortest = looked_up(inverse[p], speed[p], place - k, units, x, level, work)
            if shortest == NEVER:
                continue
            for stretch in stretches:
                at = shortest + stretch
                tof = math.exp(at)
                arrival = ready[i] + tof
                elapsed = arrival - first[i]
                if at > x[-1] or tof > longest or elapsed > duration:
                    break
                after = mass_after(
                    mass[i],
                    value_at(x, work[0], at, work[2]),
                    value_at(x, work[1], at, work[2]),
                    tof * 86400.0,
                    thrust,
                    exhaust,
                )
                if after <= m_least:
                    continue
                if count == len(out_row):
                    return count
                time_left = max(1.0 - elapsed / duration, _LEAST)
                mass_left = max((after - m_least) / (m_first - m_least), _LEAST)
                out_row[count], out_parent[count] = j, i
                out_arrival[count], out_mass[count] = arrival, after
                out_score[count] = total - total * total / (1.0 / time_left + w_mass / mass_left)
                count += 1
    return count
