"""Counters of the search, one record a rank."""

from dataclasses import dataclass, field
from typing import final

from seqsearch.pruning.audit_estimate import RankAudit
from seqsearch.pruning.hop_pruning import KeptHops


@final
@dataclass(kw_only=True)
class RankCounters:
    """What happened at one rank of one pass.

    Attributes
    ----------
    pass_number, rank : int
        Pass from 1; rank from 1, the number of legs of the nodes produced; 0 for the
        scouting before a pass, of which no leg is optimised.
    nodes : int
        Nodes that were expanded.
    proposed : int
        Candidate hops.
    questions : int
        Legs that the predictor was asked about.
    unknown : int
        Candidates kept because the predictor knows nothing of them.
    pruned : dict of str to int
        Legs dropped by each pruner, in the order in which they were asked.
    out_of_domain : int
        Candidates that survive because a classifier does not know such legs.
    optimised : int
        Legs that went to the leg solver.
    feasible : int
        Legs it could fly.
    kept : int
        Nodes kept for the next rank; itineraries that scouts found worth optimising.
    cut : bool
        A budget ran out at this rank; it is not complete.
    audit : RankAudit or None
        What the audit found; None where there was none.
    seconds_expand, seconds_prune, seconds_optimise, seconds_audit, seconds : float
        Wall-clock time of the steps and of the whole rank.
    """

    pass_number: int
    rank: int
    nodes: int = 0
    proposed: int = 0
    questions: int = 0
    unknown: int = 0
    pruned: dict[str, int] = field(default_factory=dict)
    out_of_domain: int = 0
    optimised: int = 0
    feasible: int = 0
    kept: int = 0
    cut: bool = False
    audit: RankAudit | None = None
    seconds_expand: float = 0.0
    seconds_prune: float = 0.0
    seconds_optimise: float = 0.0
    seconds_audit: float = 0.0
    seconds: float = 0.0

    def barren_pruner(self) -> str | None:
        """Return the pruner that dropped the last candidates; None if some survived."""
        if not self.pruned or self.proposed > sum(self.pruned.values()):
            return None
        return (
            [name for name, count in self.pruned.items() if count][-1] if self.proposed else None
        )

    def count_kept(self, kept: KeptHops) -> None:
        """Add what pruners dropped and did not know of one batch of hops."""
        self.count_pruned(kept.pruned)
        self.out_of_domain += kept.out_of_domain

    def count_pruned(self, pruned: dict[str, int]) -> None:
        """Add the counts of one batch."""
        for name, count in pruned.items():
            self.pruned[name] = self.pruned.get(name, 0) + count
