"""Directions spread evenly over the sphere."""

import numpy as np
from numpy.typing import NDArray


def even_directions(n: int) -> NDArray[np.float64]:
    """Return (2n, 3) unit vectors: n along a spiral over a half sphere, then their negatives."""
    k = np.arange(n) + 0.5
    z = 1.0 - k / n
    angle = np.pi * (1.0 + np.sqrt(5.0)) * k
    ring = np.sqrt(1.0 - z * z)
    half = np.column_stack([ring * np.cos(angle), ring * np.sin(angle), z])
    return np.concatenate([half, -half])
