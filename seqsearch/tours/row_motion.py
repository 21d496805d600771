"""Rows integrated anew with DOP853: from each to the next, and through all of a phase."""

import itertools
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from feasibility.constants import AU, DAY_S
from seqsearch.tours.trajectory import Phase

_Array = NDArray[np.float64]

_MOST_CALLS: Final = 20_000
"""Evaluations of the motion for one stretch of rows; days in the main belt take a hundred."""


class _TooLongError(Exception):
    """The motion was evaluated too often."""


@final
@dataclass(frozen=True, eq=False)
class RowMotion:
    """What came out beside the rows of a phase, n rows.

    Attributes
    ----------
    jump_km, jump_m_s : (n - 1,) array
        Distance, and difference of velocity, between the end of the motion from a row and the
        next row. NaN where the motion could not be integrated.
    end : (6,) array
        State at the last row's epoch, in m and m/s, flown from the first row on through the
        thrust of all others, whose states play no part.
    """

    jump_km: _Array
    jump_m_s: _Array
    end: _Array


def fly_rows(phase: Phase, isp_s: float, g0_m_s2: float, mu: float) -> RowMotion:
    """Integrate a phase.

    Parameters
    ----------
    phase : Phase
        The rows.
    isp_s, g0_m_s2 : float
        Mass flows at thrust over their product.
    mu : float
        Gravitational parameter of the Sun, m3/s2.
    """
    flow = np.linalg.norm(phase.thrust_n, axis=1) / (isp_s * g0_m_s2)
    dt = np.diff(phase.t_mjd2000) * DAY_S
    thrust, flow = phase.thrust_n[:-1], flow[:-1]
    side_by_side = _integrate(phase.states[:-1], phase.mass_kg[:-1], thrust, flow, dt, mu)
    jump = side_by_side - phase.states[1:]
    state, mass = phase.states[:1], phase.mass_kg[:1]
    for k in range(len(dt)):
        here = slice(k, k + 1)
        state = _integrate(state, mass, thrust[here], flow[here], dt[here], mu)
        mass = mass - flow[here] * dt[here]
    return RowMotion(
        jump_km=np.linalg.norm(jump[:, :3], axis=1) / 1e3,
        jump_m_s=np.linalg.norm(jump[:, 3:], axis=1),
        end=state[0],
    )


def _integrate(
    states: _Array, mass: _Array, thrust_n: _Array, flow_kg_s: _Array, dt_s: _Array, mu: float
) -> _Array:
    """Return (k, 6) states after their own times, of k motions side by side; NaN on failure.

    In units of AU and the matching velocity; each motion has its time as the unit of time.
    """
    if not dt_s.any():
        return states
    speed = np.sqrt(mu / AU)
    scale = np.array([AU, AU, AU, speed, speed, speed])
    time = (dt_s * speed / AU)[:, None]
    push = thrust_n * (AU / speed**2)
    burnt = flow_kg_s * dt_s
    calls = itertools.count()

    def motion(share: float, y: _Array) -> _Array:
        # Orbits through the Sun need steps without end, which no tour does.
        if next(calls) > _MOST_CALLS:
            raise _TooLongError
        x = y.reshape(-1, 6)
        place = x[:, :3]
        pull = place / np.linalg.norm(place, axis=1)[:, None] ** 3
        gain = push / (mass - burnt * share)[:, None] - pull
        rate: _Array = (np.concatenate([x[:, 3:], gain], axis=1) * time).ravel()
        return rate

    try:
        solution = solve_ivp(
            motion, (0.0, 1.0), (states / scale).ravel(), method="DOP853", rtol=1e-12, atol=1e-14
        )
    except _TooLongError:
        return np.full(states.shape, np.nan)
    if not solution.success:
        return np.full(states.shape, np.nan)
    end: _Array = solution.y[:, -1].reshape(-1, 6) * scale
    return end
