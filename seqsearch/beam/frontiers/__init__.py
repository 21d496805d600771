"""Frontiers: which of the nodes that wait are expanded next."""
