"""`ParetoRanking`: fronts of nodes that no other node beats in both time and propellant."""

import bisect
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from seqsearch.beam.rankings.protocol import Ranking
from seqsearch.core.nodes import Nodes
from seqsearch.core.problem import Problem


@final
@dataclass(frozen=True)
class ParetoRanking:
    """Orders nodes by their Pareto front in elapsed time and mass.

    A beam kept by weights alone loses the slow and thrifty nodes that another
    weight would have liked; whole fronts keep both ends.

    Parameters
    ----------
    within : Ranking
        Orders the nodes of one front; its scores may not be negative.
    """

    within: Ranking

    def score(self, nodes: Nodes, problem: Problem, /) -> NDArray[np.float64]:
        """Return (n,) float64: number of the front from 0, plus less than 1 from `within`."""
        elapsed = nodes.t_arr_mjd2000 - nodes.t_first_mjd2000
        inner = self.within.score(nodes, problem)
        return pareto_fronts(elapsed, -nodes.mass) + inner / (1.0 + inner)


def pareto_fronts(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the front of each point where both coordinates are to be small.

    A point dominates another if it is no larger in both coordinates and smaller
    in one. Front 0 is dominated by none, front k + 1 only by points of the fronts
    up to k. With two coordinates a sweep by x needs only the least y of each front
    (Jensen 2003, IEEE Trans. Evol. Comput. 7, section III).

    Parameters
    ----------
    x, y : (n,) float64
        Coordinates.

    Returns
    -------
    (n,) int64
        Number of the front, from 0.
    """
    fronts = np.zeros(len(x), dtype=np.int64)
    # The least y of each front so far; it rises from front to front. A front dominates
    # a new point exactly where its least y is not above the point's.
    least: list[float] = []
    previous = -1
    for i in np.lexsort((y, x)):
        if previous >= 0 and x[i] == x[previous] and y[i] == y[previous]:
            fronts[i] = fronts[previous]
            continue
        k = bisect.bisect_right(least, float(y[i]))
        if k == len(least):
            least.append(float(y[i]))
        else:
            least[k] = float(y[i])
        fronts[i] = k
        previous = int(i)
    return fronts
