"""`SearchState`: everything that a search needs to go on after a rank."""

from dataclasses import dataclass, field
from typing import Any, final

from seqsearch.beam.counters import RankCounters
from seqsearch.beam.scouting.pool import Pool
from seqsearch.core.nodes import Nodes
from seqsearch.core.tree import FlownLeg, SearchTree
from seqsearch.settings import SearchSettings


@final
@dataclass(kw_only=True, eq=False)
class SearchState:
    """Where a search stands after a rank.

    The search changes it in place; whoever wants to keep one copies it.

    Attributes
    ----------
    pass_number : int
        Pass from 1; 0 before the first.
    settings : SearchSettings
        Settings of this pass, which may differ from those of the search.
    waiting : Nodes or None
        Nodes that are still to be expanded in this pass; None between passes.
    pool : Pool
        Itineraries that scouts have found, over all passes. It is replaced, never changed.
    guide : Nodes or None
        Ends of the itineraries to which this pass keeps; None for none.
    tree : SearchTree
        All nodes that were kept, over all passes.
    counters : list of RankCounters
        One record for each rank of each pass.
    rng_state : dict
        State of the bit generator (``rng.bit_generator.state``).
    best_node : int
        Id of the best node so far; -1 before the first pass.
    best_key : tuple of (int, float)
        Its depth and the negative of its score.
    closing : tuple of FlownLeg
        Legs that complete the tour after the best node.
    spent_s : float
        Wall-clock time so far, over all sessions.
    solves : int
        Legs that were given to the solver so far.
    """

    settings: SearchSettings
    pass_number: int = 0
    waiting: Nodes | None = None
    pool: Pool = field(default_factory=Pool.empty)
    guide: Nodes | None = None
    tree: SearchTree = field(default_factory=SearchTree)
    counters: list[RankCounters] = field(default_factory=list)
    rng_state: dict[str, Any] = field(default_factory=dict)
    best_node: int = -1
    best_key: tuple[int, float] = (-1, 0.0)
    closing: tuple[FlownLeg, ...] = ()
    spent_s: float = 0.0
    solves: int = 0
