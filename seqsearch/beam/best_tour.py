"""`BestTour`: remembers the node that ends the best tour so far."""

from typing import Protocol, final

import numpy as np

from seqsearch.beam.state import SearchState
from seqsearch.core.nodes import Nodes
from seqsearch.core.problem import Problem
from seqsearch.settings import SearchSettings


class Best(Protocol):
    """Remembers the best tour of a search."""

    def note(self, nodes: Nodes, state: SearchState) -> None:
        """Put the best of some nodes in the tree into the state, if it is better than before."""
        ...


@final
class BestTour:
    """Compares new nodes with the best one so far; a `Best`.

    Passes may rank differently; which of two tours is better does not depend on it.

    Parameters
    ----------
    problem : Problem
        Says which of equally deep nodes is better, and completes its tour.
    settings : SearchSettings
        Settings of the search, not those of a pass.
    """

    def __init__(self, problem: Problem, settings: SearchSettings) -> None:
        self._problem = problem
        self._settings = settings

    def note(self, nodes: Nodes, state: SearchState) -> None:
        """Remember the deepest of some nodes in the tree, if it is better than the best so far."""
        if len(nodes) == 0:
            return
        deepest = nodes.take(nodes.depth == nodes.depth.max())
        costs = self._problem.tour_cost(deepest, self._settings)
        best = int(np.argmin(costs))
        key = (int(deepest.depth[0]), -float(costs[best]))
        if key > state.best_key:
            node = int(deepest.tree_id[best])
            end = state.tree.node(node)
            closing = self._problem.closing(end["row"], end["t_mjd2000"], end["mass"])
            state.best_key, state.best_node, state.closing = key, node, closing
