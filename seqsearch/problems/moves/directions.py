"""Directions spread evenly over the sphere, and around others."""

import numpy as np
from numpy.typing import NDArray

_Array = NDArray[np.float64]


def even_directions(n: int) -> _Array:
    """Return (2n, 3) unit vectors: n along a spiral over a half sphere, then their negatives."""
    k = np.arange(n) + 0.5
    z = 1.0 - k / n
    angle = np.pi * (1.0 + np.sqrt(5.0)) * k
    ring = np.sqrt(1.0 - z * z)
    half = np.column_stack([ring * np.cos(angle), ring * np.sin(angle), z])
    return np.concatenate([half, -half])


def ring_around(direction: _Array, angle_rad: float, count: int) -> _Array:
    """Return (n, count, 3) unit vectors evenly around each of (n, 3) at an angle from it."""
    # Any vector that is not parallel will do to begin with.
    aside = np.eye(3)[np.abs(direction).argmin(axis=1)]
    u = np.cross(direction, aside)
    u /= np.linalg.norm(u, axis=1)[:, None]
    w = np.cross(direction, u)
    phi = 2.0 * np.pi * np.arange(count) / count
    around = np.cos(phi)[:, None] * u[:, None] + np.sin(phi)[:, None] * w[:, None]
    ring: _Array = np.cos(angle_rad) * direction[:, None] + np.sin(angle_rad) * around
    return ring
