"""Splits of a dataset that keep pairs of bodies apart."""

from collections.abc import Sequence

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from feasibility.dataset.dataset import Dataset
from feasibility.errors import InputError


def split_by_pair(
    dataset: Dataset, fractions: Sequence[float], rng: Generator
) -> tuple[Dataset, ...]:
    """Split a dataset at random, so that no pair of bodies is in two parts.

    A pair is unordered: a leg from A to B and one from B to A stay together.

    Parameters
    ----------
    dataset : Dataset
        n rows.
    fractions : sequence of float
        Shares of the rows, each above zero, with sum 1.
    rng : numpy.random.Generator
        Decides which pair goes where.

    Returns
    -------
    tuple of Dataset
        One for each fraction, rows in their old order. Shares are met as well
        as whole pairs allow.

    Raises
    ------
    InputError
        A fraction is not above zero, or the sum is not 1.
    """
    shares = np.asarray(fractions, dtype=np.float64)
    if shares.ndim != 1 or not (shares > 0).all() or abs(shares.sum() - 1.0) > 1e-9:
        raise InputError(
            f"split fractions {list(fractions)}: expected numbers above zero with sum 1"
        )
    pair = _pairs(dataset)
    n_pairs = int(pair.max()) + 1 if len(pair) else 0
    order = rng.permutation(n_pairs)
    # Rows before each pair in the random order, counted to the middle of the pair.
    sizes = np.bincount(pair, minlength=n_pairs)[order]
    middle = np.cumsum(sizes) - 0.5 * sizes
    part_of_pair = np.empty(n_pairs, dtype=np.intp)
    bounds = np.cumsum(shares)[:-1] * len(dataset)
    part_of_pair[order] = np.searchsorted(bounds, middle, side="right")
    part = part_of_pair[pair]
    return tuple(dataset.take(np.flatnonzero(part == k)) for k in range(len(shares)))


def _pairs(dataset: Dataset) -> NDArray[np.intp]:
    """Return (n,) numbers from 0, equal where the unordered pair of bodies is."""
    ends = np.column_stack([dataset.columns["dep_id"], dataset.columns["arr_id"]])
    _, pair = np.unique(np.sort(ends, axis=1), axis=0, return_inverse=True)
    return np.asarray(pair, dtype=np.intp).reshape(-1)
