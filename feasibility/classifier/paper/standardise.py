"""Standardisation of features (equation 5 of the paper)."""

from dataclasses import dataclass
from typing import Self, final

import numpy as np
from numpy.typing import NDArray


@final
@dataclass(frozen=True, eq=False)
class Standardiser:
    """Shifts and scales each feature to mean 0 and standard deviation 1 (equation 5).

    With k the number of features.

    Attributes
    ----------
    mean : (k,) float64
        In the feature's unit.
    std : (k,) float64
        In the feature's unit; for a feature that is constant in training, its
        size, or 1 if it is zero.
    """

    mean: NDArray[np.float64]
    std: NDArray[np.float64]

    @classmethod
    def fit(cls, X: NDArray[np.float64]) -> Self:
        """Measure mean and standard deviation of training features (n, k)."""
        mean, std = X.mean(axis=0), X.std(axis=0)
        # Below rounding the spread is noise: a constant feature must not be blown up by it.
        size = np.abs(mean)
        constant = std <= 1e-12 * size
        return cls(mean, np.where(constant, np.where(size > 0.0, size, 1.0), std))

    def transform(self, X: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return (n, k) standardised features."""
        return (X - self.mean) / self.std
