"""Tests of feasibility and seqsearch."""
