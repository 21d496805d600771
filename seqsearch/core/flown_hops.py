"""`FlownHops`: what an expansion of nodes has reached."""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from seqsearch.core.candidates import Candidates, reached
from seqsearch.core.nodes import Nodes, no_nodes
from seqsearch.core.optimisation import Optimised, SolvedHops
from seqsearch.core.problem import Problem
from seqsearch.core.tree import FlownLeg, with_excess


@final
@dataclass(frozen=True, eq=False)
class FlownHops:
    """Flyable hops, the nodes to which they lead, and what it took to find them.

    With n the number of flyable hops.

    Attributes
    ----------
    nodes : Nodes
        Where the n hops lead, not yet in the tree.
    n_hops : int
        Hops that were optimised, flyable or not.
    n_legs : int
        Legs of theirs that were given to the solver.
    solved : tuple of (Candidates, SolvedHops) or None
        The n hops and their solutions; None for none.
    """

    nodes: Nodes
    n_hops: int = 0
    n_legs: int = 0
    solved: tuple[Candidates, SolvedHops] | None = None

    @classmethod
    def none(cls) -> "FlownHops":
        """Return what there is where nothing was worth optimising."""
        return cls(no_nodes())

    @classmethod
    def of(
        cls, problem: Problem, parents: Nodes, candidates: Candidates, optimised: Optimised
    ) -> "FlownHops":
        """Return those of the candidates, from nodes `parents`, that were found flyable."""
        found = optimised.solved
        if found is None:
            return cls(no_nodes(), optimised.n_hops, optimised.n_legs)
        flown = candidates.take(optimised.candidate)
        last = found.solutions[-1]
        nodes = reached(problem, parents, flown, last.m_final, last.arr_excess)
        return cls(nodes, optimised.n_hops, optimised.n_legs, (flown, found))

    def legs(self, problem: Problem, rows: NDArray[np.intp]) -> list[tuple[FlownLeg, ...]]:
        """Return the legs of the hops at the given positions, as the tree has them."""
        chains: list[tuple[FlownLeg, ...]] = [() for _ in range(len(rows))]
        if self.solved is None:
            return chains
        flown, solved = self.solved[0].take(rows), self.solved[1].take(rows)
        columns = zip(
            flown.hops.legs, flown.hops.dropped_kg, solved.m_star, solved.solutions, strict=True
        )
        for legs, dropped, m_star, solution in columns:
            assert legs.t_dep_mjd2000 is not None
            assert legs.dep_id is not None
            assert legs.arr_id is not None
            dep_row = problem.catalogue.rows_of(legs.dep_id)
            arr_row = problem.catalogue.rows_of(legs.arr_id)
            for i in range(len(legs)):
                leg = FlownLeg(
                    dep_row=int(dep_row[i]),
                    arr_row=int(arr_row[i]),
                    rv_dep=with_excess(legs.rv_dep[i], solution.dep_excess[i]),
                    rv_arr=with_excess(legs.rv_arr[i], solution.arr_excess[i]),
                    t_dep_mjd2000=float(legs.t_dep_mjd2000[i]),
                    tof_days=float(legs.tof_days[i]),
                    m0=float(solution.m0[i]),
                    m_final=float(solution.m_final[i]),
                    m_star=float(m_star[i]),
                    dropped=float(dropped[i]),
                    throttles=solution.throttles[i],
                    mismatch=float(solution.mismatch[i]),
                )
                chains[i] += (leg,)
        return chains
