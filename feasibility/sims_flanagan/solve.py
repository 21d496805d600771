"""The public face of the leg solvers: one function a question, one keyword for the method."""

import importlib
from collections.abc import Callable
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from feasibility.errors import InputError
from feasibility.legs import Legs
from feasibility.sims_flanagan.solutions import LegSolutions

DEFAULT_METHOD: Final = "fast"
"""Method of all solves that do not name one."""

_HOME = "feasibility.sims_flanagan"
_MAXIMUM_MASS: Final = {
    "fast": f"{_HOME}.fast.solver:fast_max_initial_mass",
    "reference": f"{_HOME}.reference.solver:reference_max_initial_mass",
}
_MINIMUM_PROPELLANT: Final = {
    "fast": f"{_HOME}.fast.solver:fast_min_propellant",
    "reference": f"{_HOME}.reference.solver:reference_min_propellant",
}


def max_initial_mass(legs: Legs, *, method: str = DEFAULT_METHOD) -> NDArray[np.float64]:
    """Return the maximum initial mass m* of each leg, for which it is just flyable.

    Parameters
    ----------
    legs : Legs
        n legs; their `m0` and `m_dry` play no part.
    method : str
        Solver: "fast", our own batch solver, or "reference", pykep's leg with
        pygmo's IPOPT and SLSQP, a hundred times slower. Both are confirmed by
        pykep's leg.

    Returns
    -------
    (n,) float64
        m* in kg; 0 where no closed leg was found. A leg is flyable where its
        `m0` is at most m*. m* is proportional to the thrust at given specific impulse.

    Raises
    ------
    InputError
        `method` is unknown.
    MissingDependencyError
        pykep or pygmo is not installed.
    """
    return solve_max_initial_mass(legs, method=method).m0


def solve_max_initial_mass(
    legs: Legs, *, method: str = DEFAULT_METHOD, guess: LegSolutions | None = None
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

    Returns
    -------
    LegSolutions
        n rows, each confirmed by pykep's leg; failed solves are rows too.

    Raises
    ------
    InputError
        `method` is unknown, or `guess` does not fit the legs or the method.
    MissingDependencyError
        pykep or pygmo is not installed.
    """
    solver = _solver(_MAXIMUM_MASS, method)
    if guess is not None and method != "reference":
        raise InputError(f"guess: method {method!r} takes none, expected method 'reference'")
    options = {} if guess is None else {"guess": guess}
    solutions: LegSolutions = solver(legs, **options)
    return solutions


def optimise(
    legs: Legs, *, method: str = DEFAULT_METHOD, guess: LegSolutions | None = None
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

    Returns
    -------
    LegSolutions
        n rows, each confirmed by pykep's leg. Legs that cannot be flown are rows
        with a `status` that says why.

    Raises
    ------
    InputError
        `method` is unknown, or `guess` does not fit the legs.
    MissingDependencyError
        pykep or pygmo is not installed.
    """
    solutions: LegSolutions = _solver(_MINIMUM_PROPELLANT, method)(legs, guess=guess)
    return solutions


def _solver(table: dict[str, str], method: str) -> Callable[..., Any]:
    if method not in table:
        known = ", ".join(repr(name) for name in table)
        raise InputError(f"method: {method!r} is unknown, expected one of {known}")
    # Imported on use: a solver may need pygmo or compiled kernels, the others do not.
    module, _, name = table[method].partition(":")
    solver: Callable[..., Any] = getattr(importlib.import_module(module), name)
    return solver
