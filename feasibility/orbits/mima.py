"""Estimates of the maximum initial mass of legs, from Lambert arcs.

With n the number of legs and b = 1 + 2 `max_revs` the number of Lambert branches.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from feasibility.constants import MU_SUN
from feasibility.errors import InputError
from feasibility.orbits.transfer_plane import along_departure, off_singular


def mima(
    rv_dep: ArrayLike,
    rv_arr: ArrayLike,
    tof_s: ArrayLike,
    thrust: ArrayLike,
    exhaust_velocity: ArrayLike,
    max_revs: int = 2,
    mu: float = MU_SUN,
) -> NDArray[np.float64]:
    """Return the Maximum Initial Mass Approximation on the best Lambert branch.

    Arcs go round as the departure orbit does, be it prograde or retrograde. Where the positions
    are exactly at 0 or 180 degrees they lie in the plane of the departure orbit.

    Parameters
    ----------
    rv_dep, rv_arr : array_like
        (n, 6) float64, m and m/s: states at departure and arrival.
    tof_s : array_like
        (n,) s, or one value: time of flight.
    thrust : array_like
        (n,) N, or one value.
    exhaust_velocity : array_like
        (n,) m/s, or one value.
    max_revs : int
        Largest number of complete revolutions.
    mu : float
        Gravitational parameter in m3/s2.

    Returns
    -------
    (n,) float64, kg
        The largest over all branches; 0 where no branch exists.

    Raises
    ------
    InputError
        The shapes do not fit, or `max_revs` is negative.

    Notes
    -----
    Hennes, Izzo and Landau 2016, "Fast approximators for optimal low-thrust hops
    between main belt asteroids"; see `mima_kernels`.
    """
    return _best(
        mima_branches(rv_dep, rv_arr, tof_s, thrust, exhaust_velocity, max_revs=max_revs, mu=mu)
    )


def mima2(
    rv_dep: ArrayLike,
    rv_arr: ArrayLike,
    tof_s: ArrayLike,
    thrust: ArrayLike,
    exhaust_velocity: ArrayLike,
    max_revs: int = 2,
    mu: float = MU_SUN,
) -> NDArray[np.float64]:
    """Return MIMA2, which follows gravity along the arc, on the best Lambert branch.

    Parameters, units, return value and errors as for `mima`.

    Notes
    -----
    Izzo et al. 2025, "Asteroid mining: ACT&Friends' results for the GTOC12
    problem", arXiv 2410.20839; see `mima_kernels`.
    """
    return _best(
        mima2_branches(rv_dep, rv_arr, tof_s, thrust, exhaust_velocity, max_revs=max_revs, mu=mu)
    )


def mima_branches(
    rv_dep: ArrayLike,
    rv_arr: ArrayLike,
    tof_s: ArrayLike,
    thrust: ArrayLike,
    exhaust_velocity: ArrayLike,
    max_revs: int = 2,
    mu: float = MU_SUN,
) -> NDArray[np.float64]:
    """Return MIMA on each branch: (n, b) kg, NaN where the branch does not exist. See `mima`."""
    return _masses(rv_dep, rv_arr, tof_s, thrust, exhaust_velocity, max_revs, mu, refined=False)


def mima2_branches(
    rv_dep: ArrayLike,
    rv_arr: ArrayLike,
    tof_s: ArrayLike,
    thrust: ArrayLike,
    exhaust_velocity: ArrayLike,
    max_revs: int = 2,
    mu: float = MU_SUN,
) -> NDArray[np.float64]:
    """Return MIMA2 on each branch: (n, b) kg, NaN where the branch does not exist. See `mima2`."""
    return _masses(rv_dep, rv_arr, tof_s, thrust, exhaust_velocity, max_revs, mu, refined=True)


def _best(masses: NDArray[np.float64]) -> NDArray[np.float64]:
    best: NDArray[np.float64] = np.where(np.isnan(masses), 0.0, masses).max(axis=1)
    return best


def _masses(
    rv_dep: ArrayLike,
    rv_arr: ArrayLike,
    tof_s: ArrayLike,
    thrust: ArrayLike,
    exhaust_velocity: ArrayLike,
    max_revs: int,
    mu: float,
    *,
    refined: bool,
) -> NDArray[np.float64]:
    from feasibility.orbits.mima_kernels import maximum_mass_batch

    start, end = _states("rv_dep", rv_dep), _states("rv_arr", rv_arr)
    n = len(start)
    if len(end) != n:
        raise InputError(f"mima: rv_dep has {n} rows, rv_arr has {len(end)}")
    if max_revs < 0:
        raise InputError(f"mima: max_revs is {max_revs}, expected zero or more")
    times = _column("tof_s", tof_s, n)
    start, end = along_departure(start, off_singular(start, end))
    return maximum_mass_batch(
        start,
        end,
        times,
        _column("thrust", thrust, n),
        _column("exhaust_velocity", exhaust_velocity, n),
        int(max_revs),
        float(mu),
        refined,
    )


def _states(name: str, value: ArrayLike) -> NDArray[np.float64]:
    array = np.ascontiguousarray(value, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] != 6:
        raise InputError(f"mima {name}: expected shape (n, 6), got {array.shape}")
    return array


def _column(name: str, value: ArrayLike, n: int) -> NDArray[np.float64]:
    array = np.asarray(value, dtype=np.float64)
    if array.shape not in ((), (n,)):
        raise InputError(f"mima {name}: expected shape ({n},) or one value, got {array.shape}")
    return np.ascontiguousarray(np.broadcast_to(array, (n,)))
