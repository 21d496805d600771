"""K nearest neighbours."""

from dataclasses import dataclass
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

from feasibility.errors import InputError
from feasibility.learning.paper.models.baseline import Baseline


@final
@dataclass(frozen=True)
class KnnConfig:
    """Hyperparameters of `Knn`.

    `weighting` is "uniform" or "distance" (votes weigh 1 / distance);
    `max_samples` is the largest number of training rows (Table 6).
    """

    neighbours: int = 10
    weighting: str = "distance"
    max_samples: int | None = 50_000

    def __post_init__(self) -> None:
        if self.neighbours < 1:
            raise InputError(f"knn neighbours: {self.neighbours}, expected 1 or more")
        if self.weighting not in ("uniform", "distance"):
            raise InputError(f"knn weighting: {self.weighting!r}, expected uniform or distance")


@final
class Knn(Baseline[KnnConfig]):
    """Vote of the nearest training rows, Euclidean on standardised features.

    There is nothing to fit but the rows kept; scikit-learn's
    ``KNeighborsClassifier`` gives the same probabilities.
    """

    kind = "knn"

    def __init__(self, **hyperparameters: Any) -> None:
        super().__init__(KnnConfig(**hyperparameters))

    def _fit(
        self,
        X: NDArray[np.float64],
        y: NDArray[np.bool_],
        rng: np.random.Generator,  # noqa: ARG002
    ) -> dict[str, NDArray[Any]]:
        return {
            "rows": X.astype(np.float64),
            "label": y.astype(np.uint8),
            "neighbours": np.array(min(self._config.neighbours, len(y))),
            "weighting": np.array(self._config.weighting),
        }
