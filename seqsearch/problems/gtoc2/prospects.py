"""`Prospects`: which targets of each node are worth questions."""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from feasibility.arrays import StructOfArrays
from seqsearch.core.nodes import Nodes
from seqsearch.problems.gtoc2.outlook import Outlook

_Array = NDArray[np.float64]
_Rows = NDArray[np.intp]


@final
@dataclass(frozen=True, eq=False)
class Pairs(StructOfArrays):
    """Nodes and targets, one row a pair.

    With n the number of pairs, ordered by node.

    Attributes
    ----------
    parent : (n,) intp
        Positions of the nodes.
    target : (n,) intp
        Catalogue rows of the targets.
    left : (n,) intp
        Sets of groups that are still to be visited after the target.
    shortest_days : (n,) float64
        Flight times at full thrust, if phases fit perfectly.
    """

    parent: _Rows
    target: _Rows
    left: _Rows
    shortest_days: _Array


@final
@dataclass(frozen=True, eq=False)
class Prospects:
    """Orders the targets of nodes by the scores that tours may come to by way of them.

    Parameters
    ----------
    outlook : Outlook
        Forecasts scores.
    nodes : Nodes
        The nodes that are expanded.
    """

    outlook: Outlook
    nodes: Nodes

    def pairs(self, block: _Rows, free_m_s: float, count: int) -> Pairs:
        """Return some nodes with the best of their targets, if phases fit perfectly.

        Parameters
        ----------
        block : (b,) intp
            Positions of nodes from which at least one group is left.
        free_m_s : float
            Velocity change that costs nothing, at a launch.
        count : int
            Targets of each node, at most.
        """
        outlook, nodes = self.outlook, self.nodes
        groups = outlook.groups
        left = groups.left(nodes.visited[block])
        i, target = np.nonzero(groups.contain(left[:, None], np.arange(len(outlook.delta_v))))
        parent = block[i]
        need = np.maximum(outlook.delta_v[nodes.row[parent], target] - free_m_s, 0.0)
        pairs = Pairs(
            parent,
            target,
            groups.without(left[i], target),
            outlook.burn_days(nodes.mass[parent], need),
        )
        return pairs.take(self.best(pairs, pairs.shortest_days, count))

    def best(self, pairs: Pairs, tof_days: _Array, count: int) -> _Rows:
        """Return the rows of the best `count` pairs of each node, best first.

        Parameters
        ----------
        pairs : Pairs
            n pairs.
        tof_days : (n,) float64
            Flight times, all of them at full thrust; NaN for impossible.
        count : int
            How many of each node.
        """
        nodes, outlook = self.nodes, self.outlook
        at = np.flatnonzero(np.isfinite(tof_days))
        some, tof = pairs.take(at), tof_days[at]
        before = nodes.t_ready_mjd2000[some.parent] - nodes.t_first_mjd2000[some.parent]
        mass = nodes.mass[some.parent] - outlook.kg_per_day * tof
        score = outlook.score(some.target, some.left, before + tof, mass)
        order = np.lexsort((-score, some.parent))
        parent = some.parent[order]
        first = np.searchsorted(parent, parent)
        return at[order[np.arange(len(order)) - first < count]]
