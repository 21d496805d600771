"""Polish: the timetable of a whole tour at once, other bodies at its ends, more of them."""

from seqsearch.polish.extension import ExtensionSettings
from seqsearch.polish.local_search import PolishResult, PolishSettings, PolishStep, polish
from seqsearch.polish.selection import distinct_tours

__all__ = [
    "ExtensionSettings",
    "PolishResult",
    "PolishSettings",
    "PolishStep",
    "distinct_tours",
    "polish",
]
