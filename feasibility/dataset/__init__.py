"""Datasets of labelled legs: protocols, samplers, generation, reading and splits.

Knows the leg solvers and nothing above them.
"""

from feasibility.dataset.columns import COLUMNS, Column
from feasibility.dataset.dataset import Dataset, read_dataset
from feasibility.dataset.generate import Generation, begin
from feasibility.dataset.protocol import Protocol, builtin_protocols, read_protocol
from feasibility.dataset.splits import pair_ids, split_by_pair, split_pairs

__all__ = [
    "COLUMNS",
    "Column",
    "Dataset",
    "Generation",
    "Protocol",
    "begin",
    "builtin_protocols",
    "pair_ids",
    "read_dataset",
    "read_protocol",
    "split_by_pair",
    "split_pairs",
]
