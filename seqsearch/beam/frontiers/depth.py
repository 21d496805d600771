"""`DepthFrontier`: nodes compete with those of the same depth."""

from typing import final

import numpy as np
from numpy.typing import NDArray

from seqsearch.beam.frontiers.selection import select
from seqsearch.beam.rankings.protocol import Ranking
from seqsearch.core.nodes import Nodes, no_nodes
from seqsearch.core.problem import Problem
from seqsearch.settings import FrontierSettings


@final
class DepthFrontier:
    """Beam search: all nodes of one depth are expanded together, the best of them.

    Parameters
    ----------
    settings : FrontierSettings
        The caps of `select`.
    problem : Problem
        For the ranking.
    ranking : Ranking
        Which nodes are best.
    """

    def __init__(self, settings: FrontierSettings, problem: Problem, ranking: Ranking) -> None:
        self._settings = settings
        self._problem = problem
        self._ranking = ranking
        self._nodes = no_nodes()

    def admit(self, nodes: Nodes, /, width: int, spare: float = 1.0) -> NDArray[np.intp]:
        """Return the positions of the best nodes within the beam width and the caps."""
        if len(nodes) == 0:
            return np.zeros(0, dtype=np.intp)
        score = self._ranking.score(nodes, self._problem)
        return select(score, nodes, self._settings, width, spare)

    def push(self, nodes: Nodes, /) -> None:
        """Take in the next rank."""
        self._nodes = nodes

    def pop(self, width: int) -> Nodes:
        """Return the whole rank, which was best first when it was admitted."""
        nodes, self._nodes = self._nodes, no_nodes()
        at_start = len(nodes) == 0 or nodes.depth.min() == 0
        return nodes if at_start else nodes.take(np.arange(min(len(nodes), width)))

    def waiting(self) -> Nodes:
        """Return the next rank."""
        return self._nodes
