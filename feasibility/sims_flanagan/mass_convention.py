"""From throttles to the impulses that they stand for, in pykep's mass convention.

With s segments of dt = tof / s, an impulse at the centre of a segment is thrust x dt x
throttle / mass, with the mass *before* the impulse in the first s // 2 segments and the mass
*after* it in the others (pykep's ``leg.sims_flanagan``, cut 0.5). An impulse dv changes the
mass by the factor exp(-|dv| / exhaust velocity). Masses follow forward from the initial mass
and backward from the final one; the two meet at the match point within the mass mismatch.
"""

import numpy as np
from numpy.typing import NDArray

from feasibility.constants import DAY_S
from feasibility.errors import InputError
from feasibility.legs import Legs
from feasibility.sims_flanagan.solutions import LegSolutions

_Array = NDArray[np.float64]


def impulses(legs: Legs, solutions: LegSolutions) -> _Array:
    """Return the velocity change at the centre of each segment.

    Parameters
    ----------
    legs : Legs
        n legs.
    solutions : LegSolutions
        Their solutions, by any solver, of s segments.

    Returns
    -------
    (n, s, 3) float64, m/s
        Heliocentric frame, at the times (k + 1/2) tof / s; NaN where not converged.

    Raises
    ------
    InputError
        There are not as many solutions as legs.
    """
    if len(solutions) != len(legs):
        raise InputError(f"impulses: {len(solutions)} solutions for {len(legs)} legs")
    dv = np.full(solutions.throttles.shape, np.nan)
    rows = np.flatnonzero(solutions.m_final > 0.0)
    flown, solved = legs.take(rows), solutions.take(rows)
    dv[rows] = throttles_to_impulses(
        solved.throttles,
        solved.m0,
        solved.m_final,
        flown.thrust,
        flown.exhaust_velocity,
        flown.tof_days,
    )
    return dv


def throttles_to_impulses(
    throttles: _Array,
    m0: _Array,
    m_final: _Array,
    thrust: _Array,
    exhaust_velocity: _Array,
    tof_days: _Array,
) -> _Array:
    """Return the velocity changes of given throttles.

    Parameters
    ----------
    throttles : (n, s, 3) float64
        Throttle vectors.
    m0, m_final : (n,) float64, kg
        Initial and final masses.
    thrust, exhaust_velocity, tof_days : (n,) float64
        Thrust in N, exhaust velocity in m/s and flight time in days.

    Returns
    -------
    (n, s, 3) float64, m/s
        In the frame of the throttles.
    """
    before, after = segment_masses(throttles, m0, m_final, thrust, exhaust_velocity, tof_days)
    n_segments = throttles.shape[1]
    acting = np.where(np.arange(n_segments) < n_segments // 2, before, after)
    push = thrust * tof_days / n_segments * DAY_S
    dv: _Array = throttles * (push[:, None] / acting)[:, :, None]
    return dv


def segment_masses(
    throttles: _Array,
    m0: _Array,
    m_final: _Array,
    thrust: _Array,
    exhaust_velocity: _Array,
    tof_days: _Array,
) -> tuple[_Array, _Array]:
    """Return the masses before and after each impulse.

    Parameters
    ----------
    throttles, m0, m_final, thrust, exhaust_velocity, tof_days
        As for `throttles_to_impulses`.

    Returns
    -------
    before, after : (n, s) float64, kg
        Forward from the initial mass in the first s // 2 segments, backward from the final
        mass in the others.
    """
    n_segments = throttles.shape[1]
    forward = n_segments // 2
    push = thrust * tof_days / n_segments * DAY_S
    norms = np.linalg.norm(throttles, axis=2)
    before, after = np.empty(norms.shape), np.empty(norms.shape)
    mass = m0
    for k in range(forward):
        before[:, k] = mass
        mass = mass * np.exp(-push * norms[:, k] / mass / exhaust_velocity)
        after[:, k] = mass
    mass = m_final
    for k in range(n_segments - 1, forward - 1, -1):
        after[:, k] = mass
        mass = mass * np.exp(push * norms[:, k] / mass / exhaust_velocity)
        before[:, k] = mass
    return before, after
