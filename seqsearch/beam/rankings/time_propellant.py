"""`TimePropellantRanking`: the less time and propellant a node has used up, the better."""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from seqsearch.core.mission import used_up
from seqsearch.core.nodes import Nodes
from seqsearch.core.problem import Problem


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

    def score(self, nodes: Nodes, problem: Problem, /) -> NDArray[np.float64]:
        """Return (n,) float64, smaller is better."""
        return used_up(
            nodes,
            max_duration_days=problem.max_duration_days,
            m0=problem.m0,
            m_dry=problem.spacecraft.m_dry,
            time_weight=self.time_weight,
            propellant_weight=self.propellant_weight,
        )
