"""Search for asteroid tours that a low-thrust spacecraft can fly.

The names below are the public face; they are loaded on first use.
"""

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from seqsearch.beam import SearchResult, search
    from seqsearch.config import build_problem, load_problem, read_config
    from seqsearch.problem import Problem
    from seqsearch.ranking import Ranking, TimePropellantRanking
    from seqsearch.settings import SearchSettings
    from seqsearch.tour import Tour, read_tour
    from seqsearch.verify import Verification, verify_tour

__version__ = "0.1.0"

_HOMES = {
    "Problem": "seqsearch.problem",
    "Ranking": "seqsearch.ranking",
    "SearchResult": "seqsearch.beam",
    "SearchSettings": "seqsearch.settings",
    "TimePropellantRanking": "seqsearch.ranking",
    "Tour": "seqsearch.tour",
    "Verification": "seqsearch.verify",
    "build_problem": "seqsearch.config",
    "load_problem": "seqsearch.config",
    "read_config": "seqsearch.config",
    "read_tour": "seqsearch.tour",
    "search": "seqsearch.beam",
    "verify_tour": "seqsearch.verify",
}

__all__ = [
    "Problem",
    "Ranking",
    "SearchResult",
    "SearchSettings",
    "TimePropellantRanking",
    "Tour",
    "Verification",
    "build_problem",
    "load_problem",
    "read_config",
    "read_tour",
    "search",
    "verify_tour",
]


def __getattr__(name: str) -> object:
    if name in _HOMES:
        return getattr(importlib.import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'seqsearch' has no attribute {name!r}")
