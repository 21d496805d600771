"""Epochs of launches that cover a window."""

import numpy as np
from numpy.typing import NDArray


def launch_epochs(
    window: tuple[float, float], n: int, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Return (n,) epochs, one drawn from each of n equal slices of a window, in order.

    Every pass draws others.
    """
    earliest, latest = window
    epochs: NDArray[np.float64] = earliest + (np.arange(n) + rng.random(n)) / n * (
        latest - earliest
    )
    return epochs
