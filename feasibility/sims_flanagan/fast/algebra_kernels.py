"""Linear algebra of 6-vectors and 6 by 6 matrices for the fast leg solvers.

Written out because it is smaller, faster to compile and faster to run than LAPACK
calls at this size. Nothing is allocated, nothing validated.
"""

import math

import numpy as np
from numpy.typing import NDArray

from feasibility.runtime.jit import inner_kernel

_Array = NDArray[np.float64]


@inner_kernel
def cholesky(a: _Array, lower: _Array) -> bool:
    """Write the lower Cholesky factor of the (6, 6) matrix `a`; return whether it exists."""
    for i in range(6):
        for j in range(i + 1):
            total = a[i, j]
            for k in range(j):
                total -= lower[i, k] * lower[j, k]
            if i == j:
                if not total > 0.0:
                    return False
                lower[i, i] = math.sqrt(total)
            else:
                lower[i, j] = total / lower[j, j]
    return True


@inner_kernel
def solve_lower(lower: _Array, b: _Array) -> None:
    """Overwrite `b` (6,) with the solution of L x = b."""
    for i in range(6):
        total = b[i]
        for k in range(i):
            total -= lower[i, k] * b[k]
        b[i] = total / lower[i, i]


@inner_kernel
def solve_lower_transposed(lower: _Array, b: _Array) -> None:
    """Overwrite `b` (6,) with the solution of L^T x = b."""
    for i in range(5, -1, -1):
        total = b[i]
        for k in range(i + 1, 6):
            total -= lower[k, i] * b[k]
        b[i] = total / lower[i, i]


@inner_kernel
def multiply_lower_transposed(lower: _Array, b: _Array) -> None:
    """Overwrite `b` (6,) with L^T b."""
    for i in range(6):
        total = 0.0
        for k in range(i, 6):
            total += lower[k, i] * b[k]
        b[i] = total


@inner_kernel
def norm6(a: _Array) -> float:
    """Return the Euclidean norm of a 6-vector."""
    total = 0.0
    for i in range(6):
        total += a[i] * a[i]
    return math.sqrt(total)


@inner_kernel
def divide(a: _Array, b: _Array, quotient: _Array) -> bool:
    """Write a b^-1 of (6, 6) matrices by Gauss elimination on rows of b^T; destroys both."""
    # Solve q b = a, column by column of b: column operations on the stacked [b; a].
    for i in range(6):
        pivot = i
        for j in range(i + 1, 6):
            if abs(b[i, j]) > abs(b[i, pivot]):
                pivot = j
        if b[i, pivot] == 0.0:
            return False
        if pivot != i:
            for r in range(6):
                b[r, i], b[r, pivot] = b[r, pivot], b[r, i]
                a[r, i], a[r, pivot] = a[r, pivot], a[r, i]
        inverse = 1.0 / b[i, i]
        for r in range(6):
            b[r, i] *= inverse
            a[r, i] *= inverse
        for j in range(6):
            if j != i:
                factor = b[i, j]
                for r in range(6):
                    b[r, j] -= factor * b[r, i]
                    a[r, j] -= factor * a[r, i]
    for i in range(6):
        for j in range(6):
            quotient[i, j] = a[i, j]
    return True
