"""Two-body motion as the verification computes it: Kepler's equation by scipy, legs by DOP853."""

import itertools
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import newton
from scipy.spatial.transform import Rotation

from feasibility.constants import AU, DAY_S
from seqsearch.tours.records import TourBody, TourLeg

_MOST_CALLS: Final = 200_000
"""Evaluations of the motion for one coast; decades in the main belt take some thousands."""


class _TooLongError(Exception):
    """The motion was evaluated too often."""


def body_state(body: TourBody, t_mjd2000: float, mu: float) -> NDArray[np.float64]:
    """Return the (6,) state of a body in m and m/s, by Kepler's equation.

    Position and velocity in the perifocal frame (Vallado, "Fundamentals of
    Astrodynamics and Applications", algorithm 10) are turned by argument of
    perihelion, inclination and node.
    """
    mean_motion = np.sqrt(mu / body.a_m**3)
    anomaly = body.mean_anomaly_rad + mean_motion * (t_mjd2000 - body.epoch_mjd2000) * DAY_S
    anomaly = np.remainder(anomaly, 2 * np.pi)
    eccentric = newton(
        lambda x: x - body.e * np.sin(x) - anomaly,
        x0=anomaly if body.e < 0.8 else np.pi,
        fprime=lambda x: 1 - body.e * np.cos(x),
        tol=1e-15,
        maxiter=200,
    )
    minor = np.sqrt(1 - body.e**2)
    radius = body.a_m * (1 - body.e * np.cos(eccentric))
    position = body.a_m * np.array([np.cos(eccentric) - body.e, minor * np.sin(eccentric), 0.0])
    velocity = (mean_motion * body.a_m**2 / radius) * np.array(
        [-np.sin(eccentric), minor * np.cos(eccentric), 0.0]
    )
    # Intrinsic rotations about z, x, z take the ecliptic frame to the perifocal one.
    frame = Rotation.from_euler("ZXZ", [body.node_rad, body.i_rad, body.argp_rad])
    return np.concatenate([frame.apply(position), frame.apply(velocity)])


def departure_state(leg: TourLeg, body: TourBody, mu: float) -> NDArray[np.float64]:
    """Return the (6,) state in m and m/s of the body that a leg leaves, as the tour has it."""
    if leg.dep_body_state:
        return np.array(leg.dep_body_state)
    return body_state(body, leg.t_dep_mjd2000, mu)


def arrival_state(leg: TourLeg, body: TourBody, mu: float) -> NDArray[np.float64]:
    """Return the (6,) state in m and m/s of the body that a leg reaches, as the tour has it."""
    if leg.arr_body_state:
        return np.array(leg.arr_body_state)
    return body_state(body, leg.t_arr_mjd2000, mu)


def fly(leg: TourLeg, departure: TourBody, mu: float) -> NDArray[np.float64]:
    """Return the (6,) state in m and m/s at the end of a leg, integrated through all impulses.

    Parameters
    ----------
    leg : TourLeg
        The leg.
    departure : TourBody
        The body at which it begins.
    mu : float
        Gravitational parameter of the Sun, m3/s2.
    """
    return fly_from(leg, departure_state(leg, departure, mu), mu)


def fly_from(leg: TourLeg, departure: NDArray[np.float64], mu: float) -> NDArray[np.float64]:
    """Return what `fly` does, from the (6,) state of the body at which the leg begins."""
    state = departure.copy()
    state[3:] += leg.dep_velocity_m_s
    t = leg.t_dep_mjd2000
    for impulse in leg.impulses:
        state = coast(state, (impulse.t_mjd2000 - t) * DAY_S, mu)
        state[3:] += impulse.dv_m_s
        t = impulse.t_mjd2000
    return coast(state, (leg.t_arr_mjd2000 - t) * DAY_S, mu)


def coast(state: NDArray[np.float64], dt_s: float, mu: float) -> NDArray[np.float64]:
    """Integrate two-body motion with DOP853, in units of AU and the matching velocity.

    NaN where that takes too many steps.
    """
    speed = np.sqrt(mu / AU)
    scale = np.array([AU, AU, AU, speed, speed, speed])

    calls = itertools.count()

    def motion(_t: float, y: NDArray[np.float64]) -> NDArray[np.float64]:
        # Orbits through the Sun need steps without end, which no tour does.
        if next(calls) > _MOST_CALLS:
            raise _TooLongError
        r = y[:3]
        return np.concatenate([y[3:], -r / np.linalg.norm(r) ** 3])

    try:
        solution = solve_ivp(
            motion,
            (0.0, dt_s * speed / AU),
            state / scale,
            method="DOP853",
            rtol=1e-12,
            atol=1e-13,
        )
    except _TooLongError:
        return np.full(6, np.nan)
    end: NDArray[np.float64] = solution.y[:, -1] * scale
    return end if solution.success else np.full(6, np.nan)
