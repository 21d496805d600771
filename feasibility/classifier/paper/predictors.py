"""Prediction of the five kinds of model from plain arrays: numpy, numba and scipy alone.

The arrays are those of `Model.to_arrays`, and of an artefact; with n the number
of legs, k of features:

- ``dnn``: ``weight_0`` (width, k), ``bias_0`` (width,), ... to the last layer,
  which has two outputs, infeasible and feasible; ``activation``, a name;
- ``tree`` and ``ensemble``: ``feature``, ``threshold``, ``left``, ``right`` and
  ``value`` of the nodes of all trees, one after the other, with ``left`` and
  ``right`` counting from the first node of all and -1 at a leaf; ``root``, the
  first node of each tree; ``base``, added to the sum of the leaves. The sum is
  the probability for ``tree`` and its logit for ``ensemble``;
- ``knn``: training ``rows`` (m, k), their ``label`` (m,), ``neighbours`` and
  ``weighting``, a name;
- ``svm``: support ``vectors`` (m, k), ``coefficients`` (m,), ``intercept``,
  ``gamma`` of the Gaussian kernel, and ``sigmoid`` (2,), slope and offset of
  Platt's logistic function of the decision value.
"""

from collections.abc import Callable
from typing import Any, Final, Protocol, final

import numpy as np
from numpy.typing import NDArray

_Array = NDArray[np.float64]

LEAKY_SLOPE: Final = 0.01
"""Slope of the leaky ReLU below zero (torch's default, and MATLAB's)."""

_CHUNK: Final = 2048
_FEW: Final = 128
_PAD: Final = 64
"""Rows of a matrix product are a multiple of this, so that BLAS treats every row alike and a
leg's probability does not depend on how many others are asked about."""


class Predictor(Protocol):
    """Prediction from the arrays of one model."""

    def __call__(self, X: _Array, /) -> _Array:
        """Return (n,) probabilities for standardised features (n, k)."""
        ...


def make_predictor(kind: str, arrays: dict[str, NDArray[Any]]) -> Predictor:
    """Return the prediction function of a model.

    Parameters
    ----------
    kind : str
        "dnn", "ensemble", "knn", "svm" or "tree".
    arrays : dict of str to array
        As `Model.to_arrays` returns them.

    Raises
    ------
    KeyError
        The kind is unknown or an array is missing.
    """
    return _PREDICTORS[kind](arrays)


@final
class NetworkPredictor:
    """A fully connected network with a softmax over two outputs, in float32."""

    def __init__(self, arrays: dict[str, NDArray[Any]]) -> None:
        n_layers = sum(name.startswith("weight_") for name in arrays)
        self._weights = [
            np.ascontiguousarray(arrays[f"weight_{i}"].T, dtype=np.float32)
            for i in range(n_layers)
        ]
        self._biases = [np.asarray(arrays[f"bias_{i}"], dtype=np.float32) for i in range(n_layers)]
        self._activation = str(arrays["activation"])

    def __call__(self, X: _Array, /) -> _Array:
        """Return (n,) probabilities."""
        return _in_chunks(self._predict, X.astype(np.float32))

    def _predict(self, x: NDArray[np.float32]) -> _Array:
        for weight, bias in zip(self._weights[:-1], self._biases[:-1], strict=True):
            x = x @ weight
            x += bias
            activate(x, self._activation)
        logits = (x @ self._weights[-1] + self._biases[-1]).astype(np.float64)
        return _logistic(logits[:, 1] - logits[:, 0])


def activate(x: NDArray[np.float32], activation: str) -> None:
    """Apply "relu", "leaky_relu" or "elu" in place."""
    if activation == "relu":
        np.maximum(x, 0.0, out=x)
    elif activation == "leaky_relu":
        np.maximum(x, LEAKY_SLOPE * x, out=x)
    elif activation == "elu":
        np.copyto(x, np.expm1(np.minimum(x, 0.0)), where=x < 0.0)
    else:
        raise KeyError(activation)


@final
class TreesPredictor:
    """Sum of the leaves that a leg reaches in each tree."""

    def __init__(self, arrays: dict[str, NDArray[Any]], *, logit: bool) -> None:
        self._nodes = (
            np.ascontiguousarray(arrays["feature"], dtype=np.int64),
            np.ascontiguousarray(arrays["threshold"], dtype=np.float64),
            np.ascontiguousarray(arrays["left"], dtype=np.int64),
            np.ascontiguousarray(arrays["right"], dtype=np.int64),
            np.ascontiguousarray(arrays["value"], dtype=np.float64),
            np.ascontiguousarray(arrays["root"], dtype=np.int64),
        )
        self._base = float(arrays["base"])
        self._logit = logit

    def __call__(self, X: _Array, /) -> _Array:
        """Return (n,) probabilities."""
        from feasibility.classifier.paper.tree_kernels import sum_of_leaves

        # scikit-learn compares single precision with thresholds in double.
        rounded = np.ascontiguousarray(X, dtype=np.float32).astype(np.float64)
        total: _Array = self._base + sum_of_leaves(rounded, *self._nodes)
        return _logistic(total) if self._logit else total


@final
class NeighboursPredictor:
    """Vote of the nearest training rows (Euclidean)."""

    def __init__(self, arrays: dict[str, NDArray[Any]]) -> None:
        self._rows = np.ascontiguousarray(arrays["rows"], dtype=np.float64)
        self._halves = 0.5 * np.einsum("ij,ij->i", self._rows, self._rows)
        self._label = np.asarray(arrays["label"], dtype=np.float64)
        self._neighbours = int(arrays["neighbours"])
        self._weighting = str(arrays["weighting"])

    def __call__(self, X: _Array, /) -> _Array:
        """Return (n,) probabilities."""
        return _in_chunks(self._predict, X, size=_FEW)

    def _predict(self, X: _Array) -> _Array:
        # All distances by a matrix product: in tens of dimensions a tree of the rows visits
        # nearly all of them, more slowly. Half the squared distance, less what X alone adds:
        closeness = self._halves - X @ self._rows.T
        last = self._neighbours - 1
        rows = np.argpartition(closeness, last, axis=1)[:, : self._neighbours]
        # The product rounds off small distances; those of the chosen rows are computed anew.
        distance = np.linalg.norm(self._rows[rows] - X[:, None, :], axis=2)
        votes: _Array = self._label[rows]
        if self._weighting == "uniform":
            mean: _Array = votes.mean(axis=1)
            return mean
        # Rows at distance zero outvote all others.
        same = distance == 0.0
        with np.errstate(divide="ignore"):
            weight = np.where(same.any(axis=1, keepdims=True), same, 1.0 / distance)
        share: _Array = (weight * votes).sum(axis=1) / weight.sum(axis=1)
        return share


@final
class VectorsPredictor:
    """Support vector machine with a Gaussian kernel and Platt's sigmoid."""

    def __init__(self, arrays: dict[str, NDArray[Any]]) -> None:
        self._vectors = np.ascontiguousarray(arrays["vectors"], dtype=np.float64)
        self._squares = np.einsum("ij,ij->i", self._vectors, self._vectors)
        self._coefficients = np.asarray(arrays["coefficients"], dtype=np.float64)
        self._intercept = float(arrays["intercept"])
        self._gamma = float(arrays["gamma"])
        self._slope, self._offset = (float(value) for value in arrays["sigmoid"])

    def __call__(self, X: _Array, /) -> _Array:
        """Return (n,) probabilities."""
        return _in_chunks(self._predict, X)

    def decide(self, X: _Array) -> _Array:
        """Return (n,) decision values: above 0 on the feasible side."""
        squares = np.einsum("ij,ij->i", X, X)
        exponent = X @ (2.0 * self._vectors.T)
        exponent -= squares[:, None]
        exponent -= self._squares
        exponent *= self._gamma
        np.exp(exponent, out=exponent)
        # Not a matrix-vector product: that would round a row by where it stands.
        exponent *= self._coefficients
        decision: _Array = exponent.sum(axis=1) + self._intercept
        return decision

    def _predict(self, X: _Array) -> _Array:
        return _logistic(self._slope * self.decide(X) + self._offset)


def _in_chunks(function: Callable[[Any], _Array], X: NDArray[Any], size: int = _CHUNK) -> _Array:
    out = np.empty(len(X))
    for first in range(0, len(X), size):
        part = X[first : first + size]
        missing = -len(part) % _PAD
        padded = np.pad(part, ((0, missing), (0, 0))) if missing else part
        out[first : first + size] = function(padded)[: len(part)]
    return out


def _logistic(x: _Array) -> _Array:
    from scipy.special import expit

    result: _Array = expit(x)
    return result


_PREDICTORS: Final[dict[str, Callable[[dict[str, NDArray[Any]]], Predictor]]] = {
    "dnn": NetworkPredictor,
    "ensemble": lambda arrays: TreesPredictor(arrays, logit=True),
    "knn": NeighboursPredictor,
    "svm": VectorsPredictor,
    "tree": lambda arrays: TreesPredictor(arrays, logit=False),
}
