"""Expanders: from nodes to flyable hops."""
