"""The nets of the margin model, without torch: numpy in single precision."""

from collections.abc import Mapping
from functools import cached_property
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.runtime.blas import one_blas_thread

_Array = NDArray[np.float64]

INPUT_LIMIT: Final = 6.0
"""Standardised inputs are kept within this many standard deviations."""

_BLOCK: Final = 256
"""Rows of a matrix product, so that BLAS treats every row alike and the answer for a
leg does not depend on how many others are asked about."""

_SMALL_BLOCKS: Final = (16, 64)
"""Rows of the product for what is left over, where BLAS gives the same bits with fewer rows."""


@final
class MarginNet:
    """Corrects a hint: mean and scale of the error of its logarithm.

    Layers are linear with SiLU between them; the last has two outputs, the
    correction in units of `unit` and the logarithm of the expected error.

    Parameters
    ----------
    arrays : mapping of str to array
        ``mean``, ``std`` (k,): standardisation; ``weight_0`` (width, k), ``bias_0``
        (width,), ... ; ``unit`` ().

    Raises
    ------
    KeyError
        An array is missing.
    """

    def __init__(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        count = sum(name.startswith("weight_") for name in arrays)
        self._mean = np.asarray(arrays["mean"], dtype=np.float64)
        self._scale = 1.0 / np.asarray(arrays["std"], dtype=np.float64)
        self._unit = float(arrays["unit"])
        self._weights = [
            np.ascontiguousarray(arrays[f"weight_{i}"].T, dtype=np.float32) for i in range(count)
        ]
        self._biases = [np.asarray(arrays[f"bias_{i}"], dtype=np.float32) for i in range(count)]

    @property
    def inputs(self) -> int:
        """Number of inputs, k."""
        return len(self._mean)

    def __call__(self, X: _Array, /) -> tuple[_Array, _Array]:
        """Return the correction of the hint and its expected error.

        Parameters
        ----------
        X : (n, k) float64
            Features without NaN.

        Returns
        -------
        correction : (n,) float64
            To be added to the hint.
        error : (n,) float64
            Scale of what is still wrong then, above 0.
        """
        n = len(X)
        out = np.empty((n, 2), dtype=np.float32)
        with one_blas_thread():
            for first in range(0, n, _BLOCK):
                part = X[first : first + _BLOCK]
                rows = self._rows_of_product(len(part))
                block = np.zeros((rows, X.shape[1]), dtype=np.float32)
                block[: len(part)] = self._standardised(part)
                out[first : first + len(part)] = self._forward(block)[: len(part)]
        values = out.astype(np.float64)
        return values[:, 0] * self._unit, np.exp(values[:, 1]) * self._unit

    def _rows_of_product(self, n: int) -> int:
        """Return how many rows, zeros included, n rows are multiplied with."""
        fitting = (rows for rows in _SMALL_BLOCKS if n <= rows)
        small = next(fitting, _BLOCK)
        return small if small < _BLOCK and self._small_blocks_agree else _BLOCK

    @cached_property
    def _small_blocks_agree(self) -> bool:
        """Whether products of fewer rows are the same to the last bit.

        BLAS has other code for the last rows of a matrix where their number is no multiple of
        some power of two, and it may sum in another order there. Which code is taken depends on
        shapes alone, so random numbers tell.
        """
        x = np.random.default_rng(0).standard_normal((_BLOCK, self.inputs)).astype(np.float32)
        whole = self._forward(x)
        return all(
            np.array_equal(self._forward(x[first : first + rows]), whole[first : first + rows])
            for rows in _SMALL_BLOCKS
            for first in range(0, _BLOCK, rows)
        )

    def _standardised(self, X: _Array) -> _Array:
        scaled: _Array = (X - self._mean) * self._scale
        return np.clip(scaled, -INPUT_LIMIT, INPUT_LIMIT, out=scaled)

    def _forward(self, x: NDArray[np.float32]) -> NDArray[np.float32]:
        for weight, bias in zip(self._weights[:-1], self._biases[:-1], strict=True):
            x = x @ weight
            x += bias
            # SiLU, x / (1 + exp(-x)); the exponential must not overflow.
            gate = np.exp(-np.maximum(x, np.float32(-80.0)))
            gate += np.float32(1.0)
            x /= gate
        return np.asarray(x @ self._weights[-1] + self._biases[-1])
