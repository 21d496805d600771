"""Legs with continuous thrust that several tests share."""

import numpy as np

from feasibility.constants import AU, DAY_S, G0, MU_SUN
from feasibility.continuous import ContinuousLeg
from feasibility.orbits.kepler_kernels import propagate_batch

EXHAUST = 3000.0 * G0
T_DEP = 8000.0


def kepler(state, t_mjd2000):
    """Return the motion of a body that is at a state at an epoch."""

    def motion(t):
        return propagate_batch(state[None], np.array([(t - t_mjd2000) * DAY_S]), MU_SUN)[0]

    return motion


def start_state():
    speed = np.sqrt(MU_SUN / (2.4 * AU))
    return np.array([2.4 * AU, 0.05 * AU, 0.0, -0.02 * speed, 1.02 * speed, 0.08 * speed])


def leg_to_nearby(days, change_m_s, thrust_n=0.3, m0_kg=1500.0):
    """Return a leg to where an impulse in the middle would lead, and that impulse's throttles.

    It takes `change_m_s`, a vector, so thrust has to be on for about m0 |change| / thrust.
    """
    middle = T_DEP + 0.5 * days
    state = kepler(start_state(), T_DEP)(middle)
    state[3:] += change_m_s
    leg = ContinuousLeg(
        departure=start_state(),
        target=kepler(state, middle),
        t_dep_mjd2000=T_DEP,
        m0_kg=m0_kg,
        thrust_n=thrust_n,
        exhaust_velocity_m_s=EXHAUST,
    )
    share = m0_kg * np.asarray(change_m_s) / (thrust_n * days * DAY_S)
    return leg, np.tile(share, (10, 1))


def leg_aside(days, speed_m_s, thrust_n=0.3, m0_kg=1500.0):
    """Return a leg to a body aside, which needs less propellant the longer it takes."""
    speed = np.array([0.6, 0.0, 0.8]) * speed_m_s
    state = start_state()
    state[3:] += speed
    state = kepler(state, T_DEP)(T_DEP + days)
    state[3:] -= speed
    leg = ContinuousLeg(
        departure=start_state(),
        target=kepler(state, T_DEP + days),
        t_dep_mjd2000=T_DEP,
        m0_kg=m0_kg,
        thrust_n=thrust_n,
        exhaust_velocity_m_s=EXHAUST,
    )
    share = 3.0 * m0_kg * speed / (thrust_n * days * DAY_S)
    throttles = np.zeros((9, 3))
    throttles[:3], throttles[-3:] = share, -share
    return leg, throttles / max(1.0, float(np.linalg.norm(share)))
