"""Lambert's problem for a batch of legs."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from feasibility.constants import MU_SUN
from feasibility.errors import InputError


def lambert(
    r1: ArrayLike,
    r2: ArrayLike,
    tof_s: ArrayLike,
    max_revs: int = 0,
    mu: float = MU_SUN,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Solve Lambert's problem for many legs and all revolution counts.

    With n the number of legs and b = 1 + 2 `max_revs` the number of branches,
    ordered as pykep does: the direct transfer, then two branches for one
    revolution, two for two, and so on.

    Parameters
    ----------
    r1, r2 : array_like
        (n, 3) float64, m: positions at departure and arrival.
    tof_s : array_like
        (n,) float64, s: time of flight.
    max_revs : int
        Largest number of complete revolutions.
    mu : float
        Gravitational parameter in m3/s2.

    Returns
    -------
    v1, v2 : (n, b, 3) float64, m/s
        Velocities at departure and arrival, prograde (angular momentum with
        z >= 0). NaN where a branch does not exist, and everywhere where the
        plane of the transfer is undefined (exactly 0 or 180 degrees).

    Raises
    ------
    InputError
        The shapes do not fit, or `max_revs` is negative.

    Notes
    -----
    Izzo 2015, "Revisiting Lambert's problem"; see `lambert_kernels`.

    Examples
    --------
    A quarter of a circle:

    >>> v1, v2 = lambert([[1.0, 0, 0]], [[0, 1.0, 0]], [np.pi / 2], mu=1.0)
    >>> bool(np.allclose(v1[0, 0], [0, 1, 0], atol=1e-14))
    True
    """
    from feasibility.orbits.lambert_kernels import lambert_batch

    start, end = _positions("r1", r1), _positions("r2", r2)
    times = np.ascontiguousarray(tof_s, dtype=np.float64)
    if len(start) != len(end) or times.shape != (len(start),):
        raise InputError(
            f"lambert: r1, r2 and tof_s must have the same number of rows, got {len(start)}, "
            f"{len(end)} and shape {times.shape}"
        )
    if max_revs < 0:
        raise InputError(f"lambert: max_revs is {max_revs}, expected zero or more")
    return lambert_batch(start, end, times, int(max_revs), float(mu))


def _positions(name: str, value: ArrayLike) -> NDArray[np.float64]:
    array = np.ascontiguousarray(value, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] != 3:
        raise InputError(f"lambert {name}: expected shape (n, 3), got {array.shape}")
    return array
