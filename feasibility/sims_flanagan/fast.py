"""Fast batch solver for the maximum initial mass of Sims-Flanagan legs."""

import time

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from feasibility.constants import MU_SUN
from feasibility.legs import Legs
from feasibility.sims_flanagan.pykep_leg import N_SEGMENTS, confirm
from feasibility.sims_flanagan.solutions import (
    MISMATCH_TOLERANCE,
    THROTTLE_TOLERANCE,
    LegSolutions,
    Status,
)

RANDOM_PATH_SPREAD = 0.1 / np.array([1.0, 2.0, 3.0])


def fast_max_initial_mass(
    legs: Legs,
    *,
    n_segments: int = N_SEGMENTS,
    extra_random_starts: int = 0,
    rng: Generator | None = None,
) -> LegSolutions:
    """Return the maximum initial mass of each leg.

    Parameters
    ----------
    legs : Legs
        n legs; their initial and dry masses play no part.
    n_segments : int
        Number of segments, s.
    extra_random_starts : int
        Further starts along randomly bent paths.
    rng : numpy.random.Generator, optional
        Their randomness; seed 0 unless given.

    Returns
    -------
    LegSolutions
        Every converged row is confirmed by pykep's own leg.
    """
    from feasibility.sims_flanagan.fast_maximum_kernels import maximum_batch

    n = len(legs)
    throttles = np.zeros((n, n_segments, 3))
    z = np.full(n, np.inf)
    start = np.full(n, -1, dtype=np.int64)
    ratio = np.zeros(n)
    rng = np.random.default_rng(0) if rng is None else rng
    shapes = RANDOM_PATH_SPREAD * rng.standard_normal((n, extra_random_starts, 5, 3))
    began = time.perf_counter()
    maximum_batch(
        legs.rv_dep,
        legs.rv_arr,
        legs.tof_s,
        legs.exhaust_velocity,
        n_segments,
        MU_SUN,
        shapes,
        throttles,
        z,
        start,
        ratio,
    )
    seconds = np.full(n, (time.perf_counter() - began) / max(n, 1))
    m0 = legs.thrust * legs.tof_s / n_segments / (z * legs.exhaust_velocity)
    return confirmed(legs, throttles, m0, m0 * ratio, start, seconds)


def confirmed(
    legs: Legs,
    throttles: NDArray[np.float64],
    m0: NDArray[np.float64],
    m_final: NDArray[np.float64],
    start: NDArray[np.int64],
    seconds: NDArray[np.float64],
) -> LegSolutions:
    """Return the solutions with those rows blanked that pykep's leg does not confirm."""
    mismatch = confirm(legs, throttles, m0, m_final)
    norm = np.linalg.norm(throttles, axis=2).max(axis=1)
    good = (mismatch <= MISMATCH_TOLERANCE) & (norm <= 1.0 + THROTTLE_TOLERANCE)
    return LegSolutions(
        throttles=np.where(good[:, None, None], throttles, np.nan),
        m0=np.where(good, m0, 0.0),
        m_final=np.where(good, m_final, 0.0),
        mismatch=np.where(good, mismatch, np.inf),
        converged=good,
        status=np.where(good, Status.CONVERGED, Status.NOT_CONVERGED).astype(np.int8),
        start=np.where(good, start, -1).astype(np.int16),
        seconds=seconds,
    )
