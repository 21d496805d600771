"""Splits that keep each pair of bodies together, so that no leg is judged by its twin."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from feasibility.errors import InputError


def pair_ids(dep_id: ArrayLike, arr_id: ArrayLike) -> NDArray[np.int64]:
    """Return a number for each unordered pair of bodies.

    Parameters
    ----------
    dep_id, arr_id : array_like
        (n,) int: ids of the bodies; a negative id is a body that occurs nowhere
        else, so that its row is a pair of its own.

    Returns
    -------
    (n,) int64
        0 to the number of pairs minus 1; equal where the two bodies are the
        same, in either direction.
    """
    ids = np.column_stack([np.asarray(dep_id), np.asarray(arr_id)]).astype(np.int64)
    ids = np.sort(ids, axis=1)
    alone = ids[:, 0] < 0
    # Sorted, a lone row starts with a negative number: unique ones make it a pair of its own.
    ids[alone, 0] = -1 - np.flatnonzero(alone)
    _, numbers = np.unique(ids, axis=0, return_inverse=True)
    return numbers.reshape(-1).astype(np.int64)


def pair_folds(
    pairs: NDArray[np.int64], n_folds: int, rng: np.random.Generator
) -> NDArray[np.int64]:
    """Deal the pairs to folds of nearly equal size.

    Parameters
    ----------
    pairs : (n,) int64
        Number of the pair of each row, see `pair_ids`.
    n_folds : int
        At least 2 and at most the number of pairs.
    rng : numpy.random.Generator
        Shuffles the pairs.

    Returns
    -------
    (n,) int64
        Fold of each row, 0 to `n_folds` - 1; rows of one pair have the same fold.

    Raises
    ------
    InputError
        `n_folds` is below 2 or there are fewer pairs than folds.
    """
    if n_folds < 2:
        raise InputError(f"pair_folds: n_folds is {n_folds}, expected 2 or more")
    return split_pairs(pairs, [1.0 / n_folds] * n_folds, rng)


def split_pairs(
    pairs: NDArray[np.int64], shares: Sequence[float], rng: np.random.Generator
) -> NDArray[np.int64]:
    """Deal the pairs to parts of given shares of the rows.

    Parameters
    ----------
    pairs : (n,) int64
        Number of the pair of each row.
    shares : sequence of float
        Share of each part, all positive; they are scaled to sum 1.
    rng : numpy.random.Generator
        Shuffles the pairs.

    Returns
    -------
    (n,) int64
        Part of each row; rows of one pair are in the same part, none is empty.

    Raises
    ------
    InputError
        There are fewer pairs than parts.
    """
    _, numbers, counts = np.unique(pairs, return_inverse=True, return_counts=True)
    n_parts = len(shares)
    if len(counts) < n_parts:
        raise InputError(
            f"splitting by pairs: {len(counts)} different pairs of bodies, "
            f"expected at least {n_parts}"
        )
    order = rng.permutation(len(counts))
    # The middle of a pair's rows decides, so that parts have their shares of rows, not of pairs.
    middle = np.cumsum(counts[order]) - 0.5 * counts[order]
    cuts = np.searchsorted(middle, np.cumsum(shares)[:-1] / np.sum(shares) * len(pairs))
    for k in range(n_parts - 1):
        # With few pairs a part could come out empty.
        least = cuts[k - 1] + 1 if k else 1
        cuts[k] = np.clip(cuts[k], least, len(counts) - (n_parts - 1 - k))
    of_pair = np.empty(len(counts), dtype=np.int64)
    of_pair[order] = np.repeat(np.arange(n_parts), np.diff([0, *cuts, len(counts)]))
    of_row: NDArray[np.int64] = of_pair[numbers.reshape(-1)]
    return of_row
