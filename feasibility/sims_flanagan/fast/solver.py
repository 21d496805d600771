"""Fast batch solvers for Sims-Flanagan legs: maximum initial mass and minimum propellant.

The method is described in docs/guide/solver.md. Where the reference solver hands one
leg at a time to a general optimiser, these run a whole batch in compiled kernels;
both solve the same problem, and every solution is confirmed by pykep's own leg.
"""

import time
from typing import Final

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from feasibility.constants import MU_SUN
from feasibility.errors import InputError
from feasibility.legs import Legs
from feasibility.sims_flanagan.light_legs import are_light
from feasibility.sims_flanagan.pykep_leg import N_SEGMENTS, confirm
from feasibility.sims_flanagan.solutions import (
    EXCESS_TOLERANCE,
    MISMATCH_TOLERANCE,
    THROTTLE_TOLERANCE,
    TWO_IMPULSE,
    LegSolutions,
    Status,
)

# Waves sin(k pi t), k = 1, 2, 3, on the five slow elements of a path; the mean motion
# in units of the departure orbit's. Large enough to reach other optima, small enough to
# remain moderate ellipses.
_SPREAD: Final = 0.2 / np.array([1.0, 2.0, 3.0])
_N_BENT: Final = 15
# Legs with free ends that burn much have more optima.
_N_BENT_FREE: Final = 47
# Rounding of masses that went through a file or through units.
_MASS_ROUNDING: Final = 1e-6


def fast_max_initial_mass(
    legs: Legs,
    *,
    n_segments: int = N_SEGMENTS,
    extra_random_starts: int = 0,
    rng: Generator | None = None,
    fallback: bool = False,
) -> LegSolutions:
    """Return the maximum initial mass of each leg, by sequential linearisation.

    Parameters
    ----------
    legs : Legs
        n legs; their initial and dry masses play no part.
    n_segments : int
        Number of segments, s, two or more.
    extra_random_starts : int
        Further starts, along randomly bent paths.
    rng : numpy.random.Generator, optional
        Their randomness; seed 0 unless given.
    fallback : bool
        Hand legs that were not solved to `reference_max_initial_mass`.

    Returns
    -------
    LegSolutions
        n rows. ``start`` is 0 to 4 for the nearest number of turns and 1, -1, 2, -2
        turns beside it, 5 to 20 for bent paths, 21 for a random one, 22 for one from
        the best solution, disturbed, 100 and above for the reference's
        starts; ``seconds`` is the batch's time shared out evenly. Of legs with free ends
        (`Legs.free_ends`) ``start`` is one of those of `free_kernels.free_maximum_batch`.
    """
    n = len(legs)
    rng = np.random.default_rng(0) if rng is None else rng
    shapes = _SPREAD * rng.standard_normal((n, extra_random_starts, 5, 3))
    throttles = np.zeros((n, n_segments, 3))
    z = np.full(n, np.inf)
    start = np.full(n, -1, dtype=np.int64)
    ratio = np.zeros(n)
    excess = np.zeros((n, 2, 3))
    free = legs.free_ends
    seconds = np.zeros(n)
    for rows, solve in ((np.flatnonzero(~free), _solve), (np.flatnonzero(free), _solve_free)):
        if not len(rows):
            continue
        began = time.thread_time()
        some = (throttles[rows], z[rows], start[rows], ratio[rows], excess[rows])
        solve(legs.take(rows), n_segments, shapes[rows], *some)
        throttles[rows], z[rows], start[rows], ratio[rows], excess[rows] = some
        seconds[rows] = (time.thread_time() - began) / len(rows)
    with np.errstate(divide="ignore"):
        m0 = legs.thrust * legs.tof_s / n_segments / (z * legs.exhaust_velocity)
    solutions = _confirmed(legs, throttles, m0, m0 * ratio, start, seconds, excess)
    return _with_reference(legs, solutions, n_segments) if fallback else solutions


def _solve(
    legs: Legs,
    n_segments: int,
    shapes: NDArray[np.float64],
    throttles: NDArray[np.float64],
    z: NDArray[np.float64],
    start: NDArray[np.int64],
    ratio: NDArray[np.float64],
    excess: NDArray[np.float64],  # noqa: ARG001
) -> None:
    """Find the maximum initial mass of legs without free ends."""
    from feasibility.sims_flanagan.fast.maximum_kernels import maximum_batch

    maximum_batch(
        # Copies are writable, as the one compiled signature wants them.
        legs.rv_dep.copy(),
        legs.rv_arr.copy(),
        legs.tof_s,
        legs.exhaust_velocity,
        n_segments,
        MU_SUN,
        _bent_paths(),
        shapes,
        throttles,
        z,
        start,
        ratio,
    )


def _solve_free(
    legs: Legs,
    n_segments: int,
    shapes: NDArray[np.float64],
    throttles: NDArray[np.float64],
    z: NDArray[np.float64],
    start: NDArray[np.int64],
    ratio: NDArray[np.float64],
    excess: NDArray[np.float64],
) -> None:
    """Find the maximum initial mass of legs with free ends."""
    from feasibility.sims_flanagan.fast.free_kernels import free_maximum_batch

    free_maximum_batch(
        legs.rv_dep.copy(),
        legs.rv_arr.copy(),
        legs.tof_s,
        legs.exhaust_velocity,
        legs.vinf_dep.copy(),
        legs.vinf_arr.copy(),
        n_segments,
        MU_SUN,
        _bent_paths(_N_BENT_FREE),
        shapes,
        throttles,
        z,
        start,
        ratio,
        excess,
    )


def fast_min_propellant(
    legs: Legs, *, guess: LegSolutions | None = None, n_segments: int = N_SEGMENTS
) -> LegSolutions:
    """Return the solution of largest final mass of each leg at its own initial mass.

    As only thrust over mass enters the motion, the maximum-initial-mass solution with
    its throttles times m0 / m* closes the leg at m0: it is the start. Legs of less than a
    quarter of m*, long ones of less than half of it, are also started from the cheapest
    two-impulse arcs, which wait, coast or turn otherwise than the arc of m*; the best
    solution counts.

    Parameters
    ----------
    legs : Legs
        n legs.
    guess : LegSolutions, optional
        Closed solutions of the same legs at the same or a larger initial mass;
        `fast_max_initial_mass` finds them if not given.
    n_segments : int
        Number of segments, s; that of `guess` if that is given.

    Returns
    -------
    LegSolutions
        n rows; `start` is that of the guess, or `TWO_IMPULSE` and above where a two-impulse
        arc won. Rows heavier than the guess are `Status.TOO_HEAVY`, rows that need more
        propellant than there is `Status.BELOW_DRY_MASS`.

    Raises
    ------
    InputError
        `guess` has another number of rows.
    """
    if guess is None:
        guess = fast_max_initial_mass(legs, n_segments=n_segments)
    if len(guess) != len(legs):
        raise InputError(f"fast_min_propellant: {len(guess)} guesses for {len(legs)} legs")
    solutions = LegSolutions.unsolved(len(legs), guess.n_segments)
    too_heavy = guess.converged & (legs.m0 > guess.m0 * (1.0 + _MASS_ROUNDING))
    solutions.status[too_heavy] = Status.TOO_HEAVY
    rows = np.flatnonzero(guess.converged & ~too_heavy)
    if not len(rows):
        return solutions
    flyable = legs.take(rows)
    n = guess.n_segments
    throttles = guess.throttles[rows] * (flyable.m0 / guess.m0[rows])[:, None, None]
    z = flyable.thrust * flyable.tof_s / n / (flyable.m0 * flyable.exhaust_velocity)
    ratio = np.zeros(len(rows))
    start = guess.start[rows].astype(np.int64)
    excess = np.stack([guess.dep_excess[rows], guess.arr_excess[rows]], axis=1)
    seconds = np.zeros(len(rows))
    free = flyable.free_ends
    for part, solve in ((np.flatnonzero(~free), _lower), (np.flatnonzero(free), _lower_free)):
        if not len(part):
            continue
        began = time.thread_time()
        some = (throttles[part], ratio[part], start[part], excess[part])
        solve(flyable.take(part), guess.m0[rows[part]], z[part], *some)
        throttles[part], ratio[part], start[part], excess[part] = some
        seconds[part] = (time.thread_time() - began) / len(part)
    # The start closes the leg, whatever could not be made of it.
    stuck = ratio == 0.0
    ratio[stuck] = guess.m_final[rows][stuck] / guess.m0[rows][stuck]
    m_final = flyable.m0 * ratio
    found = _confirmed(flyable, throttles, flyable.m0, m_final, start, seconds, excess)
    merged = {name: getattr(solutions, name) for name in LegSolutions.__dataclass_fields__}
    enough = found.converged & (found.m_final >= flyable.m_dry)
    solutions.status[rows[found.converged & ~enough]] = Status.BELOW_DRY_MASS
    for name, column in merged.items():
        column[rows[enough]] = getattr(found, name)[enough]
    solutions.seconds[rows] = seconds
    return solutions


def _lower(
    legs: Legs,
    heaviest: NDArray[np.float64],
    z: NDArray[np.float64],
    throttles: NDArray[np.float64],
    ratio: NDArray[np.float64],
    start: NDArray[np.int64],
    excess: NDArray[np.float64],  # noqa: ARG001
) -> None:
    """Lower the propellant of legs without free ends."""
    from feasibility.sims_flanagan.fast.propellant_kernels import minimum_batch

    minimum_batch(
        legs.rv_dep.copy(),
        legs.rv_arr.copy(),
        legs.tof_s,
        legs.exhaust_velocity,
        z,
        throttles.shape[1],
        MU_SUN,
        throttles,
        ratio,
    )
    _restart_light(legs, heaviest, z, throttles, ratio, start)


def _lower_free(
    legs: Legs,
    heaviest: NDArray[np.float64],
    z: NDArray[np.float64],
    throttles: NDArray[np.float64],
    ratio: NDArray[np.float64],
    start: NDArray[np.int64],
    excess: NDArray[np.float64],
) -> None:
    """Lower the propellant of legs with free ends."""
    from feasibility.sims_flanagan.fast.free_propellant_kernels import free_minimum_batch

    winner = np.full(len(legs), -1, dtype=np.int64)
    free_minimum_batch(
        legs.rv_dep.copy(),
        legs.rv_arr.copy(),
        legs.tof_s,
        legs.exhaust_velocity,
        legs.vinf_dep.copy(),
        legs.vinf_arr.copy(),
        z,
        are_light(legs, heaviest),
        throttles.shape[1],
        MU_SUN,
        throttles,
        ratio,
        excess,
        winner,
    )
    start[winner >= 0] = TWO_IMPULSE + winner[winner >= 0]


def _restart_light(
    legs: Legs,
    heaviest: NDArray[np.float64],
    z: NDArray[np.float64],
    throttles: NDArray[np.float64],
    ratio: NDArray[np.float64],
    start: NDArray[np.int64],
) -> None:
    """Overwrite throttles, mass ratio and start of the light legs that other arcs serve better."""
    from feasibility.sims_flanagan.fast.restart_kernels import minimum_restarts

    light = np.flatnonzero(are_light(legs, heaviest))
    if not len(light):
        return
    some = legs.take(light)
    better, larger = throttles[light], ratio[light]
    winner = np.full(len(light), -1, dtype=np.int64)
    minimum_restarts(
        some.rv_dep.copy(),
        some.rv_arr.copy(),
        some.tof_s,
        some.exhaust_velocity,
        z[light],
        throttles.shape[1],
        MU_SUN,
        better,
        larger,
        winner,
    )
    won = winner >= 0
    rows = light[won]
    throttles[rows], ratio[rows] = better[won], larger[won]
    start[rows] = TWO_IMPULSE + winner[won]


def _bent_paths(n: int = _N_BENT) -> NDArray[np.float64]:
    """Return `n` path shapes that long legs are tried with, after a straight one."""
    bent = _SPREAD * np.random.default_rng(1).standard_normal((1 + n, 5, 3))
    bent[0] = 0.0
    return bent


def _confirmed(
    legs: Legs,
    throttles: NDArray[np.float64],
    m0: NDArray[np.float64],
    m_final: NDArray[np.float64],
    start: NDArray[np.int64],
    seconds: NDArray[np.float64],
    excess: NDArray[np.float64],
) -> LegSolutions:
    """Return the solutions with those rows blanked that pykep's leg does not confirm."""
    mismatch = confirm(legs, throttles, m0, m_final, excess[:, 0], excess[:, 1])
    norm = np.linalg.norm(throttles, axis=2).max(axis=1)
    good = (mismatch <= MISMATCH_TOLERANCE) & (norm <= 1.0 + THROTTLE_TOLERANCE)
    for end, bound in enumerate((legs.vinf_dep, legs.vinf_arr)):
        good &= np.linalg.norm(excess[:, end], axis=1) <= bound * (1.0 + EXCESS_TOLERANCE)
    return LegSolutions(
        throttles=np.where(good[:, None, None], throttles, np.nan),
        m0=np.where(good, m0, 0.0),
        m_final=np.where(good, m_final, 0.0),
        mismatch=np.where(good, mismatch, np.inf),
        converged=good,
        status=np.where(good, Status.CONVERGED, Status.NOT_CONVERGED).astype(np.int8),
        start=np.where(good, start, -1).astype(np.int16),
        seconds=seconds,
        dep_excess=np.where(good[:, None], excess[:, 0], np.nan),
        arr_excess=np.where(good[:, None], excess[:, 1], np.nan),
    )


def _with_reference(legs: Legs, solutions: LegSolutions, n_segments: int) -> LegSolutions:
    """Return the solutions with the rows that did not converge solved by the reference."""
    from feasibility.sims_flanagan.reference.solver import reference_max_initial_mass

    rows = np.flatnonzero(~solutions.converged)
    if not len(rows):
        return solutions
    rest = reference_max_initial_mass(legs.take(rows), n_segments=n_segments)
    merged = {}
    for name in LegSolutions.__dataclass_fields__:
        merged[name] = getattr(solutions, name).copy()
        merged[name][rows] = getattr(rest, name)
    merged["start"][rows] = np.where(rest.converged, 100 + rest.start, -1)
    merged["seconds"][rows] += solutions.seconds[rows]
    return LegSolutions(**merged)
