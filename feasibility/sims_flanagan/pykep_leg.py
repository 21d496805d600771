"""pykep's Sims-Flanagan leg in scaled units: the model every solution is confirmed with.

Lengths are in AU, velocities in `constants.EARTH_VELOCITY`, so the
gravitational parameter is 1; the mass unit is the caller's choice.

The mass convention is pykep's: with the cut at one half, the impulse of a
segment in the forward half is thrust * dt * throttle over the mass before the
impulse, in the backward half over the mass after it; each impulse changes the
mass by the factor exp(-dv / exhaust velocity).
"""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from feasibility.constants import AU, EARTH_VELOCITY
from feasibility.legs import Legs
from feasibility.runtime.pykep_guard import load_pykep

TIME_UNIT_S: Final = AU / EARTH_VELOCITY
"""Time unit of scaled legs in seconds: a year at 1 AU is 2 pi of them."""

CUT: Final = 0.5
"""Share of the segments that are propagated forward."""

N_SEGMENTS: Final = 20
"""Segments of a leg unless the caller asks for another number."""


def scaled_leg(legs: Legs, row: int, mass_unit: float, n_segments: int = N_SEGMENTS) -> Any:
    """Return one leg as ``pykep.leg.sims_flanagan`` with zero throttles and unit masses.

    Parameters
    ----------
    legs : Legs
        The legs.
    row : int
        Which of them.
    mass_unit : float
        Mass unit of the scaled leg in kg.
    n_segments : int
        Number of segments, s.

    Returns
    -------
    pykep.leg.sims_flanagan
        In AU, Earth velocity, `mass_unit`; ``ms`` and ``mf`` are 1.
    """
    force_unit = mass_unit * EARTH_VELOCITY / TIME_UNIT_S
    return load_pykep().leg.sims_flanagan(
        rvs=_scaled_state(legs.rv_dep[row]),
        ms=1.0,
        throttles=[0.0] * (3 * n_segments),
        rvf=_scaled_state(legs.rv_arr[row]),
        mf=1.0,
        tof=float(legs.tof_s[row]) / TIME_UNIT_S,
        max_thrust=float(legs.thrust[row]) / force_unit,
        veff=float(legs.exhaust_velocity[row]) / EARTH_VELOCITY,
        mu=1.0,
        cut=CUT,
    )


def confirm(
    legs: Legs,
    throttles: NDArray[np.float64],
    m0: NDArray[np.float64],
    m_final: NDArray[np.float64],
    dep_excess: NDArray[np.float64] | None = None,
    arr_excess: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Return the mismatch of given solutions, by pykep's own leg.

    Parameters
    ----------
    legs : Legs
        n legs; their own ``m0`` is not used.
    throttles : (n, s, 3) float64
        Throttle vectors.
    m0, m_final : (n,) float64, kg
        Initial and final masses; both inf for a leg without thrust, which any mass can fly.
    dep_excess, arr_excess : (n, 3) float64, m/s, optional
        Velocities relative to the bodies; zero unless given.

    Returns
    -------
    (n,) float64
        Largest absolute mismatch in units of AU, Earth velocity and the row's
        `m0`; inf where throttles or masses are not finite or not positive.
    """
    mismatch = np.full(len(legs), np.inf)
    usable = np.isfinite(throttles).all(axis=(1, 2)) & (m0 > 0) & (m_final > 0)
    thrustless = usable & np.isinf(m0) & np.isinf(m_final) & ~throttles.any(axis=(1, 2))
    usable &= (np.isfinite(m0) & np.isfinite(m_final)) | thrustless
    for excess in (dep_excess, arr_excess):
        if excess is not None:
            usable &= np.isfinite(excess).all(axis=1)
    for row in np.flatnonzero(usable):
        mass = 1.0 if thrustless[row] else float(m0[row])
        leg = scaled_leg(legs, int(row), mass, throttles.shape[1])
        if not thrustless[row]:
            leg.mf = float(m_final[row] / m0[row])
        set_excess(leg, legs, int(row), dep_excess, arr_excess)
        leg.throttles = throttles[row].ravel().tolist()
        worst = float(np.abs(leg.compute_mismatch_constraints()).max())
        mismatch[row] = worst if np.isfinite(worst) else np.inf
    return mismatch


def set_excess(
    leg: Any,
    legs: Legs,
    row: int,
    dep_excess: NDArray[np.float64] | None,
    arr_excess: NDArray[np.float64] | None,
) -> None:
    """Give a scaled leg the excess velocities (n, 3) m/s of its row, where there are any."""
    if dep_excess is not None and dep_excess[row].any():
        leg.rvs = _scaled_state(with_excess(legs.rv_dep[row], dep_excess[row]))
    if arr_excess is not None and arr_excess[row].any():
        leg.rvf = _scaled_state(with_excess(legs.rv_arr[row], arr_excess[row]))


def with_excess(rv: NDArray[np.float64], excess: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return states (..., 6) whose velocities have an excess (..., 3) added."""
    state = rv.copy()
    state[..., 3:] += excess
    return state


def _scaled_state(rv: NDArray[np.float64]) -> list[list[float]]:
    return [(rv[:3] / AU).tolist(), (rv[3:] / EARTH_VELOCITY).tolist()]
