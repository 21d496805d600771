"""Splits that keep each pair of bodies together, so that no leg is judged by its twin.

Scikit-learn's ``GroupShuffleSplit`` is no substitute: its shares are shares of the groups, while
these are shares of the rows, and pairs differ much in their number of rows.
"""

import json
from collections.abc import Sequence

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike, NDArray

from feasibility.dataset.dataset import Dataset
from feasibility.errors import InputError


def pair_ids(dep_id: ArrayLike, arr_id: ArrayLike, catalogue: ArrayLike = 0) -> NDArray[np.int64]:
    """Return a number for each unordered pair of bodies.

    Parameters
    ----------
    dep_id, arr_id : array_like
        (n,) int: ids of the bodies; a negative id is a body that occurs nowhere
        else, so that its row is a pair of its own.
    catalogue : array_like
        (n,) int, or one for all, zero or more: which catalogue the ids are from.

    Returns
    -------
    (n,) int64
        0 to the number of pairs minus 1; equal where the two bodies are the
        same, in either direction.
    """
    dep, arr = np.asarray(dep_id, dtype=np.int64), np.asarray(arr_id, dtype=np.int64)
    first, second = np.minimum(dep, arr), np.maximum(dep, arr)
    alone = first < 0
    ends = [
        np.where(alone, -1, catalogue),
        np.where(alone, np.arange(len(dep)), first),
        np.where(alone, 0, second),
    ]
    _, numbers = np.unique(np.column_stack(ends), axis=0, return_inverse=True)
    return numbers.reshape(-1).astype(np.int64)


def pairs_of_bodies(datasets: Sequence[Dataset]) -> list[NDArray[np.int64]]:
    """Return for each of one or more datasets the `pair_ids` of its rows.

    A pair is told by its ids within a catalogue, so that datasets from one catalogue share pairs.
    """
    known: dict[str, int] = {}
    numbers = []
    for dataset in datasets:
        key = json.dumps(dataset.metadata["catalogue"], sort_keys=True)
        numbers.append(known.setdefault(key, len(known)))
    lengths = [len(dataset) for dataset in datasets]
    pairs = pair_ids(
        np.concatenate([dataset.columns["dep_id"] for dataset in datasets]),
        np.concatenate([dataset.columns["arr_id"] for dataset in datasets]),
        np.repeat(numbers, lengths),
    )
    return np.split(pairs, np.cumsum(lengths)[:-1])


def split_pairs(
    pairs: NDArray[np.int64],
    shares: Sequence[float],
    rng: Generator,
    *,
    allow_empty: bool = False,
) -> NDArray[np.int64]:
    """Deal the pairs to parts of given shares of the rows.

    Parameters
    ----------
    pairs : (n,) int64
        Number of the pair of each row, see `pair_ids`.
    shares : sequence of float
        Share of each part, all positive; they are scaled to sum 1. Equal shares make folds.
    rng : numpy.random.Generator
        Shuffles the pairs.
    allow_empty : bool
        Whether a part may get no pair, where there are few.

    Returns
    -------
    (n,) int64
        Part of each row; rows of one pair are in the same part.

    Raises
    ------
    InputError
        There are fewer pairs than parts, and none may be empty.
    """
    _, numbers, counts = np.unique(pairs, return_inverse=True, return_counts=True)
    n_parts = len(shares)
    if len(counts) < n_parts and not allow_empty:
        raise InputError(
            f"splitting by pairs: {len(counts)} different pairs of bodies, "
            f"expected at least {n_parts}"
        )
    order = rng.permutation(len(counts))
    # The middle of a pair's rows decides, so that parts have their shares of rows, not of pairs.
    middle = np.cumsum(counts[order]) - 0.5 * counts[order]
    cuts = np.searchsorted(middle, np.cumsum(shares)[:-1] / np.sum(shares) * len(pairs))
    if not allow_empty:
        for k in range(n_parts - 1):
            least = cuts[k - 1] + 1 if k else 1
            cuts[k] = np.clip(cuts[k], least, len(counts) - (n_parts - 1 - k))
    of_pair = np.empty(len(counts), dtype=np.int64)
    of_pair[order] = np.repeat(np.arange(n_parts), np.diff([0, *cuts, len(counts)]))
    of_row: NDArray[np.int64] = of_pair[numbers.reshape(-1)]
    return of_row


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
    pairs = pair_ids(dataset.columns["dep_id"], dataset.columns["arr_id"])
    part = split_pairs(pairs, fractions, rng, allow_empty=True)
    return tuple(dataset.take(np.flatnonzero(part == k)) for k in range(len(shares)))
