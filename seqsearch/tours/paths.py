"""Where things are: bodies on their orbits, and a tour between its impulses."""

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from feasibility.constants import DAY_S
from feasibility.errors import InputError
from feasibility.orbits.classical import classical_to_cartesian, perifocal_axes
from seqsearch.tours.labels import body_label
from seqsearch.tours.motion import departure_state
from seqsearch.tours.records import TourBody, TourLeg
from seqsearch.tours.tour import Tour
from seqsearch.tours.trajectory import Phase, Trajectory

_ROW_ERROR_M: Final = 100.0
_LEAST_STEP_DAYS: Final = 1e-2
"""Orbits through the Sun would have rows without end."""


def body_states(body: TourBody, t_mjd2000: ArrayLike, mu: float) -> NDArray[np.float64]:
    """Return the states of a body at many epochs, by Kepler's equation.

    Parameters
    ----------
    body : TourBody
        The body.
    t_mjd2000 : array_like
        (n,) epochs.
    mu : float
        Gravitational parameter of the Sun, m3/s2.

    Returns
    -------
    (n, 6) float64
        m and m/s, in the frame of the elements.
    """
    epochs = np.asarray(t_mjd2000, dtype=np.float64)
    mean_motion = np.sqrt(mu / body.a_m**3)
    anomaly = body.mean_anomaly_rad + mean_motion * (epochs - body.epoch_mjd2000) * DAY_S
    elements = np.tile(_elements(body), (len(epochs), 1))
    elements[:, 5] = np.remainder(anomaly, 2 * np.pi)
    return classical_to_cartesian(elements, mu)


def orbit_points(body: TourBody, n: int = 128) -> NDArray[np.float64]:
    """Return (n, 3) points in m once around a body's orbit, the last equal to the first."""
    semi_major, semi_minor = perifocal_axes(_elements(body))
    anomaly = np.linspace(0.0, 2 * np.pi, n)
    return np.outer(np.cos(anomaly) - body.e, semi_major) + np.outer(np.sin(anomaly), semi_minor)


def _elements(body: TourBody) -> NDArray[np.float64]:
    return np.array(
        [body.a_m, body.e, body.i_rad, body.node_rad, body.argp_rad, body.mean_anomaly_rad]
    )


def epochs_between(begin: float, end: float, step_days: float) -> NDArray[np.float64]:
    """Return (n,) epochs from `begin` to `end`, at most a step apart."""
    return np.linspace(begin, end, 1 + max(1, int(np.ceil((end - begin) / step_days))))


def row_step_days(state: NDArray[np.float64], mu: float) -> float:
    """Return how far apart rows may be for cubic interpolation to be good to 100 m, at most a day.

    Parameters
    ----------
    state : (6,) float64
        m and m/s; rows are as close as they have to be where its orbit is nearest to the Sun.
    mu : float
        Gravitational parameter of the Sun, m3/s2.
    """
    # Hermite's error is h^4 / 384 of the fourth derivative, which is mu^2 / r^5 on a circle.
    momentum = float(np.linalg.norm(np.cross(state[:3], state[3:])))
    energy = 0.5 * float(state[3:] @ state[3:]) - mu / float(np.linalg.norm(state[:3]))
    e = np.sqrt(max(0.0, 1.0 + 2.0 * energy * (momentum / mu) ** 2))
    perihelion = momentum**2 / mu / (1.0 + e)
    step_s = (384.0 * _ROW_ERROR_M * perihelion**5 / mu**2) ** 0.25
    return float(np.clip(step_s / DAY_S, _LEAST_STEP_DAYS, 1.0))


def impulsive_trajectory(tour: Tour, step_days: float = 1.0) -> Trajectory:
    """Return the rows of a tour as its legs state it: Kepler arcs between impulses.

    Parameters
    ----------
    tour : Tour
        At least one leg.
    step_days : float
        Longest time between rows; it is less near the Sun. At an impulse there are two rows of
        one epoch.

    Raises
    ------
    InputError
        The tour has no leg, or a leg does not fly (numbers that are not finite).
    """
    if not tour.legs:
        raise InputError("the tour has no leg, so there is no trajectory yet")
    phases = tuple(_phase(tour, leg, step_days) for leg in tour.legs)
    return Trajectory(phases, continuous=False)


def _phase(tour: Tour, leg: TourLeg, step_days: float) -> Phase:
    # Imported here: compiled kernels take a moment to load.
    from feasibility.orbits.kepler_kernels import propagate_batch

    mu = tour.rules.mu_m3_s2
    state = departure_state(leg, tour.body(leg.from_id), mu)
    state[3:] += leg.dep_velocity_m_s
    stops = [leg.t_dep_mjd2000, *(i.t_mjd2000 for i in leg.impulses), leg.t_arr_mjd2000]
    jumps = [*(np.asarray(impulse.dv_m_s) for impulse in leg.impulses), np.zeros(3)]
    masses = [leg.m0_kg, *(impulse.mass_after_kg for impulse in leg.impulses)]
    epochs, states, mass = [], [], []
    for begin, end, jump, kg in zip(stops, stops[1:], jumps, masses, strict=False):
        times = epochs_between(begin, end, min(step_days, row_step_days(state, mu)))
        n = len(times)
        arc = propagate_batch(np.repeat(state[None], n, axis=0), (times - begin) * DAY_S, mu)
        epochs.append(times)
        states.append(arc)
        mass.append(np.full(n, kg))
        state = arc[-1].copy()
        state[3:] += jump
    n_rows = sum(map(len, epochs))
    return Phase(
        body_label(tour, leg.from_id),
        body_label(tour, leg.to_id),
        np.concatenate(epochs),
        np.concatenate(states),
        np.concatenate(mass),
        np.zeros((n_rows, 3)),
    )
