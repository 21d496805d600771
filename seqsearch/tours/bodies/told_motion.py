"""Bodies of a tour between the epochs at which the tour itself says where they are."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from feasibility.constants import DAY_S
from seqsearch.tours.paths import body_states
from seqsearch.tours.records import State, TourBody
from seqsearch.tours.tour import Tour

_Array = NDArray[np.float64]


def motion_of(tour: Tour, body: TourBody, t_mjd2000: ArrayLike) -> _Array:
    """Return the states of a body of a tour at many epochs.

    Where the tour's bodies move as kernels say, the tour has their states at departures and
    arrivals alone. They are met exactly; in between, the Kepler orbits through the two nearest
    ones are blended, which is good to some 100 km over a stay.

    Parameters
    ----------
    tour : Tour
        The tour.
    body : TourBody
        One of its bodies.
    t_mjd2000 : array_like
        (n,) epochs.

    Returns
    -------
    (n, 6) float64
        m and m/s, in the frame of the elements.
    """
    epochs = np.asarray(t_mjd2000, dtype=np.float64)
    told = _told(tour, body)
    if not told:
        return body_states(body, epochs, tour.rules.mu_m3_s2)
    times = np.array(sorted(told))
    states = np.array([told[t] for t in times])
    after = np.searchsorted(times, epochs)
    before = np.clip(after - 1, 0, len(times) - 1)
    after = np.clip(after, 0, len(times) - 1)
    span = times[after] - times[before]
    share = np.where(span > 0.0, (epochs - times[before]) / np.where(span > 0.0, span, 1.0), 0.0)
    # Smooth at both ends, so that positions and velocities belong together there.
    weight = (share * share * (3.0 - 2.0 * share))[:, None]
    mu = tour.rules.mu_m3_s2
    earlier = _moved(states[before], epochs - times[before], mu)
    later = _moved(states[after], epochs - times[after], mu)
    result: _Array = (1.0 - weight) * earlier + weight * later
    slope = np.where(span > 0.0, 6.0 * share * (1.0 - share) / np.where(span > 0.0, span, 1.0), 0)
    result[:, 3:] += (slope / DAY_S)[:, None] * (later - earlier)[:, :3]
    return result


def _told(tour: Tour, body: TourBody) -> dict[float, State]:
    """Return the states of a body that the tour has, by epoch."""
    told: dict[float, State] = {}
    for leg in tour.legs:
        if leg.from_id == body.id and leg.dep_body_state:
            told[leg.t_dep_mjd2000] = leg.dep_body_state
        if leg.to_id == body.id and leg.arr_body_state:
            told[leg.t_arr_mjd2000] = leg.arr_body_state
    return told


def _moved(states: _Array, days: _Array, mu: float) -> _Array:
    # Imported here: compiled kernels take a moment to load.
    from feasibility.orbits.kepler_kernels import propagate_batch

    moved: _Array = propagate_batch(np.ascontiguousarray(states), days * DAY_S, mu)
    return moved
