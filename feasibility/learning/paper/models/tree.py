"""A single decision tree."""

from dataclasses import asdict, dataclass
from typing import Any, Self, final

import numpy as np
from numpy.typing import NDArray

from feasibility.learning.paper.models.base import Fitted, OnEpoch, check_training_data, subset
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
class Tree(Fitted):
    """scikit-learn's decision tree."""

    kind = "tree"

    def __init__(self, **hyperparameters: Any) -> None:
        super().__init__()
        self._config = TreeConfig(**hyperparameters)

    @property
    def config(self) -> dict[str, Any]:
        """Hyperparameters."""
        return asdict(self._config)

    def fit(
        self,
        X: NDArray[np.float64],
        y: NDArray[np.bool_],
        *,
        rng: np.random.Generator,
        X_val: NDArray[np.float64] | None = None,  # noqa: ARG002
        y_val: NDArray[np.bool_] | None = None,  # noqa: ARG002
        on_epoch: OnEpoch | None = None,  # noqa: ARG002
    ) -> Self:
        """Learn; see `Model.fit`."""
        check_training_data(X, y)
        X, y = subset(X, y, self._config.max_samples, rng)
        estimator = load_extra("sklearn.tree").DecisionTreeClassifier(
            criterion=self._config.criterion,
            min_samples_leaf=self._config.min_samples_leaf,
            max_leaf_nodes=self._config.max_leaf_nodes,
            random_state=int(rng.integers(2**31)),
        )
        tree = estimator.fit(X, y).tree_
        # The two classes' shares of a node's samples; the second is "feasible".
        shares = tree.value[:, 0, :] / tree.value[:, 0, :].sum(axis=1, keepdims=True)
        self._keep(
            {
                "feature": np.maximum(tree.feature, 0).astype(np.int32),
                "threshold": tree.threshold.astype(np.float64),
                "left": tree.children_left.astype(np.int32),
                "right": tree.children_right.astype(np.int32),
                "value": shares[:, 1].astype(np.float64),
                "root": np.zeros(1, dtype=np.int32),
                "base": np.array(0.0),
            }
        )
        return self
