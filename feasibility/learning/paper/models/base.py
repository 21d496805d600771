"""`Model`: what the five classifiers have in common."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, Self, final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.paper.predictors import Predictor, make_predictor
from feasibility.errors import InputError


@final
@dataclass(frozen=True)
class Epoch:
    """What one epoch of training gave; validation figures are NaN where nothing validates.

    Losses are mean cross-entropies in nats, accuracies shares; those of the
    training rows are averages over the epoch's batches, as they were learned.
    """

    number: int
    learning_rate: float
    train_loss: float
    train_accuracy: float
    validation_loss: float
    validation_accuracy: float
    seconds: float


OnEpoch = Callable[[Epoch], None]


class Model(Protocol):
    """A classifier of legs; with n the number of legs and k of features.

    Prediction is computed from `to_arrays` by `classifier.paper.predictors`, in training as in a
    search, so that the two cannot differ.
    """

    @property
    def kind(self) -> str:
        """One of "dnn", "ensemble", "knn", "svm", "tree"."""
        ...

    @property
    def config(self) -> dict[str, Any]:
        """Hyperparameters, as JSON has them."""
        ...

    def fit(
        self,
        X: NDArray[np.float64],
        y: NDArray[np.bool_],
        *,
        rng: np.random.Generator,
        X_val: NDArray[np.float64] | None = None,
        y_val: NDArray[np.bool_] | None = None,
        on_epoch: OnEpoch | None = None,
    ) -> Self:
        """Learn from standardised features (n, k) and labels (n,).

        The validation rows serve early stopping and the figures of `on_epoch`,
        which only a model that learns by epochs calls.

        Raises
        ------
        InputError
            The shapes do not fit or a class is missing.
        MissingDependencyError
            The extra ``train`` is not installed.
        """
        ...

    def predict_probability(self, X: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return (n,) the probability that a leg is feasible."""
        ...

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """Return all that prediction needs, see `classifier.paper.predictors`."""
        ...


class Fitted(ABC):
    """Arrays of a fitted model, and prediction from them; the models share it."""

    kind: ClassVar[str]

    def __init__(self) -> None:
        self._arrays: dict[str, NDArray[Any]] | None = None
        self._predictor: Predictor | None = None

    @property
    @abstractmethod
    def config(self) -> dict[str, Any]:
        """Hyperparameters, as JSON has them."""

    def predict_probability(self, X: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return (n,) the probability that a leg is feasible, for standardised features (n, k)."""
        if self._predictor is None:
            self._predictor = make_predictor(self.kind, self.to_arrays())
        return self._predictor(X)

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """Return all that prediction needs.

        Raises
        ------
        InputError
            The model is not fitted.
        """
        if self._arrays is None:
            raise InputError(f"{self.kind} model: not fitted yet")
        return self._arrays

    def _keep(self, arrays: dict[str, NDArray[Any]]) -> None:
        self._arrays = arrays
        self._predictor = None


def check_training_data(X: NDArray[np.float64], y: NDArray[np.bool_]) -> None:
    """Raise InputError where features and labels cannot be learned from."""
    if X.ndim != 2 or y.shape != (len(X),):
        raise InputError(f"training data: X {X.shape} and y {y.shape}, expected (n, k) and (n,)")
    if not np.isfinite(X).all():
        raise InputError("training data: a feature is not finite")
    if y.all() or not y.any():
        raise InputError("training data: only one class is there")
