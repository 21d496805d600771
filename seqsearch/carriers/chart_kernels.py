"""A beam of predicted legs over a chart: everything is looked up, nothing is solved.

With n bodies, intervals of epochs, and q flight times. A curve is log(m*) in kg over the
logarithm of the flight time; between its q points, and between the two ends of an interval of
epochs, it is linear. So are the velocity changes of Lambert arcs. Both are stored as integers of
16 bits.
"""

import math

import numpy as np
from numpy.typing import NDArray

from feasibility.runtime.jit import inner_kernel, kernel

_Codes = NDArray[np.uint16]
_Array = NDArray[np.float64]
_Index = NDArray[np.int32]

Chart = tuple[NDArray[np.int64], _Index, _Codes, _Codes, _Array]
"""Offsets, targets, m*, velocity changes, logarithms of flight times, as `LegChart` has them."""

Grid = tuple[float, float, int]
"""Where the first interval begins, how long each is, how many there are."""

Home = tuple[int, _Index, _Codes, _Codes, _Array]
"""First interval, index, m*, velocity changes and logarithms of flight times of `Ways`."""

Craft = tuple[float, float, float, float, float]
"""Dry and first mass (kg), thrust (N), exhaust velocity (m/s), reserve in log(m*)."""

BURN_A = 4.18
BURN_B = 0.82
"""Of `feasibility.classifier.predictor.bounded_final_mass`."""

LOG_MASS_LOW = 5.0
LOG_MASS_UNIT = 6.0 / 65535.0
SPEED_UNIT = 0.2
"""log(m*/kg) and m/s of codes: the first is LOG_MASS_LOW + LOG_MASS_UNIT times the code."""

HOME_TRIALS = 6
HOME_STRETCH = 0.12
"""Flights to the end that are tried: by how much each is longer, in the logarithm."""

NEVER = 1e9
_LEAST = 1e-6


@inner_kernel
def _on(values: _Codes, share: float, q: int) -> float:
    """Return a code between the two ends of an interval of epochs."""
    return float(values[0, q]) * (1.0 - share) + float(values[1, q]) * share


@kernel
def shortest_flight(values: _Codes, share: float, log_tof: _Array, level: float) -> float:
    """Return the logarithm of the flight time at which a curve reaches a level; NEVER for none."""
    code = (level - LOG_MASS_LOW) / LOG_MASS_UNIT
    before = _on(values, share, 0)
    if before >= code:
        first: float = log_tof[0]
        return first
    for q in range(1, len(log_tof)):
        here = _on(values, share, q)
        if here >= code:
            part = (code - before) / (here - before)
            found: float = log_tof[q - 1] + part * (log_tof[q] - log_tof[q - 1])
            return found
        before = here
    return NEVER


@kernel
def value_at(values: _Codes, share: float, log_tof: _Array, at: float) -> float:
    """Return the code of a curve at the logarithm of a flight time, held at its ends."""
    last = len(log_tof) - 1
    if at <= log_tof[0]:
        return _on(values, share, 0)
    for q in range(1, last + 1):
        if at <= log_tof[q]:
            part = (at - log_tof[q - 1]) / (log_tof[q] - log_tof[q - 1])
            before = _on(values, share, q - 1)
            found: float = before + part * (_on(values, share, q) - before)
            return found
    return _on(values, share, last)


@kernel
def mass_after(
    mass: float, m_code: float, v_code: float, tof_s: float, thrust: float, exhaust: float
) -> float:
    """Return the mass at arrival, as `bounded_final_mass` estimates it."""
    log_m_star = LOG_MASS_LOW + LOG_MASS_UNIT * m_code
    delta_v = SPEED_UNIT * v_code
    beyond = max(math.exp(log_m_star) / mass - 1.0, 0.0)
    most = thrust / exhaust * tof_s / (1.0 + beyond)
    least = min(mass * (1.0 - math.exp(-delta_v / exhaust)), most)
    more: float = (most - least) / (1.0 + BURN_A * beyond**BURN_B)
    return mass - least - more


@inner_kernel
def home_days(
    ready: float, mass: float, row: int, left: float, grid: Grid, home: Home, craft: Craft
) -> float:
    """Return the shortest flight to the end; NEVER where there is none."""
    t0, step, _ = grid
    first, index, m_star, delta_v, log_tof = home
    m_dry, _, thrust, exhaust, reserve = craft
    place = (ready - t0) / step
    k = math.floor(place) - first
    if k < 0 or k >= index.shape[0]:
        return NEVER
    h = index[k, row]
    if h < 0:
        return NEVER
    share = place - math.floor(place)
    least = shortest_flight(m_star[h], share, log_tof, math.log(mass) + reserve)
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
            value_at(m_star[h], share, log_tof, at),
            value_at(delta_v[h], share, log_tof, at),
            days * 86400.0,
            thrust,
            exhaust,
        )
        if after >= m_dry:
            return days
        if at >= last:
            break
    return NEVER


@inner_kernel
def _is_among(bodies: _Index, body: int) -> bool:
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
    bodies. `limits` are the longest duration, the stay, the longest flight (days), and the shares
    of the duration after which a way home is looked for, and has to be there. `weights` are those
    of the propellant and of the distance from the end, which `distance` has from an interval on.
    `out` gets rows, parents, arrivals, masses, scores
    and durations of tours that go to the end from there.
    """
    row, ready, first, mass = nodes
    offsets, target, m_star, delta_v, log_tof = chart
    t0, step, intervals = grid
    duration, stay, longest, homeward, must = limits
    m_dry, m_first, thrust, exhaust, reserve = craft
    w_mass, w_distance = weights
    out_row, out_parent, out_arrival, out_mass, out_score, out_home = out
    total = 1.0 + w_mass
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
            if closed[j] or _is_among(own[i], j):
                continue
            least = shortest_flight(m_star[p], share, log_tof, level)
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
                    value_at(m_star[p], share, log_tof, at),
                    value_at(delta_v[p], share, log_tof, at),
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
                    days = home_days(arrival + stay, after, j, left, grid, home, craft)
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
