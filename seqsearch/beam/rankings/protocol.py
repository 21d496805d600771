"""The `Ranking` protocol: which nodes are worth going on with."""

from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from seqsearch.core.nodes import Nodes
from seqsearch.core.problem import Problem


@runtime_checkable
class Ranking(Protocol):
    """Scores nodes that compete with each other; the smallest scores go on.

    The contract: one finite score a node, and pure. A node's score may depend
    on the other nodes of the batch, as a Pareto rank does, but not on the order
    in which they come. A batch of a single node is legal.
    """

    def score(self, nodes: Nodes, problem: Problem, /) -> NDArray[np.float64]:
        """Return (n,) float64, smaller is better."""
        ...
