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
from typing import Final, Protocol, final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.predictor import LegPredictor
from seqsearch.core.candidates import Candidates, reached
from seqsearch.core.hop_margins import least_margin, quick_margin_of
from seqsearch.core.nodes import Nodes
from seqsearch.core.optimisation import LegOptimiser
from seqsearch.core.problem import Problem
from seqsearch.deadline import Deadline
from seqsearch.pruning.audit_estimate import AuditedHop, RankAudit, Stratum

_THINNED: Final = 10_000
"""Pruned candidates of a rank whose margins are predicted: a fraction of a second."""

_MARGINS: Final = (0.9, 0.97)
"""Limits between the strata of predicted margin m*/m0."""

_LABELS: Final = ("below 0.9", "0.9 to 0.97", "0.97 or more", "unknown")
_FAR: Final = 0
_UNKNOWN: Final = 3

_SHARES: Final = (0.25, 0.25, 0.35, 0.15)
"""Shares of the strata in the solves.

On a GTOC7 search, one pruned leg in 200 is in the third stratum, where false prunes
are, one in 70 in the second, and nearly all in the first.
"""

_QUICK_DOUBT: Final = 0.8
"""Above this quick margin a good answer is asked for."""


@final
@dataclass(frozen=True, eq=False)
class _Group:
    """Candidates drawn at random from a stratum, and the number that they were drawn from.

    With n drawn, `margin` is (n,) m*/m0 as predicted, NaN where nothing is known.
    """

    label: str
    population: float
    drawn: Candidates
    margin: NDArray[np.float64]
    far: bool = False


class Sample(Protocol):
    """What an expansion shows its candidates to: `RankSample`, or `NoSample` without an audit.

    Attributes
    ----------
    wanted : bool
        Whether candidates are to be shown at all; it saves making some for the sample alone.
    """

    @property
    def wanted(self) -> bool: ...  # noqa: D102

    def thin(self, n: int, of: int) -> NDArray[np.bool_]:
        """Choose which of the next n candidates to offer, for a rank of about `of` in all."""
        ...

    def offer(self, block: Candidates, kept: NDArray[np.bool_]) -> None:
        """Look at the next n candidates, of which (n,) `kept` were not pruned."""
        ...

    def solve(
        self,
        problem: Problem,
        nodes: Nodes,
        optimiser: LegOptimiser,
        solver: str,
        deadline: Deadline,
        contends: Callable[[Nodes], NDArray[np.bool_]],
    ) -> RankAudit | None:
        """Optimise the sample; None where there was none, or no time for it."""
        ...


@final
class NoSample:
    """Draws nothing; a `Sample`."""

    wanted = False

    def thin(self, n: int, of: int) -> NDArray[np.bool_]:  # noqa: ARG002
        """Choose none."""
        return np.zeros(n, dtype=np.bool_)

    def offer(self, block: Candidates, kept: NDArray[np.bool_]) -> None:
        """Look away."""

    def solve(
        self,
        problem: Problem,
        nodes: Nodes,
        optimiser: LegOptimiser,
        solver: str,
        deadline: Deadline,
        contends: Callable[[Nodes], NDArray[np.bool_]],
    ) -> None:
        """Return None: nothing was audited."""


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

    wanted = True

    def __init__(
        self,
        rng: np.random.Generator,
        rank_index: int,
        solves: int,
        predictor: LegPredictor | None,
    ) -> None:
        seed = int(copy.deepcopy(rng).integers(2**63))
        streams = [np.random.default_rng([seed, rank_index, stream]) for stream in range(4)]
        self._rng, self._thinner = streams[:2]
        self._solves = solves
        self._predictor = predictor
        self._pruned = _Reservoir(_THINNED, streams[2])
        self._kept = _Reservoir(-(-solves // 2), streams[3])
        self._stands_for = 1.0

    def thin(self, n: int, of: int) -> NDArray[np.bool_]:
        """Choose which of the next n candidates to offer, for a rank of about `of` in all.

        Whoever uses it does so for every candidate and with the same `of`; saves
        making and judging candidates that would not stay anyway.
        """
        chance = min(1.0, _THINNED / max(1, of))
        self._stands_for = 1.0 / chance
        return self._thinner.random(n) < chance

    def offer(self, block: Candidates, kept: NDArray[np.bool_]) -> None:
        """Look at the next n candidates, of which (n,) `kept` were not pruned."""
        self._pruned.offer(block, np.flatnonzero(~kept))
        self._kept.offer(block, np.flatnonzero(kept))

    def solve(
        self,
        problem: Problem,
        nodes: Nodes,
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
        pruned, rest = self._pruned_groups(), self._kept_groups()
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
                far=group.far,
                solved=len(group.drawn),
                flyable=int(np.count_nonzero(solved.flyable[end - len(group.drawn) : end])),
                contenders=int(np.count_nonzero(contender[end - len(group.drawn) : end])),
            )
            for group, end in zip(groups, ends, strict=True)
        )
        return RankAudit(
            pruned=strata[: len(pruned)],
            kept=strata[len(pruned) :],
            hops=_one_by_one(groups, n_pruned, solved.flyable),
        )

    def _pruned_groups(self) -> list[_Group]:
        """Sort the pruned candidates by predicted margin and draw from each stratum."""
        thinned = self._pruned.candidates
        if thinned is None:
            return []
        margin = self._margins(thinned)
        strata = _strata(margin)
        members = [np.flatnonzero(strata == s) for s in range(len(_LABELS))]
        wanted = _allot(np.array([len(rows) for rows in members]), self._solves)
        stands_for = self._stands_for * self._pruned.seen / len(thinned)
        groups = []
        for s, (label, members_of, n) in enumerate(zip(_LABELS, members, wanted, strict=True)):
            if n:
                rows = self._draw(members_of, n)
                population = stands_for * len(members_of)
                drawn = thinned.take(rows)
                groups.append(_Group(label, population, drawn, margin[rows], s == _FAR))
        return groups

    def _margins(self, candidates: Candidates) -> NDArray[np.float64]:
        """Return (n,) m*/m0 of candidates as predicted; NaN where nothing is known."""
        if self._predictor is None:
            return np.full(len(candidates), np.nan)
        margin = least_margin(quick_margin_of(self._predictor), candidates.hops)
        doubtful = np.flatnonzero(margin > _QUICK_DOUBT)
        margin[doubtful] = least_margin(self._predictor.margin, candidates.hops.take(doubtful))
        return margin

    def _kept_groups(self) -> list[_Group]:
        drawn = self._kept.candidates
        if drawn is None:
            return []
        population = self._stands_for * self._kept.seen
        return [_Group("kept", population, drawn, self._margins(drawn))]

    def _draw(self, rows: NDArray[np.intp], n: int) -> NDArray[np.intp]:
        return np.sort(self._rng.choice(rows, n, replace=False))


@final
class _Reservoir:
    """A random sample without replacement of candidates that pass by: the smallest lots stay."""

    def __init__(self, size: int, rng: np.random.Generator) -> None:
        self.candidates: Candidates | None = None
        self.seen = 0
        self._size = size
        self._rng = rng
        self._lots = np.zeros(0)

    def offer(self, block: Candidates, rows: NDArray[np.intp]) -> None:
        n_before = len(self._lots)
        self.seen += len(rows)
        lots = np.concatenate([self._lots, self._rng.random(len(rows))])
        stay = np.arange(len(lots))
        if len(lots) > self._size:
            stay = np.sort(np.argpartition(lots, self._size - 1)[: self._size])
        new = rows[stay[stay >= n_before] - n_before]
        self._lots = lots[stay]
        if len(new) == 0:
            return
        parts = [block.take(new)]
        if self.candidates is not None:
            parts.insert(0, self.candidates.take(stay[stay < n_before]))
        self.candidates = Candidates.concatenate(parts)


def _strata(margin: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the number of each candidate's stratum, by its predicted margin."""
    known = ~np.isnan(margin)
    strata = np.full(len(margin), _UNKNOWN)
    strata[known] = np.searchsorted(_MARGINS, margin[known], "right")
    return strata


def _one_by_one(
    groups: list[_Group], n_pruned: int, flyable: NDArray[np.bool_]
) -> tuple[AuditedHop, ...]:
    """Return the records of all that was drawn, of which the first `n_pruned` were pruned."""
    margin = np.concatenate([group.margin for group in groups])
    tof_days = np.concatenate(
        [np.sum([legs.tof_days for legs in group.drawn.hops.legs], axis=0) for group in groups]
    )
    return tuple(
        AuditedHop(
            kept=k >= n_pruned,
            tof_days=round(float(days), 2),
            margin=None if np.isnan(predicted) else round(float(predicted), 4),
            flyable=bool(flies),
        )
        for k, (days, predicted, flies) in enumerate(zip(tof_days, margin, flyable, strict=True))
    )


def _allot(sizes: NDArray[np.intp], solves: int) -> list[int]:
    """Divide solves among strata of given sizes by `_SHARES`, at least one where there is any.

    What a small stratum leaves over goes to the others, highest margin first.
    """
    allotted = np.minimum(sizes, np.maximum(1, np.floor(np.multiply(_SHARES, solves))))
    for s in reversed(range(len(sizes))):
        spare = max(0, solves - allotted.sum())
        allotted[s] += min(spare, sizes[s] - allotted[s])
    return [int(n) for n in allotted]
