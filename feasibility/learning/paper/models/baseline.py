"""`Baseline`: what the four classifiers that learn in one go have in common."""

from abc import ABC, abstractmethod
from dataclasses import asdict
from typing import Any, ClassVar, Generic, Protocol, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from feasibility.learning.paper.models.base import Fitted, OnEpoch, check_training_data


class BaselineConfig(Protocol):
    """Hyperparameters of a baseline: a dataclass, one of whose fields is `max_samples`."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def max_samples(self) -> int | None:
        """Largest number of training rows (Table 6); None for all of them."""
        ...


C = TypeVar("C", bound=BaselineConfig)


class Baseline(Fitted, Generic[C], ABC):
    """A classifier that learns in one go from a limited number of rows.

    Children say in `_fit` how; they have no epochs, and no use for validation rows.

    Parameters
    ----------
    config : BaselineConfig
        Its hyperparameters.
    """

    def __init__(self, config: C) -> None:
        super().__init__()
        self._config = config

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
        self._keep(self._fit(*subset(X, y, self._config.max_samples, rng), rng))
        return self

    @abstractmethod
    def _fit(
        self, X: NDArray[np.float64], y: NDArray[np.bool_], rng: np.random.Generator
    ) -> dict[str, NDArray[Any]]:
        """Learn from features (n, k) and labels (n,); return what prediction needs."""


def subset(
    X: NDArray[np.float64],
    y: NDArray[np.bool_],
    max_samples: int | None,
    rng: np.random.Generator,
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return at most `max_samples` rows, drawn at random and kept in order."""
    if max_samples is None or len(y) <= max_samples:
        return X, y
    rows = np.sort(rng.choice(len(y), max_samples, replace=False))
    return X[rows], y[rows]
