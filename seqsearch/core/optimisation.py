"""Full optimisation of the hops that survived pruning, in parallel and most promising first."""

from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from feasibility import LegSolutions, optimise
from feasibility.arrays import StructOfArrays
from feasibility.sims_flanagan import solve_max_initial_mass
from seqsearch.core.candidates import Candidates
from seqsearch.core.hops import Hops
from seqsearch.deadline import Deadline
from seqsearch.settings import SearchSettings

_CHUNK = 24
"""Hops of one task: some tens of milliseconds, so that a deadline is met and workers stay busy."""


@final
@dataclass(frozen=True, eq=False)
class SolvedHops(StructOfArrays):
    """Solved hops, one row a hop.

    With n the number of hops.

    Attributes
    ----------
    flyable : (n,) bool
        All legs were solved.
    m_star : tuple of (n,) float64, kg
        Maximum initial masses of the first legs, the second legs, and so on; 0 where none
        was found.
    solutions : tuple of LegSolutions
        Minimum-propellant solutions of the first legs, and so on; not converged where the
        leg, or one before it, cannot be flown.
    solved_legs : (n,) int64
        Legs of each hop that were given to the solver.
    """

    flyable: NDArray[np.bool_]
    m_star: tuple[NDArray[np.float64], ...]
    solutions: tuple[LegSolutions, ...]
    solved_legs: NDArray[np.int64]


def solve_hops(hops: Hops, solver: str) -> SolvedHops:
    """Solve a batch of hops: for each leg m*, then minimum propellant where m0 <= m*.

    Parameters
    ----------
    hops : Hops
        n hops; each leg is solved with the mass that the one before leaves.
    solver : str
        Name of the leg solver.
    """
    flyable = np.ones(len(hops), dtype=np.bool_)
    solved_legs = np.zeros(len(hops), dtype=np.int64)
    m_star, solutions = [], []
    mass: NDArray[np.float64] | None = None
    for legs, dropped in zip(hops.legs, hops.dropped_kg, strict=True):
        if mass is not None:
            flyable &= mass >= legs.m_dry
            legs = legs.with_m0(np.where(flyable, mass, np.maximum(legs.m0, legs.m_dry)))
        rows = np.flatnonzero(flyable)
        solved_legs[rows] += 1
        part = legs.take(rows)
        heaviest = solve_max_initial_mass(part, method=solver)
        solved = optimise(part, method=solver, guess=heaviest)
        solution = LegSolutions.unsolved(len(legs), solved.n_segments)
        for name in LegSolutions.__dataclass_fields__:
            getattr(solution, name)[rows] = getattr(solved, name)
        most = np.zeros(len(legs))
        most[rows] = heaviest.m0
        m_star.append(most)
        solutions.append(solution)
        flyable = flyable & solution.converged
        mass = solution.m_final - dropped
    return SolvedHops(flyable, tuple(m_star), tuple(solutions), solved_legs)


@final
@dataclass(frozen=True, eq=False)
class Optimised:
    """What an optimisation found.

    With n the number of flyable hops found.

    Attributes
    ----------
    candidate : (n,) intp
        Positions among the candidates, ascending.
    solved : SolvedHops or None
        The n flyable hops; None for none.
    n_legs : int
        Legs that were given to the solver, flyable or not.
    n_hops : int
        Hops that were.
    """

    candidate: NDArray[np.intp]
    solved: SolvedHops | None
    n_legs: int
    n_hops: int


@final
class LegOptimiser:
    """Finds, for each node and target, the shortest flight times that can be flown.

    Works in rounds: in each, the shortest untried flight time of every pair of
    node and target that still wants one is optimised. A pair is done after
    `flyable_per_target` flyable hops. The most promising pairs come first, up
    to `solves_per_rank` hops. What is optimised depends on results of whole
    rounds only, so it is the same with any number of workers.

    Parameters
    ----------
    executor : concurrent.futures.Executor, optional
        Where batches are solved; None for this process.
    """

    def __init__(self, executor: Executor | None = None) -> None:
        self._executor = executor

    def run(
        self,
        candidates: Candidates,
        promise: NDArray[np.float64],
        settings: SearchSettings,
        deadline: Deadline,
    ) -> Optimised:
        """Optimise candidates until each pair is served or a budget is used up.

        Parameters
        ----------
        candidates : Candidates
            n hops that survived pruning.
        promise : (n,) float64
            Predicted score of the node that each hop would lead to, smaller is better.
        settings : SearchSettings
            `solver`, `solves_per_rank` and `flyable_per_target`.
        deadline : Deadline
            After it no new batch is begun; what is finished counts.

        Returns
        -------
        Optimised
            The flyable hops that were found.
        """
        pairs = _pairs_shortest_first(candidates)
        progress = [0] * len(pairs)
        flyable = [0] * len(pairs)
        active = list(range(len(pairs)))
        budget = settings.solves_per_rank
        done: list[tuple[NDArray[np.intp], SolvedHops]] = []
        n_legs = n_hops = 0
        while active and budget > 0 and not deadline.passed():
            active.sort(key=lambda p: (promise[pairs[p][progress[p]]], p))
            active = active[:budget]
            rows = np.asarray([pairs[p][progress[p]] for p in active], dtype=np.intp)
            budget -= len(rows)
            converged = np.zeros(len(rows), dtype=bool)
            for chunk, solved in self._solve(candidates.hops, rows, settings.solver, deadline):
                n_legs += int(solved.solved_legs.sum())
                n_hops += len(chunk)
                converged[chunk] = solved.flyable
                good = np.flatnonzero(solved.flyable)
                if len(good):
                    done.append((rows[chunk[good]], solved.take(good)))
            still_active = []
            for p, ok in zip(active, converged, strict=True):
                progress[p] += 1
                flyable[p] += int(ok)
                wanted = flyable[p] < settings.flyable_per_target
                if wanted and progress[p] < len(pairs[p]):
                    still_active.append(p)
            active = still_active
        return _gather(done, n_legs, n_hops)

    def run_all(
        self,
        candidates: Candidates,
        promise: NDArray[np.float64],
        settings: SearchSettings,
        deadline: Deadline,
    ) -> Optimised:
        """Optimise candidates up to `solves_per_rank`, those of the least `promise` (n,) first."""
        rows = np.argsort(promise, kind="stable")[: settings.solves_per_rank]
        done: list[tuple[NDArray[np.intp], SolvedHops]] = []
        n_legs = n_hops = 0
        for chunk, solved in self._solve(candidates.hops, rows, settings.solver, deadline):
            n_legs += int(solved.solved_legs.sum())
            n_hops += len(chunk)
            good = np.flatnonzero(solved.flyable)
            if len(good):
                done.append((rows[chunk[good]], solved.take(good)))
        return _gather(done, n_legs, n_hops)

    def solve_all(self, hops: Hops, solver: str, deadline: Deadline) -> SolvedHops | None:
        """Optimise every one of n hops, at least one; None where the deadline came first."""
        parts = list(self._solve(hops, np.arange(len(hops)), solver, deadline))
        rows = np.concatenate([chunk for chunk, _ in parts]) if parts else np.zeros(0)
        if len(rows) < len(hops):
            return None
        return SolvedHops.concatenate([solved for _, solved in parts]).take(np.argsort(rows))

    def _solve(
        self, hops: Hops, rows: NDArray[np.intp], solver: str, deadline: Deadline
    ) -> Iterator[tuple[NDArray[np.intp], SolvedHops]]:
        """Yield (positions in rows, solved hops) of the batches, as they are finished."""
        chunks = [np.arange(i, min(i + _CHUNK, len(rows))) for i in range(0, len(rows), _CHUNK)]
        if self._executor is None:
            for chunk in chunks:
                if deadline.passed():
                    return
                yield chunk, solve_hops(hops.take(rows[chunk]), solver)
            return
        futures: dict[Future[SolvedHops], NDArray[np.intp]] = {}
        try:
            for chunk in chunks:
                part = hops.take(rows[chunk])
                futures[self._executor.submit(solve_hops, part, solver)] = chunk
            while futures:
                finished, _ = wait(
                    futures, timeout=deadline.remaining_s(), return_when=FIRST_COMPLETED
                )
                if not finished:
                    return
                for future in finished:
                    yield futures.pop(future), future.result()
        finally:
            for future in futures:
                future.cancel()


def _pairs_shortest_first(candidates: Candidates) -> list[NDArray[np.intp]]:
    """Group candidates by node and target, shortest time to arrival first."""
    if len(candidates) == 0:
        return []
    hops = candidates.hops
    order = np.lexsort((hops.tof_days, hops.t_arr_mjd2000, candidates.target, candidates.parent))
    parent, target = candidates.parent[order], candidates.target[order]
    new = np.flatnonzero((np.diff(parent) != 0) | (np.diff(target) != 0)) + 1
    return np.split(order, new)


def _gather(
    done: list[tuple[NDArray[np.intp], SolvedHops]], n_legs: int, n_hops: int
) -> Optimised:
    """Put the flyable hops in the order of the candidates, whatever order they came in."""
    if not done:
        return Optimised(np.zeros(0, dtype=np.intp), None, n_legs, n_hops)
    candidate = np.concatenate([rows for rows, _ in done])
    order = np.argsort(candidate)
    solved = SolvedHops.concatenate([solved for _, solved in done]).take(order)
    return Optimised(candidate[order], solved, n_legs, n_hops)
