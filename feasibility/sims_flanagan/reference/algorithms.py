"""pygmo's optimisers with the settings that the reference solver uses."""

import functools
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from feasibility.sims_flanagan.solutions import MISMATCH_TOLERANCE

_CONSTRAINT_ROUNDING: Final = 1e-7


def evolve(problem: Any, guess: NDArray[np.float64], algorithm: Any = None) -> NDArray[np.float64]:
    """Return what an algorithm, IPOPT unless given, makes of a decision vector."""
    import pygmo

    algorithm = algorithm or ipopt()

    wrapped = pygmo.problem(problem)
    # pygmo keeps the guess unless the result is better under these tolerances.
    wrapped.c_tol = [0.5 * MISMATCH_TOLERANCE] * 7 + [_CONSTRAINT_ROUNDING] * problem.get_nic()
    lower, upper = wrapped.get_bounds()
    population = pygmo.population(wrapped)
    population.push_back(np.clip(guess, lower, upper))
    x: NDArray[np.float64] = algorithm.evolve(population).get_x()[0]
    return x


@functools.cache
def ipopt() -> Any:
    """Return IPOPT, as the reference uses it."""
    import pygmo

    solver = pygmo.ipopt()
    solver.set_string_options({"sb": "yes"})
    solver.set_integer_options({"print_level": 0, "max_iter": 200})
    # An objective to 5 digits is enough; the constraints have to be far below the tolerance.
    solver.set_numeric_options({"tol": 1e-5, "constr_viol_tol": 1e-7})
    return pygmo.algorithm(solver)


@functools.cache
def slsqp() -> Any:
    """Return SLSQP, as the reference uses it."""
    import pygmo

    solver = pygmo.nlopt("slsqp")
    solver.maxeval = 1000
    solver.ftol_rel = 1e-6
    solver.xtol_rel = 0.0
    return pygmo.algorithm(solver)
