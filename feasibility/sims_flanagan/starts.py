"""First guesses for the reference solver: sequences of impulses, one a segment.

Impulses, not throttles, because a guess must not depend on the mass that is
looked for. They are in `constants.EARTH_VELOCITY`, heliocentric frame.
"""

from collections.abc import Iterator
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from feasibility.pykep_guard import load_pykep

MAX_REVOLUTIONS: Final = 2
"""Lambert branches are tried up to this number of complete revolutions."""

FIRST_TANGENTIAL: Final = 1 + 2 * MAX_REVOLUTIONS
"""Index of the start along the velocity; the next is against it. Below: Lambert branches."""

FIRST_RANDOM: Final = FIRST_TANGENTIAL + 2
"""Index of the first random start."""

_TANGENTIAL_DELTA_V = 0.2
_RANDOM_KNOTS = 4


def lambert_starts(leg: Any, n_segments: int) -> Iterator[tuple[int, NDArray[np.float64]]]:
    """Yield the two impulses of every Lambert branch, each spread over its half of the leg.

    Parameters
    ----------
    leg : pykep.leg.sims_flanagan
        The leg in scaled units (`pykep_leg.scaled_leg`).
    n_segments : int
        Number of segments, s.

    Yields
    ------
    int
        Branch: 0 for no complete revolution, then low and high path of each revolution.
    (s, 3) float64
        Impulses.
    """
    (r_dep, v_dep), (r_arr, v_arr) = leg.rvs, leg.rvf
    arcs = load_pykep().lambert_problem(
        r0=r_dep, r1=r_arr, tof=leg.tof, mu=leg.mu, cw=False, multi_revs=MAX_REVOLUTIONS
    )
    half = n_segments // 2
    for branch, (v0, v1) in enumerate(zip(arcs.v0, arcs.v1, strict=True)):
        impulses = np.empty((n_segments, 3))
        impulses[:half] = (np.array(v0) - v_dep) / half
        impulses[half:] = (np.array(v_arr) - v1) / (n_segments - half)
        if np.isfinite(impulses).all():
            yield branch, impulses


def tangential_starts(leg: Any, n_segments: int) -> Iterator[tuple[int, NDArray[np.float64]]]:
    """Yield equal impulses along, then against the velocity of the coasted departure orbit.

    Parameters and yields as for `lambert_starts`.
    """
    pykep = load_pykep()
    directions = np.empty((n_segments, 3))
    for segment in range(n_segments):
        tof = leg.tof * (segment + 0.5) / n_segments
        velocity = np.array(pykep.propagate_lagrangian(rv=leg.rvs, tof=tof, mu=leg.mu)[1])
        directions[segment] = velocity / np.linalg.norm(velocity)
    # The size only sets where the mass starts; the solver finds the right one from there.
    along = directions * np.linalg.norm(leg.rvs[1]) * _TANGENTIAL_DELTA_V / n_segments
    yield FIRST_TANGENTIAL, along
    yield FIRST_TANGENTIAL + 1, -along


def random_starts(
    leg: Any, n_segments: int, n_random: int, rng: np.random.Generator
) -> Iterator[tuple[int, NDArray[np.float64]]]:
    """Yield impulses whose direction wanders smoothly through random knots.

    Parameters and yields as for `lambert_starts`, and:

    n_random : int
        How many.
    rng : numpy.random.Generator
        Source of the knots.
    """
    size = np.linalg.norm(leg.rvs[1]) * _TANGENTIAL_DELTA_V / n_segments
    at = np.linspace(0.0, _RANDOM_KNOTS - 1.0, n_segments)
    for index in range(n_random):
        knots = rng.normal(size=(_RANDOM_KNOTS, 3))
        path = np.stack([np.interp(at, np.arange(_RANDOM_KNOTS), axis) for axis in knots.T], 1)
        norms = np.maximum(np.linalg.norm(path, axis=1, keepdims=True), 1e-9)
        yield FIRST_RANDOM + index, size * path / norms
