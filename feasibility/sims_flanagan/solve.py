"""The public face of the leg solvers: one function a question, one keyword for the method."""

import importlib
from collections.abc import Callable
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from feasibility.constants import G0, MU_SUN
from feasibility.errors import InputError
from feasibility.legs import Legs
from feasibility.sims_flanagan.pykep_leg import N_SEGMENTS
from feasibility.sims_flanagan.solutions import LegSolutions, Status

DEFAULT_METHOD: Final = "fast"
"""Method of all solves that do not name one."""

BOTH: Final = "best"
"""Method that asks both solvers and takes, for each leg, the better solution."""

CAREFUL: Final = "auto"
"""Method that asks the reference too where the fast solver has no solution or may be wrong."""

METHODS: Final = ("fast", "reference", BOTH, CAREFUL)
"""Names of all methods."""

MASS_ROUNDING: Final = 1e-6
"""Relative excess of an initial mass over m* that is put down to rounding."""

_ECCENTRIC: Final = 0.75
"""Eccentricity of either orbit beyond which a fifth of the fast solver's m* is too small."""

_HOME = "feasibility.sims_flanagan"
_MAXIMUM_MASS: Final = {
    "fast": f"{_HOME}.fast.solver:fast_max_initial_mass",
    "reference": f"{_HOME}.reference.solver:reference_max_initial_mass",
}
_MINIMUM_PROPELLANT: Final = {
    "fast": f"{_HOME}.fast.solver:fast_min_propellant",
    "reference": f"{_HOME}.reference.solver:reference_min_propellant",
}


def max_initial_mass(
    legs: Legs,
    *,
    method: str = DEFAULT_METHOD,
    n_segments: int = N_SEGMENTS,
    mu: float = MU_SUN,
) -> NDArray[np.float64]:
    """Return the maximum initial mass m* of each leg, for which it is just flyable.

    Parameters
    ----------
    legs : Legs
        n legs; their `m0` and `m_dry` play no part.
    method : str
        Solver: "fast", our own batch solver, "reference", pykep's leg with
        pygmo's IPOPT and SLSQP, a hundred times slower, "best", the better
        solution of both, or "auto", which is "fast" but for the legs that it does not
        solve, and those from or to orbits of eccentricity above 0.75: for these it is "best".
        All are confirmed by pykep's leg.
    n_segments : int
        Segments of each leg, s, two or more. More come nearer to continuous thrust:
        20 shift m* by up to half a per cent.
    mu : float, m3/s2
        Gravitational parameter, for problems with a Sun of their own.

    Returns
    -------
    (n,) float64
        m* in kg; 0 where no closed leg was found. A leg is flyable where its
        `m0` is at most m*. m* is proportional to the thrust at given specific impulse.

    Raises
    ------
    InputError
        `method` is unknown, `n_segments` below two, or `mu` not positive.
    MissingDependencyError
        pykep or pygmo is not installed.
    """
    return solve_max_initial_mass(legs, method=method, n_segments=n_segments, mu=mu).m0


def solve_max_initial_mass(
    legs: Legs,
    *,
    method: str = DEFAULT_METHOD,
    guess: LegSolutions | None = None,
    n_segments: int | None = None,
    mu: float = MU_SUN,
) -> LegSolutions:
    """Find the maximum initial mass of each leg, with throttles and masses.

    Parameters
    ----------
    legs : Legs
        n legs; their `m0` and `m_dry` play no part.
    method : str
        Solver, as for `max_initial_mass`.
    guess : LegSolutions, optional
        Solutions of the same legs, from which the reference starts too; the fast
        solver takes none.
    n_segments : int, optional
        Segments of each leg; those of `guess` if that is given, otherwise 20.
    mu : float, m3/s2
        Gravitational parameter.

    Returns
    -------
    LegSolutions
        n rows, each confirmed by pykep's leg; failed solves are rows too.

    Raises
    ------
    InputError
        `method` is unknown, a number is out of range, or `guess` does not fit the
        legs, the segments or the method.
    MissingDependencyError
        pykep or pygmo is not installed.
    """
    segments = _segments(n_segments, guess)
    if method == CAREFUL and guess is None:
        return _carefully_solved(legs, segments, mu)
    legs = _as_about_the_sun(legs, mu)
    if method == BOTH:
        fast: LegSolutions = _solver(_MAXIMUM_MASS, "fast")(legs, n_segments=segments)
        start = fast if guess is None else _better(fast, guess, fast.m0, guess.m0)
        # The reference keeps what it is given unless it finds a larger mass.
        best: LegSolutions = _solver(_MAXIMUM_MASS, "reference")(legs, guess=start)
        return best
    solver = _solver(_MAXIMUM_MASS, method)
    if guess is not None and method != "reference":
        raise InputError(f"guess: method {method!r} takes none, expected method 'reference'")
    options = {"n_segments": segments} if guess is None else {"guess": guess}
    solutions: LegSolutions = solver(legs, **options)
    return solutions


def optimise(
    legs: Legs,
    *,
    method: str = DEFAULT_METHOD,
    guess: LegSolutions | None = None,
    n_segments: int | None = None,
    mu: float = MU_SUN,
    mass_tolerance: float = MASS_ROUNDING,
) -> LegSolutions:
    """Find the minimum-propellant solution of each leg at its own initial mass.

    Parameters
    ----------
    legs : Legs
        n legs.
    method : str
        Solver, as for `max_initial_mass`.
    guess : LegSolutions, optional
        What `solve_max_initial_mass` returned for the same legs; found here if not given.
    n_segments : int, optional
        Segments of each leg; those of `guess` if that is given, otherwise 20.
    mu : float, m3/s2
        Gravitational parameter.
    mass_tolerance : float
        A leg whose initial mass exceeds m* by at most this share is solved at m*, which is then
        its solution's `m0`: for masses and dates that were rounded.

    Returns
    -------
    LegSolutions
        n rows, each confirmed by pykep's leg. Legs that cannot be flown are rows
        with a `status` that says why.

    Raises
    ------
    InputError
        `method` is unknown, a number is out of range, or `guess` does not fit the legs
        or the segments.
    MissingDependencyError
        pykep or pygmo is not installed.
    """
    segments = _segments(n_segments, guess)
    if not 0.0 <= mass_tolerance < 1.0:
        raise InputError(f"mass_tolerance: {mass_tolerance}, expected 0 or more and below 1")
    if mass_tolerance > MASS_ROUNDING:
        if guess is None:
            guess = solve_max_initial_mass(legs, method=method, n_segments=segments, mu=mu)
        legs = _not_above(legs, guess, mass_tolerance)
    if method == CAREFUL:
        return _carefully_optimised(legs, guess, segments, mu)
    legs = _as_about_the_sun(legs, mu)
    if method == BOTH:
        if guess is None:
            guess = solve_max_initial_mass(legs, method=BOTH, n_segments=segments)
        fast: LegSolutions = _solver(_MINIMUM_PROPELLANT, "fast")(legs, guess=guess)
        slow: LegSolutions = _solver(_MINIMUM_PROPELLANT, "reference")(legs, guess=guess)
        return _better(fast, slow, fast.m_final, slow.m_final)
    solver = _solver(_MINIMUM_PROPELLANT, method)
    solutions: LegSolutions = solver(legs, guess=guess, n_segments=segments)
    return solutions


def _carefully_solved(legs: Legs, n_segments: int, mu: float) -> LegSolutions:
    """Find m* by the fast solver, and by the reference where that may be wrong."""
    found = solve_max_initial_mass(legs, n_segments=n_segments, mu=mu)
    rows = np.flatnonzero(~found.converged | _eccentric(legs, mu))
    if not len(rows):
        return found
    some = found.take(rows)
    again = solve_max_initial_mass(legs.take(rows), method="reference", guess=some, mu=mu)
    return _replaced(found, rows, again)


def _carefully_optimised(
    legs: Legs, guess: LegSolutions | None, n_segments: int, mu: float
) -> LegSolutions:
    """Find least propellant by the fast solver, and by the reference where that may be wrong."""
    if guess is None:
        guess = _carefully_solved(legs, n_segments, mu)
    found = optimise(legs, guess=guess, mu=mu)
    doubtful = (found.status == Status.NOT_CONVERGED) | _eccentric(legs, mu)
    rows = np.flatnonzero(guess.converged & doubtful & (found.status != Status.TOO_HEAVY))
    if not len(rows):
        return found
    some = found.take(rows)
    again = optimise(legs.take(rows), method="reference", guess=guess.take(rows), mu=mu)
    return _replaced(found, rows, _better(some, again, some.m_final, again.m_final))


def _replaced(
    solutions: LegSolutions, rows: NDArray[np.intp], better: LegSolutions
) -> LegSolutions:
    """Return the solutions with some rows replaced."""
    place = np.arange(len(solutions))
    place[rows] = len(solutions) + np.arange(len(rows))
    return LegSolutions.concatenate([solutions, better]).take(place)


def _eccentric(legs: Legs, mu: float) -> NDArray[np.bool_]:
    """Return (n,) whether either orbit is very eccentric, or none of an ellipse at all."""
    most = np.zeros(len(legs))
    for states in (legs.rv_dep, legs.rv_arr):
        r, v = states[:, :3], states[:, 3:]
        radius = np.linalg.norm(r, axis=1, keepdims=True)
        vector = np.cross(v, np.cross(r, v)) / mu - r / radius
        most = np.maximum(most, np.linalg.norm(vector, axis=1))
    return np.asarray(most > _ECCENTRIC)


def _not_above(legs: Legs, guess: LegSolutions, tolerance: float) -> Legs:
    """Return the legs with masses slightly above m* lowered to it."""
    if len(guess) != len(legs):
        raise InputError(f"guess: {len(guess)} rows, expected {len(legs)} as there are legs")
    m_star = guess.m0
    above = guess.converged & (legs.m0 > m_star) & (legs.m0 <= m_star * (1.0 + tolerance))
    return legs.with_m0(np.where(above & (m_star >= legs.m_dry), m_star, legs.m0))


def _segments(n_segments: int | None, guess: LegSolutions | None) -> int:
    if n_segments is not None and n_segments < 2:
        raise InputError(f"n_segments: {n_segments}, expected 2 or more")
    if guess is None:
        return N_SEGMENTS if n_segments is None else n_segments
    if n_segments is not None and n_segments != guess.n_segments:
        raise InputError(f"n_segments: {n_segments}, expected {guess.n_segments} as in the guess")
    return guess.n_segments


def _as_about_the_sun(legs: Legs, mu: float) -> Legs:
    """Return legs about the Sun that have the same throttles and masses as these about `mu`.

    With lengths as they are and times longer by the factor k = sqrt(mu / mu_Sun), velocities
    shrink by k and accelerations by k^2, as gravity does.
    """
    if mu == MU_SUN:
        return legs
    if not (np.isfinite(mu) and mu > 0.0):
        raise InputError(f"mu: {mu}, expected a positive number of m3/s2")
    k = float(np.sqrt(mu / MU_SUN))
    rv_dep, rv_arr = legs.rv_dep.copy(), legs.rv_arr.copy()
    rv_dep[:, 3:] /= k
    rv_arr[:, 3:] /= k
    return Legs(
        rv_dep=rv_dep,
        rv_arr=rv_arr,
        tof_days=legs.tof_days * k,
        m0=legs.m0,
        thrust=legs.thrust / k**2,
        isp=legs.exhaust_velocity / (k * G0),
        m_dry=legs.m_dry,
    )


def _better(
    one: LegSolutions,
    other: LegSolutions,
    one_value: NDArray[np.float64],
    other_value: NDArray[np.float64],
) -> LegSolutions:
    """Return, row by row, the converged solution of larger value; `one` where neither has."""
    if len(one) != len(other):
        raise InputError(f"guess: {len(other)} rows, expected {len(one)} as there are legs")
    n = len(one)
    take_other = other.converged & (~one.converged | (other_value > one_value))
    both = LegSolutions.concatenate([one, other])
    return both.take(np.where(take_other, n + np.arange(n), np.arange(n)))


def _solver(table: dict[str, str], method: str) -> Callable[..., Any]:
    if method not in table:
        known = ", ".join(repr(name) for name in METHODS)
        raise InputError(f"method: {method!r} is unknown, expected one of {known}")
    # Imported on use: a solver may need pygmo or compiled kernels, the others do not.
    module, _, name = table[method].partition(":")
    solver: Callable[..., Any] = getattr(importlib.import_module(module), name)
    return solver
