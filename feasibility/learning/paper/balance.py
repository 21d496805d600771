"""Balance of the classes: ADASYN for training rows, subsets for balanced tests."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from feasibility.errors import InputError
from feasibility.runtime.extras import load_extra

_NEIGHBOURS: Final = 5


def adasyn(
    X: NDArray[np.float64], y: NDArray[np.bool_], rng: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Add synthetic rows of the smaller class, more where it is hard to learn.

    For training rows only: a synthetic row is a mixture of its neighbours, and
    would carry them into whatever it is tested on: split first, then balance.

    Parameters
    ----------
    X : (n, k) float64
        Standardised features: neighbours are found by Euclidean distance.
    y : (n,) bool
        Labels, both classes present.
    rng : numpy.random.Generator
        Seeds the mixtures.

    Returns
    -------
    X, y
        The given rows first, unchanged and in order, then the synthetic ones.
        Nothing is added where the classes are balanced, or where no row of the
        smaller class has a neighbour of the other.

    Raises
    ------
    InputError
        The smaller class has fewer than two rows.
    MissingDependencyError
        imbalanced-learn is not installed.

    Notes
    -----
    He et al. 2008, "ADASYN: Adaptive synthetic sampling approach for imbalanced
    learning", by imbalanced-learn, with at most 5 neighbours.
    """
    smaller = int(min(np.sum(y), np.sum(~y)))
    if smaller < 2:
        raise InputError(f"ADASYN: the smaller class has {smaller} rows, expected 2 or more")
    if 2 * smaller == len(y):
        return X, y
    sampler = load_extra("imblearn.over_sampling").ADASYN(
        n_neighbors=min(_NEIGHBOURS, smaller - 1),
        random_state=int(rng.integers(2**31)),
    )
    try:
        X_more, y_more = sampler.fit_resample(X, y.astype(np.int64))
    except (ValueError, RuntimeError) as error:
        # imbalanced-learn's way to say that there is nothing to add.
        if "No samples will be generated" in str(error) or "Not any neigbours" in str(error):
            return X, y
        raise
    return np.asarray(X_more, dtype=np.float64), np.asarray(y_more) == 1


def balanced_rows(
    y: NDArray[np.bool_], rng: np.random.Generator, *, most: int | None = None
) -> NDArray[np.int64]:
    """Return rows, in order, of a balanced subset.

    Parameters
    ----------
    y : (n,) bool
        Labels.
    rng : numpy.random.Generator
        Draws the rows.
    most : int, optional
        Rows at most; by default the smaller class is taken whole, and as many of the other.
    """
    feasible, infeasible = np.flatnonzero(y), np.flatnonzero(~y)
    size = min(len(feasible), len(infeasible))
    if most is not None:
        size = min(size, most // 2)
    chosen = [rng.choice(rows, size, replace=False) for rows in (feasible, infeasible)]
    return np.sort(np.concatenate(chosen)).astype(np.int64)
