"""Lambert's problem for a batch of legs, and the velocity change that its arcs cost."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from feasibility.constants import MU_SUN
from feasibility.errors import InputError
from feasibility.orbits.transfer_plane import along_departure, off_singular


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

    start, end = _vectors("r1", r1, 3), _vectors("r2", r2, 3)
    times = np.ascontiguousarray(tof_s, dtype=np.float64)
    if len(start) != len(end) or times.shape != (len(start),):
        raise InputError(
            f"lambert: r1, r2 and tof_s must have the same number of rows, got {len(start)}, "
            f"{len(end)} and shape {times.shape}"
        )
    if max_revs < 0:
        raise InputError(f"lambert: max_revs is {max_revs}, expected zero or more")
    return lambert_batch(start, end, times, int(max_revs), float(mu))


def lambert_delta_v(
    rv_dep: ArrayLike,
    rv_arr: ArrayLike,
    tof_s: ArrayLike,
    max_revs: int = 2,
    mu: float = MU_SUN,
    *,
    vinf_dep: ArrayLike = 0.0,
    vinf_arr: ArrayLike = 0.0,
) -> NDArray[np.float64]:
    """Return the least sum of both impulses over all branches.

    The arcs go round as the departure orbit does, be it prograde or retrograde. Where the
    positions are exactly at 0 or 180 degrees the arcs lie in the plane of the departure orbit.

    Parameters
    ----------
    rv_dep, rv_arr : array_like
        (n, 6) float64, m and m/s: states at departure and arrival.
    tof_s : array_like
        (n,) s, or one value: time of flight.
    max_revs : int
        Largest number of complete revolutions.
    mu : float
        Gravitational parameter in m3/s2.
    vinf_dep, vinf_arr : array_like
        (n,) m/s, or one value: how much of each impulse costs nothing, the largest excess
        velocities; inf for all of it.

    Returns
    -------
    (n,) float64, m/s
        inf where no branch exists.

    Raises
    ------
    InputError
        The shapes do not fit, or `max_revs` is negative.
    """
    costs = _arcs(rv_dep, rv_arr, tof_s, max_revs, mu, vinf_dep, vinf_arr)[-1]
    least: NDArray[np.float64] = costs.min(axis=1)
    return least


def with_lambert_excess(
    rv_dep: ArrayLike,
    rv_arr: ArrayLike,
    tof_s: ArrayLike,
    vinf_dep: ArrayLike,
    vinf_arr: ArrayLike,
    max_revs: int = 2,
    mu: float = MU_SUN,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return end states with the excess of the cheapest Lambert arc, cut to its bounds.

    Parameters
    ----------
    rv_dep, rv_arr, tof_s, vinf_dep, vinf_arr, max_revs, mu
        As for `lambert_delta_v`.

    Returns
    -------
    rv_dep, rv_arr : (n, 6) float64, m and m/s
        End states, mirrored where the departure orbit is retrograde.
    rest : (n,) float64, m/s
        What is left of both impulses; inf where no branch exists, and the states are the bodies'.
    """
    start, end, v1, v2, rest = _arcs(rv_dep, rv_arr, tof_s, max_revs, mu, vinf_dep, vinf_arr)
    rows = np.arange(len(start))
    best = rest.argmin(axis=1)
    least = rest[rows, best]
    states = start.copy(), end.copy()
    for state, v, bound in zip(states, (v1, v2), (vinf_dep, vinf_arr), strict=True):
        excess = v[rows, best] - state[:, 3:]
        size = np.linalg.norm(excess, axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.where(size > bound, bound / size, 1.0)
        known = np.isfinite(least)
        state[known, 3:] += (share[:, None] * excess)[known]
    return states[0], states[1], least


def _arcs(
    rv_dep: ArrayLike,
    rv_arr: ArrayLike,
    tof_s: ArrayLike,
    max_revs: int,
    mu: float,
    vinf_dep: ArrayLike,
    vinf_arr: ArrayLike,
) -> tuple[NDArray[np.float64], ...]:
    """Return both states, the arcs' velocities (n, b, 3), and (n, b) what they cost; inf if none.

    The states are those of prograde departures.
    """
    start, end = _vectors("rv_dep", rv_dep, 6), _vectors("rv_arr", rv_arr, 6)
    times = np.full(len(start), tof_s) if np.ndim(tof_s) == 0 else tof_s
    if len(start) == len(end):
        start, end = along_departure(start, off_singular(start, end))
    v1, v2 = lambert(start[:, :3], end[:, :3], times, max_revs, mu)
    impulses = _beyond(np.linalg.norm(v1 - start[:, None, 3:], axis=2), vinf_dep)
    impulses += _beyond(np.linalg.norm(end[:, None, 3:] - v2, axis=2), vinf_arr)
    return start, end, v1, v2, np.where(np.isnan(impulses), np.inf, impulses)


def _beyond(impulses: NDArray[np.float64], bound: ArrayLike) -> NDArray[np.float64]:
    """Return by how much impulses (n, b) exceed bounds (n,), or one."""
    if not np.any(bound):
        return impulses
    limit = np.asarray(bound, dtype=np.float64).reshape(-1, 1)
    return np.maximum(impulses - limit, 0.0)


def _vectors(name: str, value: ArrayLike, size: int) -> NDArray[np.float64]:
    array = np.ascontiguousarray(value, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] != size:
        raise InputError(f"lambert {name}: expected shape (n, {size}), got {array.shape}")
    return array
