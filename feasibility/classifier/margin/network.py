"""The nets of the margin model, without torch: numpy and two kernels, in single precision."""

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

_CACHED: Final = 65536
"""Numbers of a layer at a time, which the processor's cache holds: of a narrow net several blocks.
The fewer calls of numpy, the less threads wait for each other."""


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
        # Copies are writable, as the compiled signatures want them.
        self._mean = np.array(arrays["mean"], dtype=np.float64)
        self._scale = 1.0 / np.asarray(arrays["std"], dtype=np.float64)
        self._unit = float(arrays["unit"])
        self._weights = [
            np.ascontiguousarray(arrays[f"weight_{i}"].T, dtype=np.float32) for i in range(count)
        ]
        self._biases = [np.array(arrays[f"bias_{i}"], dtype=np.float32) for i in range(count)]

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
        from feasibility.classifier.margin import network_kernels

        n, inputs = X.shape
        values = np.empty((n, 2))
        blocks = max(_CACHED // (_BLOCK * max(map(len, self._biases))), 1)
        with one_blas_thread():
            for first in range(0, n, blocks * _BLOCK):
                part = np.ascontiguousarray(X[first : first + blocks * _BLOCK], dtype=np.float64)
                rows = self._rows_of_product(len(part))
                x = np.zeros((-(-len(part) // rows), rows, inputs), dtype=np.float32)
                network_kernels.standardise(
                    part, self._mean, self._scale, INPUT_LIMIT, x.reshape(-1, inputs)
                )
                values[first : first + len(part)] = self._forward(x).reshape(-1, 2)[: len(part)]
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
        x = np.random.default_rng(0).standard_normal((1, _BLOCK, self.inputs)).astype(np.float32)
        whole = self._forward(x)
        return all(
            np.array_equal(
                self._forward(x.reshape(-1, rows, self.inputs)).reshape(whole.shape), whole
            )
            for rows in _SMALL_BLOCKS
        )

    def _forward(self, x: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the outputs for blocks (b, rows, k), each of them one product."""
        from feasibility.classifier.margin import network_kernels

        for weight, bias in zip(self._weights[:-1], self._biases[:-1], strict=True):
            x = x @ weight
            network_kernels.add_and_activate(x.reshape(-1, len(bias)), bias)
        return np.asarray(x @ self._weights[-1] + self._biases[-1])
