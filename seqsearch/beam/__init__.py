"""The beam search: passes, ranks, and what decides which nodes go on."""

from seqsearch.beam.beam_search import search
from seqsearch.beam.result import SearchResult

__all__ = ["SearchResult", "search"]
