"""Full optimisation of the legs that survived pruning, in parallel and most promising first."""

from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from feasibility import Legs, LegSolutions, optimise
from feasibility.sims_flanagan import solve_max_initial_mass
from seqsearch.deadline import Deadline
from seqsearch.expansion import Candidates
from seqsearch.settings import SearchSettings

_CHUNK = 24
"""Legs of one task: some tens of milliseconds, so that a deadline is met and workers stay busy."""


@final
@dataclass(frozen=True, eq=False)
class Optimised:
    """Optimised legs: positions among the candidates, m*, minimum-propellant solutions.

    With n the number of flyable legs found.

    Attributes
    ----------
    candidate : (n,) intp
        Positions among the candidates, ascending.
    m_star : (n,) float64, kg
        Maximum initial masses.
    solutions : LegSolutions
        The n minimum-propellant legs, all converged.
    n_optimised : int
        Legs that were given to the solver, flyable or not.
    """

    candidate: NDArray[np.intp]
    m_star: NDArray[np.float64]
    solutions: LegSolutions
    n_optimised: int


def solve_legs(legs: Legs, solver: str) -> tuple[NDArray[np.float64], LegSolutions]:
    """Solve a batch of legs: m*, then minimum propellant where m0 <= m*.

    Parameters
    ----------
    legs : Legs
        n legs.
    solver : str
        Name of the leg solver.

    Returns
    -------
    m_star : (n,) float64, kg
        Maximum initial mass; 0 where none was found.
    solutions : LegSolutions
        Minimum-propellant legs; not converged where the leg cannot be flown.
    """
    heaviest = solve_max_initial_mass(legs, method=solver)
    return heaviest.m0, optimise(legs, method=solver, guess=heaviest)


@final
class LegOptimiser:
    """Finds, for each node and target, the shortest flight times that can be flown.

    Works in rounds: in each, the shortest untried flight time of every pair of
    node and target that still wants one is optimised. A pair is done after
    `flyable_per_target` flyable legs. The most promising pairs come first, up
    to `solves_per_rank` legs. What is optimised depends on results of whole
    rounds only, so it is the same with any number of workers.

    Parameters
    ----------
    settings : SearchSettings
        `solver`, `solves_per_rank` and `flyable_per_target`.
    executor : concurrent.futures.Executor, optional
        Where batches are solved; None for this process.
    """

    def __init__(self, settings: SearchSettings, executor: Executor | None = None) -> None:
        self._settings = settings
        self._executor = executor

    def run(
        self, candidates: Candidates, promise: NDArray[np.float64], deadline: Deadline
    ) -> Optimised:
        """Optimise candidates until each pair is served or a budget is used up.

        Parameters
        ----------
        candidates : Candidates
            n legs that survived pruning.
        promise : (n,) float64
            Predicted score of the node that each leg would lead to, smaller is better.
        deadline : Deadline
            After it no new batch is begun; what is finished counts.

        Returns
        -------
        Optimised
            The flyable legs that were found.
        """
        pairs = _pairs_shortest_first(candidates)
        progress = [0] * len(pairs)
        flyable = [0] * len(pairs)
        active = list(range(len(pairs)))
        budget = self._settings.solves_per_rank
        done: list[tuple[NDArray[np.intp], NDArray[np.float64], LegSolutions]] = []
        n_optimised = 0
        while active and budget > 0 and not deadline.passed():
            active.sort(key=lambda p: (promise[pairs[p][progress[p]]], p))
            active = active[:budget]
            rows = np.asarray([pairs[p][progress[p]] for p in active], dtype=np.intp)
            budget -= len(rows)
            solved = np.zeros(len(rows), dtype=bool)
            converged = np.zeros(len(rows), dtype=bool)
            for chunk, m_star, solutions in self._solve(candidates.legs, rows, deadline):
                solved[chunk] = True
                converged[chunk] = solutions.converged
                good = np.flatnonzero(solutions.converged)
                if len(good):
                    done.append((rows[chunk[good]], m_star[good], solutions.take(good)))
            n_optimised += int(solved.sum())
            still_active = []
            for p, ok in zip(active, converged, strict=True):
                progress[p] += 1
                flyable[p] += int(ok)
                wanted = flyable[p] < self._settings.flyable_per_target
                if wanted and progress[p] < len(pairs[p]):
                    still_active.append(p)
            active = still_active
        return _gather(done, n_optimised)

    def _solve(
        self, legs: Legs, rows: NDArray[np.intp], deadline: Deadline
    ) -> Iterator[tuple[NDArray[np.intp], NDArray[np.float64], LegSolutions]]:
        """Yield (positions in rows, m*, solutions) of the batches, as they are finished."""
        chunks = [np.arange(i, min(i + _CHUNK, len(rows))) for i in range(0, len(rows), _CHUNK)]
        solver = self._settings.solver
        if self._executor is None:
            for chunk in chunks:
                if deadline.passed():
                    return
                yield chunk, *solve_legs(legs.take(rows[chunk]), solver)
            return
        futures: dict[Future[tuple[NDArray[np.float64], LegSolutions]], NDArray[np.intp]] = {}
        try:
            for chunk in chunks:
                part = legs.take(rows[chunk])
                futures[self._executor.submit(solve_legs, part, solver)] = chunk
            while futures:
                finished, _ = wait(
                    futures, timeout=deadline.remaining_s(), return_when=FIRST_COMPLETED
                )
                if not finished:
                    return
                for future in finished:
                    yield futures.pop(future), *future.result()
        finally:
            for future in futures:
                future.cancel()


def _pairs_shortest_first(candidates: Candidates) -> list[NDArray[np.intp]]:
    """Group candidates by node and target, shortest time to arrival first."""
    legs = candidates.legs
    if len(candidates) == 0:
        return []
    departure = legs.t_dep_mjd2000
    assert departure is not None
    arrival = departure + legs.tof_days
    order = np.lexsort((legs.tof_days, arrival, candidates.target, candidates.parent))
    parent, target = candidates.parent[order], candidates.target[order]
    new = np.flatnonzero((np.diff(parent) != 0) | (np.diff(target) != 0)) + 1
    return np.split(order, new)


def _gather(
    done: list[tuple[NDArray[np.intp], NDArray[np.float64], LegSolutions]], n_optimised: int
) -> Optimised:
    """Put the flyable legs in the order of the candidates, whatever order they came in."""
    if not done:
        empty = LegSolutions.unsolved(0, 0)
        return Optimised(np.zeros(0, dtype=np.intp), np.zeros(0), empty, n_optimised)
    candidate = np.concatenate([rows for rows, _, _ in done])
    order = np.argsort(candidate)
    m_star = np.concatenate([m_star for _, m_star, _ in done])
    solutions = LegSolutions.concatenate([solutions for _, _, solutions in done])
    return Optimised(candidate[order], m_star[order], solutions.take(order), n_optimised)
