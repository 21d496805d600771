"""Judging classifiers: metrics, tables and the peers beside which they stand."""
