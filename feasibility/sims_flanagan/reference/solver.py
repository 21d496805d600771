"""The reference leg solver: pykep's leg, optimised with pygmo (IPOPT and SLSQP).

Slow, plain and independent of the fast solver, which it checks and backs up.
"""

import functools
import time
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from feasibility.errors import InputError
from feasibility.legs import Legs
from feasibility.sims_flanagan.light_legs import are_light
from feasibility.sims_flanagan.pykep_leg import CUT, N_SEGMENTS, confirm, scaled_leg
from feasibility.sims_flanagan.reference.pygmo_problems import (
    MaximumMassProblem,
    MinimumPropellantProblem,
)
from feasibility.sims_flanagan.reference.starts import (
    FIRST_HOP,
    FIRST_RANDOM,
    FROM_GUESS,
    N_HOPS,
    bends,
    reference_starts,
    two_impulse_starts,
)
from feasibility.sims_flanagan.solutions import (
    MISMATCH_TOLERANCE,
    THROTTLE_TOLERANCE,
    TWO_IMPULSE,
    LegSolutions,
    Status,
)

_MASS_ROUNDING = 1e-6
_SAME_MASS = 1e-3
_LEAST_IMPULSE = 1e-9
_CONSTRAINT_ROUNDING = 1e-7


class _Closed(NamedTuple):
    """A closed leg: throttles (s, 3), masses in kg, mismatch."""

    throttles: NDArray[np.float64]
    m0: float
    m_final: float
    mismatch: float


def reference_max_initial_mass(
    legs: Legs,
    *,
    guess: LegSolutions | None = None,
    n_segments: int = N_SEGMENTS,
    rng: np.random.Generator | None = None,
    n_random: int = 0,
    agreement: int = 8,
) -> LegSolutions:
    """Find the maximum initial mass m* of each leg: the best of several starts of IPOPT.

    The starts are every Lambert branch up to 2 revolutions, thrust along and
    against the velocity in several sizes, and smoothly wandering thrust
    (`starts.reference_starts`); they stop when `agreement` of them have led to
    the best mass, so that a leg with one optimum costs little. A leg with many
    gets them all and is then solved again from its best solution, disturbed.
    Neither the legs' `m0` nor `m_dry` plays a part.

    Parameters
    ----------
    legs : Legs
        n legs.
    guess : LegSolutions, optional
        Solutions of the same legs, such as the fast solver's: one more start for each row
        that has converged, and kept where nothing better is found.
    n_segments : int
        Segments of the leg, at least 2; those of `guess` if that is given.
    rng : numpy.random.Generator, optional
        Source of the random starts.
    n_random : int
        Random starts of each leg after the others, in any case; needs `rng`.
    agreement : int
        How many starts have to agree on the best mass, to 0.1 %, before the
        remaining fixed ones are left out; at least 1.

    Returns
    -------
    LegSolutions
        n rows; `start` is an index of `starts`: 0 to 4 are Lambert branches (0
        revolutions, then low and high path of 1 and 2), then the tangential, the
        wandering, the disturbed, the given and the random ones.

    Raises
    ------
    InputError
        `n_segments` is below 2, `agreement` below 1, `guess` has another number of
        rows, or random starts are asked for without `rng`.
    MissingDependencyError
        pykep or pygmo is not installed.
    """
    _check_segments(n_segments)
    if guess is not None:
        if len(guess) != len(legs):
            raise InputError(
                f"reference_max_initial_mass: {len(guess)} guesses for {len(legs)} legs"
            )
        n_segments = guess.n_segments
    if agreement < 1:
        raise InputError(f"reference_max_initial_mass: agreement {agreement}, expected at least 1")
    if n_random and rng is None:
        raise InputError("reference_max_initial_mass: n_random needs rng, a numpy Generator")
    solutions = LegSolutions.unsolved(len(legs), n_segments)
    for row in range(len(legs)):
        began = time.process_time()
        leg = scaled_leg(legs, row, float(legs.m0[row]), n_segments)
        masses: list[float] = []
        if guess is not None and guess.converged[row]:
            for found in _from_guess(legs, row, guess):
                _keep_best(solutions, row, found, FROM_GUESS, masses)
        for start, impulses in reference_starts(leg, n_random, rng):
            if start < FIRST_RANDOM and _agreed(masses, agreement):
                continue
            _keep_best(solutions, row, _maximise_mass(legs, row, impulses), start, masses)
        if masses and not _agreed(masses, agreement):
            _hop(legs, row, solutions, masses)
        solutions.seconds[row] = time.process_time() - began
    return solutions


def _hop(legs: Legs, row: int, solutions: LegSolutions, masses: list[float]) -> None:
    """Solve again from the best solution so far, at first as it is and then disturbed.

    A leg whose starts do not agree has many optima, and better ones lie near good ones.
    """
    for number, bend in enumerate(bends(solutions.n_segments, N_HOPS)):
        throttles = solutions.throttles[row] + bend
        throttles /= np.maximum(1.0, np.linalg.norm(throttles, axis=1, keepdims=True))
        final = float(solutions.m_final[row] / solutions.m0[row])
        found = _solve_maximum(legs, row, throttles, float(solutions.m0[row]), final)
        _keep_best(solutions, row, found, FIRST_HOP + number, masses)


def _from_guess(legs: Legs, row: int, guess: LegSolutions) -> Iterator[_Closed | None]:
    """Yield the guess itself, if pykep's leg confirms it, and what IPOPT makes of it."""
    throttles, mass = guess.throttles[row], float(guess.m0[row])
    m_final = float(guess.m_final[row])
    yield _confirmed(legs, row, throttles.ravel(), mass, m_final)
    yield _solve_maximum(legs, row, throttles, mass, m_final / mass)


def _keep_best(
    solutions: LegSolutions, row: int, found: _Closed | None, start: int, masses: list[float]
) -> None:
    if found is None:
        return
    masses.append(found.m0)
    if found.m0 > solutions.m0[row]:
        _put(solutions, row, found, start)


def _maximise_mass(legs: Legs, row: int, impulses: NDArray[np.float64]) -> _Closed | None:
    """Return what IPOPT finds from one start, None if it does not close."""
    n_segments = len(impulses)
    leg = scaled_leg(legs, row, float(legs.m0[row]), n_segments)
    masses, final = _mass_profile(impulses, leg.veff)
    pushes = np.maximum(np.linalg.norm(impulses, axis=1), _LEAST_IMPULSE) * masses
    # The mass at which the guess uses full thrust on average is the mass unit: m0 near 1.
    mass_unit = float(legs.m0[row] * leg.max_thrust * leg.tof / n_segments / pushes.mean())
    throttles = impulses * (masses / pushes.mean())[:, None]
    throttles /= np.maximum(1.0, np.linalg.norm(throttles, axis=1, keepdims=True))
    return _solve_maximum(legs, row, throttles, mass_unit, final)


def _solve_maximum(
    legs: Legs, row: int, throttles: NDArray[np.float64], mass_unit: float, final: float
) -> _Closed | None:
    """Run IPOPT from throttles, an initial mass of one unit and a final one of `final` units."""
    leg = scaled_leg(legs, row, mass_unit, len(throttles))
    guess = np.concatenate([throttles.ravel(), [1.0, final]])
    x = _evolve(MaximumMassProblem(leg), guess, _ipopt())
    return _confirmed(legs, row, x[:-2], float(x[-2]) * mass_unit, float(x[-1]) * mass_unit)


def _mass_profile(
    impulses: NDArray[np.float64], exhaust_velocity: float
) -> tuple[NDArray[np.float64], float]:
    """Return the masses the thrust acts on (pykep's convention) and the final mass; m0 is 1."""
    after = np.exp(-np.cumsum(np.linalg.norm(impulses, axis=1)) / exhaust_velocity)
    before = np.concatenate([[1.0], after[:-1]])
    n_forward = int(len(impulses) * CUT)
    masses = np.concatenate([before[:n_forward], after[n_forward:]])
    return masses, float(after[-1])


def reference_min_propellant(
    legs: Legs, *, guess: LegSolutions | None = None, n_segments: int = N_SEGMENTS
) -> LegSolutions:
    """Find the largest final mass of each leg at the leg's own initial mass.

    The start is the maximum-initial-mass solution: as only thrust / mass
    enters the motion, its throttles times m0 / m* close the leg at m0 exactly.
    Each row is then improved by SLSQP, and by IPOPT where that fails; the
    start itself remains where both do. A leg of less than a quarter of m*, or less
    than half where it is long, is solved from the cheapest two-impulse arcs as well.

    Parameters
    ----------
    legs : Legs
        n legs.
    guess : LegSolutions, optional
        Closed solutions of the same legs at the same or a larger initial mass, as
        returned by a maximum-initial-mass solver; found here if not given.
    n_segments : int
        Segments of the leg, at least 2; those of `guess` if that is given.

    Returns
    -------
    LegSolutions
        n rows; `start` is that of the guess, or `TWO_IMPULSE` and above where a
        two-impulse arc won. A leg whose initial mass exceeds
        that of the guess is `Status.TOO_HEAVY` without a solve; one that needs
        more propellant than there is is `Status.BELOW_DRY_MASS`.

    Raises
    ------
    InputError
        `n_segments` is below 2, or `guess` has another number of rows.
    MissingDependencyError
        pykep or pygmo is not installed.
    """
    _check_segments(n_segments)
    if guess is None:
        guess = reference_max_initial_mass(legs, n_segments=n_segments)
    if len(guess) != len(legs):
        raise InputError(f"reference_min_propellant: {len(guess)} guesses for {len(legs)} legs")
    solutions = LegSolutions.unsolved(len(legs), guess.n_segments)
    for row in np.flatnonzero(guess.converged):
        began = time.process_time()
        if legs.m0[row] > guess.m0[row] * (1.0 + _MASS_ROUNDING):
            solutions.status[row] = Status.TOO_HEAVY
        else:
            found, start = _minimise_propellant(legs, int(row), guess)
            if found is not None and found.m_final < legs.m_dry[row]:
                solutions.status[row] = Status.BELOW_DRY_MASS
            elif found is not None:
                _put(solutions, int(row), found, start)
        solutions.seconds[row] = time.process_time() - began
    return solutions


def _minimise_propellant(legs: Legs, row: int, guess: LegSolutions) -> tuple[_Closed | None, int]:
    """Return the best of all starts, and the number of its start."""
    m0 = float(legs.m0[row])
    lighter = m0 / float(guess.m0[row])
    throttles = guess.throttles[row].ravel() * lighter
    m_final = float(guess.m_final[row]) * lighter
    best = _confirmed(legs, row, throttles, m0, m_final)
    best_start = int(guess.start[row])
    for algorithm in (_slsqp(), _ipopt()):
        found = _solve_minimum(legs, row, throttles, m_final / m0, algorithm)
        if found is not None and (best is None or found.m_final > best.m_final):
            best = found
            break
    if are_light(legs.take([row]), guess.m0[[row]]).item():
        for number, impulses in enumerate(two_impulse_starts(legs, row, guess.n_segments)):
            masses, final = _mass_profile(impulses, float(legs.exhaust_velocity[row]))
            push = legs.thrust[row] * legs.tof_s[row] / guess.n_segments / m0
            throttles = impulses * (masses / push)[:, None]
            throttles /= np.maximum(1.0, np.linalg.norm(throttles, axis=1, keepdims=True))
            found = _solve_minimum(legs, row, throttles.ravel(), final, _slsqp())
            if found is not None and (best is None or found.m_final > best.m_final):
                best, best_start = found, TWO_IMPULSE + number
    return best, best_start


def _solve_minimum(
    legs: Legs, row: int, throttles: NDArray[np.float64], final: float, algorithm: Any
) -> _Closed | None:
    """Return what an algorithm makes of throttles (3 s,) and a final mass in initial masses."""
    # The dry mass is compared with the optimum and is no bound of the problem:
    # as a bound it would make "needs too much propellant" look like "did not converge".
    m0 = float(legs.m0[row])
    leg = scaled_leg(legs, row, m0, len(throttles) // 3)
    guess = np.concatenate([throttles, [final]])
    x = _evolve(MinimumPropellantProblem(leg), guess, algorithm)
    return _confirmed(legs, row, x[:-1], m0, float(x[-1]) * m0)


def _agreed(masses: list[float], agreement: int) -> bool:
    if len(masses) < agreement:
        return False
    best = max(masses)
    return sum(mass > (1.0 - _SAME_MASS) * best for mass in masses) >= agreement


def _put(solutions: LegSolutions, row: int, found: _Closed, start: int) -> None:
    solutions.throttles[row] = found.throttles
    solutions.m0[row] = found.m0
    solutions.m_final[row] = found.m_final
    solutions.mismatch[row] = found.mismatch
    solutions.converged[row] = True
    solutions.status[row] = Status.CONVERGED
    solutions.start[row] = start


def _check_segments(n_segments: int) -> None:
    if n_segments < 2:
        raise InputError(f"n_segments: {n_segments}, expected at least 2")


def _confirmed(
    legs: Legs, row: int, throttles: NDArray[np.float64], m0: float, m_final: float
) -> _Closed | None:
    """Return the solution with throttles cut to 1, if pykep's leg confirms it."""
    vectors = throttles.reshape(-1, 3)
    norms = np.linalg.norm(vectors, axis=1, keepdims=True)
    if not np.isfinite(norms).all() or norms.max() > 1.0 + THROTTLE_TOLERANCE:
        return None
    vectors = vectors / np.maximum(norms, 1.0)
    mismatch = confirm(legs.take([row]), vectors[None], np.array([m0]), np.array([m_final])).item()
    return _Closed(vectors, m0, m_final, mismatch) if mismatch < MISMATCH_TOLERANCE else None


def _evolve(problem: Any, guess: NDArray[np.float64], algorithm: Any) -> NDArray[np.float64]:
    import pygmo

    wrapped = pygmo.problem(problem)
    # pygmo keeps the guess unless the result is better under these tolerances.
    wrapped.c_tol = [0.5 * MISMATCH_TOLERANCE] * 7 + [_CONSTRAINT_ROUNDING] * problem.n_segments
    lower, upper = wrapped.get_bounds()
    population = pygmo.population(wrapped)
    population.push_back(np.clip(guess, lower, upper))
    x: NDArray[np.float64] = algorithm.evolve(population).get_x()[0]
    return x


@functools.cache
def _ipopt() -> Any:
    import pygmo

    solver = pygmo.ipopt()
    solver.set_string_options({"sb": "yes"})
    solver.set_integer_options({"print_level": 0, "max_iter": 200})
    # An objective to 5 digits is enough; the constraints have to be far below the tolerance.
    solver.set_numeric_options({"tol": 1e-5, "constr_viol_tol": 1e-7})
    return pygmo.algorithm(solver)


@functools.cache
def _slsqp() -> Any:
    import pygmo

    solver = pygmo.nlopt("slsqp")
    solver.maxeval = 1000
    solver.ftol_rel = 1e-6
    solver.xtol_rel = 0.0
    return pygmo.algorithm(solver)
