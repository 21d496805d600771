"""`Pool`: the most promising itineraries that scouts have found so far."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, Self, final

import numpy as np
from numpy.typing import NDArray

from feasibility.arrays import StructOfArrays
from seqsearch.beam.rankings.protocol import Ranking
from seqsearch.core.nodes import Nodes, no_nodes
from seqsearch.core.problem import Problem

_SIZE: Final = 1500
_PER_NICHE: Final = 20
"""Most itineraries of the pool, and of one niche."""

_TIRING: Final = 0.003
"""By how much the value of a niche falls each time that it is looked at again."""


@final
@dataclass(frozen=True, eq=False)
class Pool(StructOfArrays):
    """Itineraries, best first, no two of which visit the same bodies.

    A *niche* is a region of bodies and epochs that different itineraries have in common: those
    with the same bodies in the first half of the tour, the first two left aside, are of one.
    With n the number of itineraries.

    Attributes
    ----------
    nodes : Nodes
        Ends of the n itineraries, with predicted masses and epochs.
    times_picked : (n,) int64
        How often scouts were sent to the itinerary's niche.
    flown : (n,) bool
        Whether its legs have been optimised.
    """

    nodes: Nodes
    times_picked: NDArray[np.int64]
    flown: NDArray[np.bool_]

    @classmethod
    def empty(cls) -> Self:
        """Return a pool without itineraries."""
        return cls(no_nodes(), np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.bool_))

    def merged(
        self,
        found: Sequence[tuple[Nodes, int]],
        ranking: Ranking,
        problem: Problem,
    ) -> "Pool":
        """Return the pool with new itineraries, ordered by what they are worth now.

        One visit more is worth what a visit of the best of the longest itineraries costs.

        Parameters
        ----------
        found : sequence of (Nodes, int)
            Ends of itineraries and how often their niche was picked, of each scout.
        ranking : Ranking
            Scores ends; smaller is better.
        problem : Problem
            For the ranking.
        """
        parts = [(nodes, times) for nodes, times in found if len(nodes) and nodes.depth.max() > 0]
        if not parts:
            return self
        pool = Pool(
            Nodes.concatenate([self.nodes, *(nodes for nodes, _ in parts)]),
            np.concatenate([self.times_picked, *(np.full(len(n), times) for n, times in parts)]),
            np.concatenate([self.flown, np.zeros(sum(len(n) for n, _ in parts), dtype=np.bool_)]),
        )
        # Of the same bodies in another order or at other epochs the better one stays; what has
        # been flown stays flown, or the same tour would be flown again and again.
        cost = _cost(pool.nodes, ranking, problem)
        order = np.argsort(cost, kind="stable")
        bodies = np.sort(pool.nodes.visited, axis=1)[order]
        _, first, group = np.unique(bodies, axis=0, return_index=True, return_inverse=True)
        flown = np.zeros(len(first), dtype=np.bool_)
        np.logical_or.at(flown, group.ravel(), pool.flown[order])
        kept = np.argsort(first)
        pool = replace(pool.take(order[first[kept]]), flown=flown[kept])
        niche = pool.niches()
        crowd = np.zeros(niche.max() + 1, dtype=np.int64)
        rows = []
        for row, number in enumerate(niche.tolist()):
            crowd[number] += 1
            if crowd[number] <= _PER_NICHE:
                rows.append(row)
        return pool.take(np.asarray(rows[:_SIZE], dtype=np.intp))

    def niches(self) -> NDArray[np.intp]:
        """Return (n,) the number of each itinerary's niche."""
        half = np.maximum(1, self.nodes.depth // 2)
        place = np.arange(self.nodes.visited.shape[1])
        middle = (place >= 2) & (place < 2 + half[:, None])
        bodies = np.sort(np.where(middle, self.nodes.visited, -1), axis=1)
        _, number = np.unique(bodies, axis=0, return_inverse=True)
        return number.ravel()

    def choose(
        self, count: int, ranking: Ranking, problem: Problem
    ) -> tuple["Pool", NDArray[np.intp]]:
        """Choose itineraries near which to look again, the best of their niches.

        Those of niches that were picked often stand back a little further each time.

        Returns
        -------
        pool : Pool
            The pool with these choices counted.
        rows : (count,) intp
            The itineraries; the same one more than once if there are few.
        """
        if count == 0:
            return self, np.zeros(0, dtype=np.intp)
        _, champions = np.unique(self.niches(), return_index=True)
        cost = _cost(self.nodes, ranking, problem)[champions]
        times_picked = self.times_picked.copy()
        rows = []
        for _ in range(count):
            row = champions[np.argmin(cost + _TIRING * times_picked[champions])]
            times_picked[row] += 1
            rows.append(row)
        return replace(self, times_picked=times_picked), np.asarray(rows, dtype=np.intp)

    def unflown(self, count: int) -> tuple["Pool", Nodes]:
        """Return the pool with its best unflown itineraries marked as flown, and their ends."""
        rows = np.flatnonzero(~self.flown)[:count]
        flown = self.flown.copy()
        flown[rows] = True
        return replace(self, flown=flown), self.nodes.take(rows)


def _cost(nodes: Nodes, ranking: Ranking, problem: Problem) -> NDArray[np.float64]:
    """Return (n,) the scores of nodes less what their visits are worth."""
    score = ranking.score(nodes, problem)
    deepest = nodes.depth.max()
    worth = score[nodes.depth == deepest].min() / max(1, deepest)
    cost: NDArray[np.float64] = score - worth * nodes.depth
    return cost
