"""Balance of the classes: ADASYN for training folds, subsets for balanced tests."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, final

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
    would carry them into whatever it is tested on. `training_folds` sees to it.

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


@final
@dataclass(frozen=True, eq=False)
class TrainingFold:
    """One fold of a cross-validation.

    Attributes
    ----------
    X, y
        Training rows, (m, k) and (m,), balanced if asked for.
    train_rows, validation_rows : (a,), (b,) int64
        Rows of the whole set; the first a rows of `X` are ``train_rows``.
    """

    X: NDArray[np.float64]
    y: NDArray[np.bool_]
    train_rows: NDArray[np.int64]
    validation_rows: NDArray[np.int64]


def training_folds(
    X: NDArray[np.float64],
    y: NDArray[np.bool_],
    folds: NDArray[np.int64],
    rng: np.random.Generator,
    *,
    balance: bool,
) -> Iterator[TrainingFold]:
    """Yield each fold with its training rows, balanced by ADASYN after the split if asked for.

    Parameters
    ----------
    X : (n, k) float64
        Standardised features.
    y : (n,) bool
        Labels.
    folds : (n,) int64
        Fold of each row, from `folds.pair_folds`.
    rng : numpy.random.Generator
        For ADASYN.
    balance : bool
        Whether to add synthetic training rows.
    """
    for fold in np.unique(folds):
        train = np.flatnonzero(folds != fold)
        X_train, y_train = X[train], y[train]
        if balance:
            X_train, y_train = adasyn(X_train, y_train, rng)
        yield TrainingFold(X_train, y_train, train, np.flatnonzero(folds == fold))
