"""Kernel: evaluation of binary decision trees."""

import numpy as np
from numpy.typing import NDArray

from feasibility.runtime.jit import kernel

_Array = NDArray[np.float64]
_Rows = NDArray[np.int64]


@kernel
def sum_of_leaves(
    X: _Array,
    feature: _Rows,
    threshold: _Array,
    left: _Rows,
    right: _Rows,
    value: _Array,
    root: _Rows,
) -> _Array:
    """Return (n,) the sum over trees of the value of the leaf that each row of `X` reaches.

    A row goes left where X[feature] <= threshold; a node is a leaf where `left` is -1.
    """
    n = X.shape[0]
    total = np.zeros(n)
    for i in range(n):
        for t in range(root.size):
            node = root[t]
            while left[node] >= 0:
                node = left[node] if X[i, feature[node]] <= threshold[node] else right[node]
            total[i] += value[node]
    return total
