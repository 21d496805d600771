"""The beam search: passes, ranks, and what decides which nodes go on."""

from seqsearch.beam.beam_search import SearchResult, search

__all__ = ["SearchResult", "search"]
