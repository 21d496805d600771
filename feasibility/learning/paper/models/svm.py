"""Support vector machine with a Gaussian kernel."""

from dataclasses import dataclass
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.paper.predictors import VectorsPredictor
from feasibility.learning.paper.models.baseline import Baseline
from feasibility.runtime.extras import load_extra

_SHARE_FOR_SIGMOID: Final = 0.1


@final
@dataclass(frozen=True)
class SvmConfig:
    """Hyperparameters of `Svm`.

    `C` is the penalty and `gamma` the exponent of the kernel
    exp(-gamma |x - x'|^2), 1 / k where not given; `max_samples` is the largest
    number of training rows (Table 6: training time grows with its square).
    """

    C: float = 10.0
    gamma: float | None = None
    max_samples: int | None = 30_000


@final
class Svm(Baseline[SvmConfig]):
    """scikit-learn's SVC, its decision value made a probability by Platt's sigmoid.

    The sigmoid is fitted on a tenth of the training rows that the machine has
    not seen (Platt 1999, "Probabilistic outputs for support vector machines").
    """

    kind = "svm"

    def __init__(self, **hyperparameters: Any) -> None:
        super().__init__(SvmConfig(**hyperparameters))

    def _fit(
        self, X: NDArray[np.float64], y: NDArray[np.bool_], rng: np.random.Generator
    ) -> dict[str, NDArray[Any]]:
        sigmoid_rows, seen = _held_out(y, rng)
        gamma = 1.0 / X.shape[1] if self._config.gamma is None else self._config.gamma
        machine = load_extra("sklearn.svm").SVC(C=self._config.C, gamma=gamma, cache_size=500)
        machine.fit(X[seen], y[seen])
        arrays: dict[str, NDArray[Any]] = {
            "vectors": machine.support_vectors_.astype(np.float64),
            "coefficients": machine.dual_coef_[0].astype(np.float64),
            "intercept": np.array(float(machine.intercept_[0])),
            "gamma": np.array(gamma),
            "sigmoid": np.array([1.0, 0.0]),
        }
        decision = VectorsPredictor(arrays).decide(X[sigmoid_rows])
        sigmoid = load_extra("sklearn.linear_model").LogisticRegression(C=1e3)
        sigmoid.fit(decision[:, None], y[sigmoid_rows])
        arrays["sigmoid"] = np.array([sigmoid.coef_[0, 0], sigmoid.intercept_[0]])
        return arrays


def _held_out(
    y: NDArray[np.bool_], rng: np.random.Generator
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return rows for the sigmoid, at least one of each class, and the others."""
    by_class = []
    for rows in (np.flatnonzero(y), np.flatnonzero(~y)):
        size = max(1, round(_SHARE_FOR_SIGMOID * len(rows)))
        by_class.append(rng.choice(rows, size, replace=False))
    chosen = np.sort(np.concatenate(by_class))
    # A class with a single row needs it in both places.
    single = [rows for rows in by_class if np.sum(y == y[rows[0]]) == 1]
    seen = np.setdiff1d(np.arange(len(y)), chosen)
    return chosen, np.sort(np.concatenate([seen, *single])).astype(np.int64)
