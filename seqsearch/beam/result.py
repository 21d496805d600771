"""`SearchResult`: what a search found."""

from dataclasses import dataclass
from typing import final

from seqsearch.beam.counters import RankCounters
from seqsearch.core.tree import SearchTree
from seqsearch.tours.tour import Tour


@final
@dataclass(frozen=True, eq=False, repr=False)
class SearchResult:
    """What a search found.

    Attributes
    ----------
    tour : Tour
        The best tour: most visits, then what the problem prefers. It may have no leg.
    tree : SearchTree
        Every node that the beam kept, over all passes.
    counters : list of RankCounters
        One record for each rank of each pass.
    stopped : str
        ``"complete"``, ``"time limit"``, ``"solve limit"`` or ``"interrupted"``.
    """

    tour: Tour
    tree: SearchTree
    counters: list[RankCounters]
    stopped: str

    def __repr__(self) -> str:
        return f"SearchResult({self.tour!r}, {len(self.tree)} nodes, search {self.stopped})"

    def _repr_html_(self) -> str:
        return self.tour._repr_html_()
