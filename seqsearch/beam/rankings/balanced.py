"""`BalancedRanking`: a node needs time and propellant, and is worth little without either."""

from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from seqsearch.core.nodes import Nodes
from seqsearch.core.problem import Problem

_LEAST: Final = 1e-6
"""Shares are held above this: nothing left is worth as much as almost nothing."""


@final
@dataclass(frozen=True)
class BalancedRanking:
    """Weighted harmonic mean of the shares of time and propellant that are left.

    With shares t and m left and weights a and b, the score is

        (a + b) - (a + b)^2 / (a / t + b / m).

    Where t = m, score and derivatives are those of the weighted sum of the shares used
    up (`TimePropellantRanking`). Elsewhere what is scarcer counts more: a node with
    half a year and no propellant has nowhere to go, though it leads by the sum.

    Parameters
    ----------
    time_weight, propellant_weight : float
        The weights a and b; one of them may be zero.
    """

    time_weight: float = 1.0
    propellant_weight: float = 0.6

    def score(self, nodes: Nodes, problem: Problem, /) -> NDArray[np.float64]:
        """Return (n,) float64, smaller is better."""
        elapsed = nodes.t_arr_mjd2000 - nodes.t_first_mjd2000
        time = np.maximum(1.0 - elapsed / problem.max_duration_days, _LEAST)
        propellant = problem.m0 - problem.spacecraft.m_dry
        mass = np.maximum((nodes.mass - problem.spacecraft.m_dry) / propellant, _LEAST)
        total = self.time_weight + self.propellant_weight
        score: NDArray[np.float64] = total - total**2 / (
            self.time_weight / time + self.propellant_weight / mass
        )
        return score
