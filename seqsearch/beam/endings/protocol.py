"""The `Ends` protocol: what a search asks about the ends of tours."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from seqsearch.beam.best_tour import Best
from seqsearch.beam.frontiers.protocol import Frontier
from seqsearch.beam.rankings.protocol import Ranking
from seqsearch.budget import Budget
from seqsearch.core.nodes import Nodes
from seqsearch.core.optimisation import LegOptimiser
from seqsearch.settings import SearchSettings


class Ends(Protocol):
    """How beams look to the ends of tours, and which tours are complete."""

    def ranking(self, ranking: Ranking) -> Ranking:
        """Return a ranking that also has the end in view."""
        ...

    def frontier(self, frontier: Frontier) -> Frontier:
        """Return a frontier that gives up nodes from which there is no way to the end."""
        ...

    def reachable(self, nodes: Nodes) -> NDArray[np.bool_]:
        """Return (n,) whether tours may well end after each of n nodes."""
        ...

    def best(self, settings: SearchSettings, optimiser: LegOptimiser, budget: Budget) -> Best:
        """Return what remembers the best tour; it may have to fly the last leg for that."""
        ...
