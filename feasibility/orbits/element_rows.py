"""What conversions of elements share: the shape of rows, what is an ellipse, and angles."""

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from feasibility.errors import InputError

TWO_PI: Final = 2.0 * np.pi


def turn(angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Reduce to [0, 2 pi); a tiny negative angle becomes 0, not 2 pi."""
    reduced = np.mod(angle, TWO_PI)
    return np.where(reduced >= TWO_PI, 0.0, reduced)


def columns_of(array: ArrayLike, what: str) -> list[NDArray[np.float64]]:
    """Return the six columns of an array of shape (..., 6), or raise `InputError`."""
    values = np.asarray(array, dtype=np.float64)
    if values.ndim == 0 or values.shape[-1] != 6:
        raise InputError(f"{what}: expected shape (..., 6), got {values.shape}")
    return [values[..., column] for column in range(6)]


def ellipses(elements: ArrayLike) -> list[NDArray[np.float64]]:
    """Return the columns of classical elements, or raise `InputError` where one is no ellipse."""
    columns = columns_of(elements, "classical elements")
    a, e = columns[0], columns[1]
    require(
        (a > 0) & np.isfinite(a) & (e >= 0) & (e < 1),
        "classical elements",
        "not an ellipse: expected a > 0 and 0 <= e < 1",
    )
    return columns


def split_states(states: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return positions and velocities, (..., 3) each."""
    columns_of(states, "states")
    values = np.asarray(states, dtype=np.float64)
    return values[..., :3], values[..., 3:]


def require(good: NDArray[np.bool_], what: str, message: str) -> None:
    """Raise `InputError` that names the first row where something is not good."""
    if not np.all(good):
        row = int(np.argmin(np.ravel(good)))
        raise InputError(f"{what}, row {row}: {message}")
