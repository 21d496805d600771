"""Rankings: which nodes of a rank are worth going on with."""

from dataclasses import dataclass
from typing import Protocol, final, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from seqsearch.core.nodes import Nodes
from seqsearch.core.problem import TourProblem


@runtime_checkable
class Ranking(Protocol):
    """Scores nodes that compete with each other; the smallest scores go on.

    The contract: one finite score a node, and pure. A node's score may depend
    on the other nodes of the batch, as a Pareto rank does, but not on the order
    in which they come. A batch of a single node is legal.
    """

    def score(self, nodes: Nodes, problem: TourProblem, /) -> NDArray[np.float64]:
        """Return (n,) float64, smaller is better."""
        ...


@final
@dataclass(frozen=True)
class TimePropellantRanking:
    """Weighted sum of the shares of time and propellant that are used up.

    Parameters
    ----------
    time_weight, propellant_weight : float
        Weights of elapsed time over the problem's duration and of used over
        total propellant.
    """

    time_weight: float = 1.0
    propellant_weight: float = 0.6

    def score(self, nodes: Nodes, problem: TourProblem, /) -> NDArray[np.float64]:
        """Return (n,) float64, smaller is better."""
        elapsed = (nodes.t_arr_mjd2000 - nodes.t_first_mjd2000) / problem.max_duration_days
        used = (problem.m0 - nodes.mass) / (problem.m0 - problem.spacecraft.m_dry)
        return self.time_weight * elapsed + self.propellant_weight * used
