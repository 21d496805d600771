"""The paper's own label: convergence of the minimum-propellant problem from one random start."""

import time
from typing import Final

import numpy as np
from numpy.typing import NDArray

from feasibility.errors import InputError
from feasibility.legs import Legs
from feasibility.sims_flanagan.pykep_leg import N_SEGMENTS, confirm, scaled_leg
from feasibility.sims_flanagan.reference.pygmo_problems import MinimumPropellantProblem
from feasibility.sims_flanagan.solutions import (
    MISMATCH_TOLERANCE,
    THROTTLE_TOLERANCE,
    LegSolutions,
    Status,
)

_MAX_EVALUATIONS: Final = 1000


def converge_from_random_start(legs: Legs, rng: np.random.Generator) -> LegSolutions:
    """Maximise the final mass of each leg from one random start, by SLSQP.

    The start has throttle components uniform in [-1, 1] (cut to norm 1) and a
    final mass uniform between dry and initial mass.

    Parameters
    ----------
    legs : Legs
        n legs.
    rng : numpy.random.Generator
        Source of the starts; the starts of the first legs do not depend on how many follow.

    Returns
    -------
    LegSolutions
        n rows; `start` is 0 where the solver converged to a closed leg.

    Raises
    ------
    InputError
        A leg has free ends, which the paper's problem does not know.
    MissingDependencyError
        pykep or pygmo is not installed.
    """
    if legs.free_ends.any():
        raise InputError("label convergence: a leg has free ends, expected label margin")
    n = len(legs)
    found = LegSolutions.unsolved(n, N_SEGMENTS)
    draws = rng.random((n, 3 * N_SEGMENTS + 1))
    for row in range(n):
        began = time.process_time()
        throttles = _cut(2.0 * draws[row, :-1].reshape(-1, 3) - 1.0)
        lightest = legs.m_dry[row] / legs.m0[row]
        ratio = lightest + (1.0 - lightest) * draws[row, -1]
        throttles, ratio = _maximise_final_mass(legs, row, throttles, float(ratio))
        m_final = ratio * legs.m0[row]
        throttles = _cut(throttles, THROTTLE_TOLERANCE)
        mismatch = confirm(
            legs.take([row]), throttles[None], legs.m0[row : row + 1], np.array([m_final])
        ).item()
        norm = np.linalg.norm(throttles, axis=1).max()
        if mismatch <= MISMATCH_TOLERANCE and norm <= 1.0 + THROTTLE_TOLERANCE:
            found.throttles[row] = throttles
            found.m0[row] = legs.m0[row]
            found.m_final[row] = m_final
            found.mismatch[row] = mismatch
            found.start[row] = 0
            enough = m_final >= legs.m_dry[row]
            found.converged[row] = enough
            found.status[row] = Status.CONVERGED if enough else Status.BELOW_DRY_MASS
        found.seconds[row] = time.process_time() - began
    return found


def _cut(throttles: NDArray[np.float64], beyond: float = np.inf) -> NDArray[np.float64]:
    """Return the throttles with norms cut to 1 where they exceed it by at most `beyond`."""
    norms = np.linalg.norm(throttles, axis=1, keepdims=True)
    return np.where(norms <= 1.0 + beyond, throttles / np.maximum(norms, 1.0), throttles)


def _maximise_final_mass(
    legs: Legs, row: int, throttles: NDArray[np.float64], ratio: float
) -> tuple[NDArray[np.float64], float]:
    import pygmo

    leg = scaled_leg(legs, row, float(legs.m0[row]))
    problem = pygmo.problem(MinimumPropellantProblem(leg))
    problem.c_tol = MISMATCH_TOLERANCE / 2.0
    population = pygmo.population(problem)
    population.push_back(np.concatenate([throttles.ravel(), [ratio]]))
    solver = pygmo.nlopt("slsqp")
    solver.maxeval = _MAX_EVALUATIONS
    solver.ftol_rel = 1e-6
    solver.xtol_rel = 0.0
    x = pygmo.algorithm(solver).evolve(population).get_x()[0]
    return x[:-1].reshape(-1, 3), float(x[-1])
