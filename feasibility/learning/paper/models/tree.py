"""A single decision tree."""

from dataclasses import dataclass
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from feasibility.learning.paper.models.baseline import Baseline
from feasibility.runtime.extras import load_extra


@final
@dataclass(frozen=True)
class TreeConfig:
    """Hyperparameters of `Tree`; the names of the first three are scikit-learn's.

    `max_samples` is the largest number of training rows (Fig. 3: a tree learns
    little from more than 20 000; Table 6 has 50 000).
    """

    min_samples_leaf: int = 5
    max_leaf_nodes: int | None = None
    criterion: str = "gini"
    max_samples: int | None = 50_000


@final
class Tree(Baseline[TreeConfig]):
    """scikit-learn's decision tree."""

    kind = "tree"

    def __init__(self, **hyperparameters: Any) -> None:
        super().__init__(TreeConfig(**hyperparameters))

    def _fit(
        self, X: NDArray[np.float64], y: NDArray[np.bool_], rng: np.random.Generator
    ) -> dict[str, NDArray[Any]]:
        estimator = load_extra("sklearn.tree").DecisionTreeClassifier(
            criterion=self._config.criterion,
            min_samples_leaf=self._config.min_samples_leaf,
            max_leaf_nodes=self._config.max_leaf_nodes,
            random_state=int(rng.integers(2**31)),
        )
        tree = estimator.fit(X, y).tree_
        # The two classes' shares of a node's samples; the second is "feasible".
        shares = tree.value[:, 0, :] / tree.value[:, 0, :].sum(axis=1, keepdims=True)
        return {
            "feature": np.maximum(tree.feature, 0).astype(np.int32),
            "threshold": tree.threshold.astype(np.float64),
            "left": tree.children_left.astype(np.int32),
            "right": tree.children_right.astype(np.int32),
            "value": shares[:, 1].astype(np.float64),
            "root": np.zeros(1, dtype=np.int32),
            "base": np.array(0.0),
        }
