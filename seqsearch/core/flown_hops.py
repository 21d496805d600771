"""`FlownHops`: what an expansion of nodes has reached."""

from dataclasses import dataclass
from typing import final

from seqsearch.core.candidates import Candidates, reached
from seqsearch.core.nodes import Nodes
from seqsearch.core.optimisation import Optimised, SolvedHops
from seqsearch.core.problem import TourProblem
from seqsearch.core.tree import FlownLeg


@final
@dataclass(frozen=True, eq=False)
class FlownHops:
    """Flyable hops and the nodes that they lead to, n each.

    Attributes
    ----------
    flown : Candidates
        The hops.
    solved : SolvedHops
        Their solutions.
    nodes : Nodes
        Where they lead, not yet in the tree.
    """

    flown: Candidates
    solved: SolvedHops
    nodes: Nodes

    @classmethod
    def of(
        cls, problem: TourProblem, parents: Nodes, candidates: Candidates, optimised: Optimised
    ) -> "FlownHops":
        """Return those of the candidates, from nodes `parents`, that were found flyable."""
        assert optimised.solved is not None
        flown = candidates.take(optimised.candidate)
        m_final = optimised.solved.solutions[-1].m_final
        return cls(flown, optimised.solved, reached(problem, parents, flown, m_final))


def flown_legs(
    problem: TourProblem, flown: Candidates, solved: SolvedHops
) -> list[tuple[FlownLeg, ...]]:
    """Return the legs of each hop."""
    chains: list[tuple[FlownLeg, ...]] = [() for _ in range(len(flown))]
    stages = zip(
        flown.hops.stages, flown.hops.dropped_kg, solved.m_star, solved.solutions, strict=True
    )
    for legs, dropped, m_star, solution in stages:
        assert legs.t_dep_mjd2000 is not None
        assert legs.dep_id is not None
        assert legs.arr_id is not None
        dep_row = problem.catalogue.rows_of(legs.dep_id)
        arr_row = problem.catalogue.rows_of(legs.arr_id)
        for i in range(len(legs)):
            leg = FlownLeg(
                dep_row=int(dep_row[i]),
                arr_row=int(arr_row[i]),
                rv_dep=legs.rv_dep[i],
                rv_arr=legs.rv_arr[i],
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
