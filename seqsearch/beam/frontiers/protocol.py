"""The `Frontier` protocol: which of the nodes that wait are expanded next."""

from collections.abc import Callable
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from seqsearch.beam.rankings.protocol import Ranking
from seqsearch.core.nodes import Nodes
from seqsearch.core.problem import Problem
from seqsearch.settings import SearchSettings


@runtime_checkable
class Frontier(Protocol):
    """Holds the nodes of a pass that wait for expansion.

    The search calls `push` with the start nodes, then in turn `pop`, `admit`
    with what was reached from there, and `push` with those that were admitted,
    until `pop` gives no nodes. All methods are deterministic. A frontier that
    is made anew and given the nodes of `waiting` goes on as the old one would
    have.
    """

    def admit(self, nodes: Nodes, /, width: int, spare: float = 1.0) -> NDArray[np.intp]:
        """Return the (k,) positions of nodes just reached that are worth going on with.

        Parameters
        ----------
        nodes : Nodes
            Not yet in the tree.
        width : int
            Beam width.
        spare : float
            Above 1 for nodes that are only predicted and of which some will fall away:
            about that many times as many are admitted.
        """
        ...

    def push(self, nodes: Nodes, /) -> None:
        """Take in nodes, which are in the tree now."""
        ...

    def pop(self, width: int) -> Nodes:
        """Remove and return the nodes to expand next; none when all is done.

        Starts are never mixed with others, and all of them are returned at once; of other
        nodes at most `width` are.
        """
        ...

    def waiting(self) -> Nodes:
        """Return all nodes that wait, in the order in which `push` wants them."""
        ...


MakeFrontier = Callable[[SearchSettings, Problem, Ranking], Frontier]
"""Makes the frontier of a pass from its settings, the problem and the ranking."""
