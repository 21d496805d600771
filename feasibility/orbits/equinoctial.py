"""Modified equinoctial elements: conversion to and from classical elements and Cartesian states.

Arrays of shape (..., 6), float64 in SI units and radians: the modified equinoctial elements
p [m], f, g, h, k and the TRUE longitude L [rad] (Walker, Ireland, Owens, "A set of modified
equinoctial orbit elements", Celestial Mechanics 36, 1985). They describe any conic; an
inclination of exactly 180 degrees has none and is an `InputError`. Classical elements are those
of `classical`. All angles returned lie in [0, 2 pi).
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from feasibility.constants import MU_SUN
from feasibility.orbits.classical import mean_to_eccentric
from feasibility.orbits.element_rows import columns_of, ellipses, require, split_states, turn


def classical_to_equinoctial(elements: ArrayLike) -> NDArray[np.float64]:
    """Convert classical elements (with mean anomaly) to modified equinoctial elements.

    p = a (1 - e^2), f + i g = e exp(i (argp + node)), h + i k = tan(i/2)
    exp(i node), L = node + argp + true anomaly (Walker et al. 1985).

    Parameters
    ----------
    elements : array_like
        (..., 6): a [m], e, i, node, argp, M [rad].

    Returns
    -------
    NDArray
        (..., 6) float64: p [m], f, g, h, k, L [rad].

    Raises
    ------
    InputError
        Wrong shape, a row that is not an ellipse, or i = pi.
    """
    a, e, inclination, node, argp, mean = ellipses(elements)
    half_tangent = np.tan(inclination / 2.0)
    require(
        np.abs(half_tangent) < 1e12,
        "classical_to_equinoctial",
        "an inclination of 180 degrees has no equinoctial elements",
    )
    anomaly = mean_to_eccentric(mean, e)
    true = np.arctan2(
        np.sqrt((1.0 - e) * (1.0 + e)) * np.sin(anomaly),
        np.cos(anomaly) - e,
    )
    pericentre = node + argp
    return np.stack(
        [
            a * (1.0 - e) * (1.0 + e),
            e * np.cos(pericentre),
            e * np.sin(pericentre),
            half_tangent * np.cos(node),
            half_tangent * np.sin(node),
            turn(pericentre + true),
        ],
        axis=-1,
    )


def equinoctial_to_classical(elements: ArrayLike) -> NDArray[np.float64]:
    """Convert modified equinoctial elements to classical ones (with mean anomaly).

    Parameters
    ----------
    elements : array_like
        (..., 6): p [m], f, g, h, k, L [rad].

    Returns
    -------
    NDArray
        (..., 6) float64: a [m], e, i, node, argp, M [rad]. See
        `feasibility.orbits.classical` for circular and equatorial orbits.

    Raises
    ------
    InputError
        Wrong shape, p <= 0, or a row that is not an ellipse.
    """
    p, f, g, h, k, longitude = _split_equinoctial(elements, "equinoctial_to_classical")
    e = np.hypot(f, g)
    require(
        e < 1.0,
        "equinoctial_to_classical",
        "the orbit is not an ellipse; classical elements describe bound orbits only",
    )
    half_tangent = np.hypot(h, k)
    node = np.where(half_tangent > 0, np.arctan2(k, h), 0.0)
    pericentre = np.where(e > 0, np.arctan2(g, f), node)
    true = longitude - pericentre
    anomaly = np.arctan2(np.sqrt((1.0 - e) * (1.0 + e)) * np.sin(true), e + np.cos(true))
    return np.stack(
        [
            p / ((1.0 - e) * (1.0 + e)),
            e,
            2.0 * np.arctan(half_tangent),
            turn(node),
            turn(pericentre - node),
            turn(anomaly - e * np.sin(anomaly)),
        ],
        axis=-1,
    )


def equinoctial_to_cartesian(elements: ArrayLike, mu: float = MU_SUN) -> NDArray[np.float64]:
    """Convert modified equinoctial elements of any conic to position and velocity.

    Parameters
    ----------
    elements : array_like
        (..., 6): p [m], f, g, h, k, L [rad].
    mu : float
        Gravitational parameter in m3/s2.

    Returns
    -------
    NDArray
        (..., 6) float64, m and m/s.

    Raises
    ------
    InputError
        Wrong shape, p <= 0, or a true longitude beyond the asymptote of a
        hyperbola (1 + f cos L + g sin L <= 0).
    """
    p, f, g, h, k, longitude = _split_equinoctial(elements, "equinoctial_to_cartesian")
    cos_l, sin_l = np.cos(longitude), np.sin(longitude)
    w = 1.0 + f * cos_l + g * sin_l
    require(
        w > 0,
        "equinoctial_to_cartesian",
        "the true longitude lies beyond the asymptote of the hyperbola",
    )
    along, across = _equinoctial_axes(h, k)
    speed = np.sqrt(mu / p)
    position = (p / w * cos_l)[..., None] * along + (p / w * sin_l)[..., None] * across
    velocity = (-speed * (g + sin_l))[..., None] * along + (speed * (f + cos_l))[
        ..., None
    ] * across
    return np.concatenate([position, velocity], axis=-1)


def cartesian_to_equinoctial(states: ArrayLike, mu: float = MU_SUN) -> NDArray[np.float64]:
    """Convert position and velocity on any conic to modified equinoctial elements.

    Parameters
    ----------
    states : array_like
        (..., 6), m and m/s.
    mu : float
        Gravitational parameter in m3/s2.

    Returns
    -------
    NDArray
        (..., 6) float64: p [m], f, g, h, k, L [rad] with L in [0, 2 pi).

    Raises
    ------
    InputError
        Wrong shape, motion along a straight line through the centre, or an
        inclination of 180 degrees.
    """
    position, velocity = split_states(states)
    radius = np.linalg.norm(position, axis=-1)
    momentum = np.cross(position, velocity)
    size = np.linalg.norm(momentum, axis=-1)
    require(
        size > 0,
        "cartesian_to_equinoctial",
        "the motion is along a straight line through the centre",
    )
    normal = momentum / size[..., None]
    upright = 1.0 + normal[..., 2]
    require(
        upright > 0,
        "cartesian_to_equinoctial",
        "an inclination of 180 degrees has no equinoctial elements",
    )
    # 1 + cos i loses its digits near i = pi; sin^2 i / (1 - cos i) does not.
    tilt2 = normal[..., 0] ** 2 + normal[..., 1] ** 2
    upright = np.where(normal[..., 2] < 0, tilt2 / np.maximum(1.0 - normal[..., 2], 1.0), upright)
    h, k = -normal[..., 1] / upright, normal[..., 0] / upright
    along, across = _equinoctial_axes(h, k)
    # The eccentricity vector: (v x h)/mu - r/|r|.
    pull = np.cross(velocity, momentum) / mu - position / radius[..., None]
    longitude = np.arctan2(
        np.einsum("...i,...i->...", position, across),
        np.einsum("...i,...i->...", position, along),
    )
    return np.stack(
        [
            size**2 / mu,
            np.einsum("...i,...i->...", pull, along),
            np.einsum("...i,...i->...", pull, across),
            h,
            k,
            turn(longitude),
        ],
        axis=-1,
    )


def _equinoctial_axes(
    h: NDArray[np.float64], k: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the unit vectors of the orbit plane from which L counts (Walker et al. 1985)."""
    s2 = 1.0 + h * h + k * k
    along = np.stack([1.0 + h * h - k * k, 2.0 * h * k, -2.0 * k], axis=-1)
    across = np.stack([2.0 * h * k, 1.0 - h * h + k * k, 2.0 * h], axis=-1)
    return along / s2[..., None], across / s2[..., None]


def _split_equinoctial(elements: ArrayLike, what: str) -> list[NDArray[np.float64]]:
    columns = columns_of(elements, "equinoctial elements")
    require(columns[0] > 0, what, "the semilatus rectum p is not more than zero")
    return columns
