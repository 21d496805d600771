"""Rankings and frontiers of tours that have to end somewhere, wrapped around others."""

from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from seqsearch.beam.endings.outlook import EndOutlook
from seqsearch.beam.frontiers.protocol import Frontier
from seqsearch.beam.rankings.protocol import Ranking
from seqsearch.core.nodes import Nodes
from seqsearch.core.problem import Problem

_MISSING: Final = 0.12
"""What a body that has still to be visited costs in the score: about what a visit does."""


@final
class HomeboundRanking:
    """Scores nodes as they would be after the way home, the later the more so; a `Ranking`.

    Early in a tour the way home from a node says nothing, as there are visits to come. A typical
    cost of the way, the median of the batch, is left out: so that early and late nodes compare.

    Parameters
    ----------
    base : Ranking
        Scores what has been used up.
    outlook : EndOutlook
        Looks to the end.
    """

    def __init__(self, base: Ranking, outlook: EndOutlook) -> None:
        self._base = base
        self._outlook = outlook

    def score(self, nodes: Nodes, problem: Problem, /) -> NDArray[np.float64]:
        """Return (n,) float64, smaller is better."""
        score = self._base.score(nodes, problem)
        if len(nodes) == 0:
            return score
        missing = self._outlook.ending.missing(nodes)
        score = score + _MISSING * missing
        homecoming = self._outlook.homecoming(nodes)
        late = homecoming.weight > 0.0
        if self._outlook.ending.row is None or not late.any():
            return score
        some = nodes.take(late)
        there = self._outlook.at_home(nodes, homecoming).take(late)
        way = self._base.score(there, problem) - self._base.score(some, problem)
        score[late] += homecoming.weight[late] * (way - np.median(way))
        return score


@final
class HomeboundFrontier:
    """Gives up nodes from which there is no way to the end; a `Frontier`.

    Parameters
    ----------
    base : Frontier
        Decides about the others.
    outlook : EndOutlook
        Looks to the end.
    """

    def __init__(self, base: Frontier, outlook: EndOutlook) -> None:
        self._base = base
        self._outlook = outlook

    def admit(self, nodes: Nodes, /, width: int, spare: float = 1.0) -> NDArray[np.intp]:
        """Return the positions of the best nodes that can come to the end."""
        if len(nodes) == 0:
            return self._base.admit(nodes, width, spare)
        rows = self._outlook.hopeful(nodes)
        return rows[self._base.admit(self._outlook.taken(nodes, rows), width, spare)]

    def push(self, nodes: Nodes, /) -> None:
        """Take in nodes."""
        self._base.push(nodes)

    def pop(self, width: int) -> Nodes:
        """Return the nodes to expand next."""
        return self._base.pop(width)

    def waiting(self) -> Nodes:
        """Return all nodes that wait."""
        return self._base.waiting()
