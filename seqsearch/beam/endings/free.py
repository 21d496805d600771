"""`FreeEnds`: tours may end after any visit."""

from typing import final

import numpy as np
from numpy.typing import NDArray

from seqsearch.beam.best_tour import Best, BestTour
from seqsearch.beam.frontiers.protocol import Frontier
from seqsearch.beam.rankings.protocol import Ranking
from seqsearch.budget import Budget
from seqsearch.core.nodes import Nodes
from seqsearch.core.optimisation import LegOptimiser
from seqsearch.core.problem import Problem
from seqsearch.settings import SearchSettings


@final
class FreeEnds:
    """Leaves all as it is; an `Ends`.

    Parameters
    ----------
    problem : Problem
        What to solve.
    """

    def __init__(self, problem: Problem) -> None:
        self._problem = problem

    def ranking(self, ranking: Ranking) -> Ranking:
        """Return the ranking as it is."""
        return ranking

    def frontier(self, frontier: Frontier) -> Frontier:
        """Return the frontier as it is."""
        return frontier

    def reachable(self, nodes: Nodes) -> NDArray[np.bool_]:
        """Return (n,) True."""
        return np.ones(len(nodes), dtype=np.bool_)

    def best(
        self,
        settings: SearchSettings,
        optimiser: LegOptimiser,  # noqa: ARG002
        budget: Budget,  # noqa: ARG002
    ) -> Best:
        """Return what compares nodes."""
        return BestTour(self._problem, settings)
