"""Pruners by name, the pruning of hops, and the audit of what pruning costs."""
