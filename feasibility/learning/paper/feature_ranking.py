"""Ranking of features by an ensemble of trees (equation 6 of the paper)."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from feasibility.runtime.extras import load_extra

N_SAMPLES: Final = 4000
"""Training samples of the ranking (paper, section on feature selection)."""

_N_TREES: Final = 100
_SHARE_OF_FEATURES: Final = 1.0 / 3.0
"""Features tried at each split: with fewer than all, those that say the same share the credit."""


def rank_features(
    X: NDArray[np.float64],
    y: NDArray[np.bool_],
    rng: np.random.Generator,
    n_samples: int = N_SAMPLES,
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Rank features by the importance that an ensemble of trees gives them.

    Parameters
    ----------
    X : (n, k) float64
        Features; trees do not mind whether they are standardised.
    y : (n,) bool
        Labels.
    rng : numpy.random.Generator
        Draws the samples and seeds the trees.
    n_samples : int
        How many rows to use at most.

    Returns
    -------
    order : (k,) int64
        Columns, most important first.
    importance : (k,) float64
        Equation 6, by column.

    Raises
    ------
    MissingDependencyError
        scikit-learn is not installed.
    """
    rows = rng.permutation(len(y))[:n_samples]
    forest = load_extra("sklearn.ensemble").RandomForestClassifier(
        n_estimators=_N_TREES,
        max_features=_SHARE_OF_FEATURES,
        random_state=int(rng.integers(2**31)),
    )
    forest.fit(X[rows], y[rows])
    trees = [tree_importance(estimator.tree_, X.shape[1]) for estimator in forest.estimators_]
    importance = np.mean(trees, axis=0)
    return np.argsort(-importance, kind="stable").astype(np.int64), importance


def tree_importance(tree: Any, n_features: int) -> NDArray[np.float64]:
    """Return the importance of each feature in one tree (equation 6).

    The decrease of risk (Gini impurity times share of the samples) from a node
    to its two children, summed over the splits on a feature and divided by the
    number of branch nodes.

    Parameters
    ----------
    tree : sklearn.tree._tree.Tree
        A fitted tree.
    n_features : int
        Number of features, k.

    Returns
    -------
    (k,) float64
    """
    risk = tree.impurity * tree.weighted_n_node_samples / tree.weighted_n_node_samples[0]
    branch = np.flatnonzero(tree.children_left >= 0)
    left, right = tree.children_left[branch], tree.children_right[branch]
    decrease = risk[branch] - risk[left] - risk[right]
    total = np.bincount(tree.feature[branch], weights=decrease, minlength=n_features)
    importance: NDArray[np.float64] = total / max(len(branch), 1)
    return importance
