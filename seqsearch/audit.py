"""The audit: some pruned candidates are optimised all the same, to see what pruning costs.

Nearly all pruned candidates are far from flyable, and a plain sample would be
spent on them. So those of a rank are first thinned out at random, the rest is
sorted into strata by predicted margin, and every stratum gets a share of the
solves. The estimates account for what each solved candidate stands for, see
`audit_estimate`. A sample of the kept candidates tells how many of those can be
flown.

The audit draws from a stream of its own and changes nothing of the search.
"""

import copy
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.pruners.predictor import LegPredictor
from seqsearch.audit_estimate import RankAudit, Stratum
from seqsearch.deadline import Deadline
from seqsearch.expansion import Candidates, reached
from seqsearch.nodes import Nodes
from seqsearch.optimisation import LegOptimiser
from seqsearch.tour_problem import TourProblem

_THINNED: Final = 10_000
"""Pruned candidates of a rank whose margins are predicted: a fraction of a second."""

_MARGINS: Final = (0.7, 0.9, 1.0)
"""Limits between the strata of predicted margin m*/m0."""

_LABELS: Final = ("below 0.7", "0.7 to 0.9", "0.9 to 1", "1 or more", "unknown")
_UNKNOWN: Final = 4

_SHARES: Final = (0.4, 0.2, 0.2, 0.1, 0.1)
"""Shares of the strata in the solves.

If some percent of the legs near the boundary are falsely pruned and of those far away next to
none, but those are a hundred times as many, the variance is least (Neyman) with
about as many solves far away as in the other strata together.
"""


@final
@dataclass(frozen=True, eq=False)
class _Group:
    """Candidates drawn at random from a stratum, and the number that they were drawn from."""

    label: str
    population: float
    drawn: Candidates


@final
class RankSample:
    """Draws a sample of one rank's candidates while they pass by, and solves it.

    The sample depends on the candidates and their order, and not on the blocks
    in which they come.

    Parameters
    ----------
    rng : numpy.random.Generator
        Stream of the search; it is not advanced.
    rank_index : int
        Tells the ranks of a search apart.
    solves : int
        Pruned candidates to solve; half as many kept ones are solved too.
    predictor : LegPredictor, optional
        Sorts candidates into strata; without it there is a single one.
    """

    def __init__(
        self,
        rng: np.random.Generator,
        rank_index: int,
        solves: int,
        predictor: LegPredictor | None,
    ) -> None:
        seed = int(copy.deepcopy(rng).integers(2**63))
        self._rng = np.random.default_rng([seed, rank_index])
        self._solves = solves
        self._predictor = predictor
        self._n_pruned = 0
        self._lots = np.zeros(0)
        self._thinned: Candidates | None = None

    def offer(self, block: Candidates, kept: NDArray[np.bool_]) -> None:
        """Look at the next n candidates and at the pruner's answer, (n,) True for kept.

        The candidates with the smallest random lots of all stay.
        """
        pruned = np.flatnonzero(~kept)
        self._n_pruned += len(pruned)
        n_before = len(self._lots)
        lots = np.concatenate([self._lots, self._rng.random(len(pruned))])
        if len(lots) > _THINNED:
            stay = np.sort(np.argpartition(lots, _THINNED - 1)[:_THINNED])
        else:
            stay = np.arange(len(lots))
        new = block.take(pruned[stay[stay >= n_before] - n_before])
        if self._thinned is None:
            self._thinned = new
        else:
            old = self._thinned.take(stay[stay < n_before])
            self._thinned = Candidates.concatenate([old, new])
        self._lots = lots[stay]

    def solve(
        self,
        problem: TourProblem,
        nodes: Nodes,
        kept: Candidates | None,
        optimiser: LegOptimiser,
        solver: str,
        deadline: Deadline,
        contends: Callable[[Nodes], NDArray[np.bool_]],
    ) -> RankAudit | None:
        """Optimise the sample.

        Parameters
        ----------
        problem, nodes
            Problem, and the nodes that the candidates start from.
        kept : Candidates or None
            All candidates that the pruner kept.
        optimiser, solver, deadline
            As for the candidates that were kept.
        contends : callable
            Tells of n nodes which would have gone on, (n,) bool.

        Returns
        -------
        RankAudit or None
            None where the deadline came first: what is solved by then is no
            random sample.
        """
        pruned, rest = self._pruned_groups(), self._kept_groups(kept)
        groups = [*pruned, *rest]
        if not groups:
            return RankAudit(pruned=(), kept=())
        drawn = Candidates.concatenate([group.drawn for group in groups])
        solved = optimiser.solve_all(drawn.hops, solver, deadline)
        if solved is None:
            return None
        contender = np.zeros(len(drawn), dtype=np.bool_)
        n_pruned = sum(len(group.drawn) for group in pruned)
        lost = np.flatnonzero(solved.flyable[:n_pruned])
        if len(lost):
            m_final = solved.solutions[-1].m_final[lost]
            contender[lost] = contends(reached(problem, nodes, drawn.take(lost), m_final))
        ends = np.cumsum([len(group.drawn) for group in groups])
        strata = tuple(
            Stratum(
                label=group.label,
                candidates=group.population,
                solved=len(group.drawn),
                flyable=int(np.count_nonzero(solved.flyable[end - len(group.drawn) : end])),
                contenders=int(np.count_nonzero(contender[end - len(group.drawn) : end])),
            )
            for group, end in zip(groups, ends, strict=True)
        )
        return RankAudit(pruned=strata[: len(pruned)], kept=strata[len(pruned) :])

    def _pruned_groups(self) -> list[_Group]:
        """Sort the thinned candidates by predicted margin and draw from each stratum."""
        thinned = self._thinned
        if thinned is None or len(thinned) == 0:
            return []
        strata = np.full(len(thinned), _UNKNOWN)
        if self._predictor is not None:
            margins = [self._predictor.margin(legs) for legs in thinned.hops.stages]
            # A NaN in any stage makes the smallest one a NaN.
            margin = np.min(margins, axis=0)
            known = ~np.isnan(margin)
            strata[known] = np.searchsorted(_MARGINS, margin[known], "right")
        members = [np.flatnonzero(strata == s) for s in range(len(_LABELS))]
        wanted = _allot(np.array([len(rows) for rows in members]), self._solves)
        stands_for = self._n_pruned / len(thinned)
        return [
            _Group(label, stands_for * len(rows), thinned.take(self._draw(rows, n)))
            for label, rows, n in zip(_LABELS, members, wanted, strict=True)
            if n
        ]

    def _kept_groups(self, kept: Candidates | None) -> list[_Group]:
        if kept is None or len(kept) == 0:
            return []
        rows = self._draw(np.arange(len(kept)), min(len(kept), -(-self._solves // 2)))
        return [_Group("kept", len(kept), kept.take(rows))]

    def _draw(self, rows: NDArray[np.intp], n: int) -> NDArray[np.intp]:
        return np.sort(self._rng.choice(rows, n, replace=False))


def _allot(sizes: NDArray[np.intp], solves: int) -> list[int]:
    """Divide solves among strata of given sizes by `_SHARES`, at least one where there is any.

    What a small stratum leaves over goes to the others, lowest margin first.
    """
    allotted = np.minimum(sizes, np.maximum(1, np.floor(np.multiply(_SHARES, solves))))
    for s in range(len(sizes)):
        spare = max(0, solves - allotted.sum())
        allotted[s] += min(spare, sizes[s] - allotted[s])
    return [int(n) for n in allotted]
