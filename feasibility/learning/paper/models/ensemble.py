"""An ensemble of boosted trees.

The paper says "ensemble" and leaves the method to its Bayesian optimisation.
Of scikit-learn's ensembles the histogram-based gradient boosting is taken:
against random forests and extremely randomised trees it is the more accurate on
such tables, it learns 50 000 legs in seconds where exact gradient boosting
takes minutes, and its trees are small, so that an artefact has hundreds of
kilobytes instead of tens of megabytes.
"""

from dataclasses import asdict, dataclass
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from feasibility.errors import MissingDependencyError
from feasibility.learning.paper.models.baseline import Baseline
from feasibility.runtime.extras import load_extra


@final
@dataclass(frozen=True)
class EnsembleConfig:
    """Hyperparameters of `Ensemble`; the names of all but the last two are scikit-learn's.

    `max_samples` is the largest number of training rows (Table 6); `threads` those of the
    processor: with more than there are idle cores, scikit-learn's trees get slower, not faster.
    """

    learning_rate: float = 0.1
    max_iter: int = 300
    max_leaf_nodes: int = 31
    min_samples_leaf: int = 20
    l2_regularization: float = 0.0
    max_samples: int | None = 50_000
    threads: int = 1


@final
class Ensemble(Baseline[EnsembleConfig]):
    """scikit-learn's histogram-based gradient boosting."""

    kind = "ensemble"

    def __init__(self, **hyperparameters: Any) -> None:
        super().__init__(EnsembleConfig(**hyperparameters))

    def _fit(
        self, X: NDArray[np.float64], y: NDArray[np.bool_], rng: np.random.Generator
    ) -> dict[str, NDArray[Any]]:
        options = asdict(self._config)
        del options["max_samples"], options["threads"]
        estimator = load_extra("sklearn.ensemble").HistGradientBoostingClassifier(
            early_stopping=False, random_state=int(rng.integers(2**31)), **options
        )
        with load_extra("threadpoolctl").threadpool_limits(self._config.threads):
            # Single precision, as prediction sees the features.
            estimator.fit(X.astype(np.float32), y)
        return _node_arrays(estimator)


def _node_arrays(estimator: Any) -> dict[str, NDArray[Any]]:
    """Return the nodes of a fitted ensemble, which scikit-learn keeps in private attributes.

    Raises
    ------
    MissingDependencyError
        This version of scikit-learn keeps them elsewhere.
    """
    try:
        trees = [trees[0].nodes for trees in estimator._predictors]
        base = float(np.squeeze(estimator._baseline_prediction))
        nodes = np.concatenate(trees)
        leaf = nodes["is_leaf"].astype(np.bool_)
        columns = {name: nodes[name] for name in ("feature_idx", "num_threshold", "value")}
        left, right = nodes["left"].astype(np.int32), nodes["right"].astype(np.int32)
    except (AttributeError, ValueError, TypeError) as error:
        raise MissingDependencyError(
            f"this version of scikit-learn keeps the trees of its ensemble elsewhere ({error}); "
            "install another with: pip install 'scikit-learn>=1.5,<1.10'"
        ) from error
    sizes = [len(tree) for tree in trees]
    root = np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(np.int32)
    first = np.repeat(root, sizes)
    return {
        "feature": np.where(leaf, 0, columns["feature_idx"]).astype(np.int32),
        "threshold": columns["num_threshold"].astype(np.float64),
        "left": np.where(leaf, -1, left + first).astype(np.int32),
        "right": np.where(leaf, -1, right + first).astype(np.int32),
        "value": columns["value"].astype(np.float64),
        "root": root,
        "base": np.array(base),
    }
