"""Conversions between classical, modified equinoctial and Cartesian elements.

Everything is vectorised over the last axis: arrays of shape (..., 6), usually
(n, 6), float64 in SI units and radians.

- classical: semi-major axis a [m], eccentricity e, inclination i, longitude of
  the ascending node, argument of pericentre, MEAN anomaly M [rad];
- equinoctial: the modified equinoctial elements p [m], f, g, h, k and the TRUE
  longitude L [rad] (Walker, Ireland, Owens, "A set of modified equinoctial
  orbit elements", Celestial Mechanics 36, 1985);
- Cartesian: position [m] and velocity [m/s].

Classical elements describe ellipses only (0 <= e < 1); an unbound orbit is an
`InputError`. Cartesian and equinoctial elements describe any conic.

Singular cases have one documented answer each, so that a round trip always
returns the same state:

- exactly equatorial orbit (i = 0 or i = pi): the node is 0, on the x axis;
- exactly circular orbit: the argument of pericentre is 0 and M counts from the
  node;
- i = pi exactly has no equinoctial elements: `InputError`.

Near these cases single angles are ill-determined, but their sums, and with
them the state, are not. All angles returned lie in [0, 2 pi).
"""

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from feasibility.constants import MU_SUN
from feasibility.errors import InputError

_TWO_PI: Final = 2.0 * np.pi
_MAX_NEWTON_STEPS: Final = 60


def mean_to_eccentric(mean_anomaly: ArrayLike, eccentricity: ArrayLike) -> NDArray[np.float64]:
    """Solve Kepler's equation E - e sin E = M.

    Newton's method from an upper bound of the root in [0, pi]: there the
    equation is convex in E, so that the iteration descends monotonically to
    the root for every e in [0, 1). The bound is the least of M + e, M/(1 - e)
    and (pi^2 M)^(1/3); the last holds because (E - sin E)/E^3 falls from 1/6
    to 1/pi^2 on that interval, and it keeps the count of steps small where e
    approaches 1.

    Parameters
    ----------
    mean_anomaly : array_like
        Mean anomaly in rad, any value.
    eccentricity : array_like
        Eccentricity, 0 <= e < 1, broadcast with `mean_anomaly`.

    Returns
    -------
    NDArray
        Eccentric anomaly in rad, in the same half turn as the mean anomaly.
    """
    mean, e = np.broadcast_arrays(
        np.asarray(mean_anomaly, dtype=np.float64), np.asarray(eccentricity, dtype=np.float64)
    )
    turns = np.round(mean / _TWO_PI)
    reduced = mean - turns * _TWO_PI
    target = np.abs(reduced)
    root = np.minimum(
        np.minimum(target + e, np.pi),
        np.minimum(target / (1.0 - e), np.cbrt(np.pi**2 * target)),
    )
    for _ in range(_MAX_NEWTON_STEPS):
        step = (root - e * np.sin(root) - target) / (1.0 - e * np.cos(root))
        root = root - step
        if not np.any(step > 1e-15 * root):
            break
    result: NDArray[np.float64] = np.copysign(root, reduced) + turns * _TWO_PI
    return result


def classical_to_cartesian(elements: ArrayLike, mu: float = MU_SUN) -> NDArray[np.float64]:
    """Convert classical elements (with mean anomaly) to position and velocity.

    Parameters
    ----------
    elements : array_like
        (..., 6): a [m], e, i, node, argp, M [rad].
    mu : float
        Gravitational parameter in m3/s2.

    Returns
    -------
    NDArray
        (..., 6) float64, m and m/s.

    Raises
    ------
    InputError
        Wrong shape, or a row that is not an ellipse (a <= 0, e outside [0, 1)).
    """
    a, e, _, _, _, mean = _ellipses(elements)
    along, across = perifocal_axes(elements)
    anomaly = mean_to_eccentric(mean, e)
    cos_e, sin_e = np.cos(anomaly), np.sin(anomaly)
    rate = np.sqrt(mu / a) / a / (1.0 - e * cos_e)
    position = (cos_e - e)[..., None] * along + sin_e[..., None] * across
    velocity = (-rate * sin_e)[..., None] * along + (rate * cos_e)[..., None] * across
    return np.concatenate([position, velocity], axis=-1)


def perifocal_axes(elements: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the semi-axis vectors of ellipses.

    With A and B these vectors, the position at eccentric anomaly E is
    (cos E - e) A + sin E B (e.g. Battin, "An Introduction to the Mathematics
    and Methods of Astrodynamics", 1999, section 4.3).

    Parameters
    ----------
    elements : array_like
        (..., 6) classical elements, m and rad.

    Returns
    -------
    tuple of NDArray
        (..., 3) and (..., 3), m: A from the centre to the pericentre, with
        length a, and B, a quarter turn further, with length a sqrt(1 - e^2).

    Raises
    ------
    InputError
        As for `classical_to_cartesian`.
    """
    a, e, inclination, node, argp, _ = _ellipses(elements)
    b = a * np.sqrt((1.0 - e) * (1.0 + e))
    cos_i, sin_i = np.cos(inclination), np.sin(inclination)
    cos_n, sin_n = np.cos(node), np.sin(node)
    cos_w, sin_w = np.cos(argp), np.sin(argp)
    along = np.stack(
        [
            cos_n * cos_w - sin_n * sin_w * cos_i,
            sin_n * cos_w + cos_n * sin_w * cos_i,
            sin_w * sin_i,
        ],
        axis=-1,
    )
    across = np.stack(
        [
            -cos_n * sin_w - sin_n * cos_w * cos_i,
            -sin_n * sin_w + cos_n * cos_w * cos_i,
            cos_w * sin_i,
        ],
        axis=-1,
    )
    return a[..., None] * along, b[..., None] * across


def cartesian_to_classical(states: ArrayLike, mu: float = MU_SUN) -> NDArray[np.float64]:
    """Convert position and velocity to classical elements (with mean anomaly).

    Parameters
    ----------
    states : array_like
        (..., 6), m and m/s.
    mu : float
        Gravitational parameter in m3/s2.

    Returns
    -------
    NDArray
        (..., 6) float64: a [m], e, i, node, argp, M [rad]. See the module's
        text for circular and equatorial orbits.

    Raises
    ------
    InputError
        Wrong shape, or a row that is not an ellipse (parabola, hyperbola, or
        motion along a straight line).
    """
    position, velocity = _split_states(states)
    radius = np.linalg.norm(position, axis=-1)
    momentum = np.cross(position, velocity)
    momentum_size = np.linalg.norm(momentum, axis=-1)
    speed2 = np.einsum("...i,...i->...", velocity, velocity)
    with np.errstate(divide="ignore", invalid="ignore"):
        a = 1.0 / (2.0 / radius - speed2 / mu)
    _require(
        (a > 0) & np.isfinite(a) & (momentum_size > 0),
        "cartesian_to_classical",
        "the state is not on an ellipse; classical elements describe bound orbits only",
    )
    e_cos = radius * speed2 / mu - 1.0
    e_sin = np.einsum("...i,...i->...", position, velocity) / np.sqrt(mu * a)
    e = np.hypot(e_cos, e_sin)
    anomaly = np.arctan2(e_sin, e_cos)
    _require(
        e < 1.0,
        "cartesian_to_classical",
        "the eccentricity is 1 to machine precision; classical elements need less",
    )

    hx, hy, hz = (momentum[..., axis] / momentum_size for axis in range(3))
    tilt = np.hypot(hx, hy)
    inclination = np.arctan2(tilt, hz)
    node = np.where(tilt > 0, np.arctan2(hx, -hy), 0.0)
    toward_node = np.stack([np.cos(node), np.sin(node), np.zeros_like(node)], axis=-1)
    ahead = np.cross(momentum / momentum_size[..., None], toward_node)
    latitude = np.arctan2(
        np.einsum("...i,...i->...", position, ahead),
        np.einsum("...i,...i->...", position, toward_node),
    )
    true = np.arctan2(np.sqrt((1.0 - e) * (1.0 + e)) * np.sin(anomaly), np.cos(anomaly) - e)
    circular = e == 0
    argp = np.where(circular, 0.0, latitude - true)
    mean = np.where(circular, latitude, anomaly - e_sin)
    return np.stack([a, e, inclination, _turn(node), _turn(argp), _turn(mean)], axis=-1)


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
    a, e, inclination, node, argp, mean = _ellipses(elements)
    half_tangent = np.tan(inclination / 2.0)
    _require(
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
            _turn(pericentre + true),
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
        (..., 6) float64: a [m], e, i, node, argp, M [rad]. See the module's
        text for circular and equatorial orbits.

    Raises
    ------
    InputError
        Wrong shape, p <= 0, or a row that is not an ellipse.
    """
    p, f, g, h, k, longitude = _split_equinoctial(elements, "equinoctial_to_classical")
    e = np.hypot(f, g)
    _require(
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
            _turn(node),
            _turn(pericentre - node),
            _turn(anomaly - e * np.sin(anomaly)),
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
    _require(
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
    position, velocity = _split_states(states)
    radius = np.linalg.norm(position, axis=-1)
    momentum = np.cross(position, velocity)
    size = np.linalg.norm(momentum, axis=-1)
    _require(
        size > 0,
        "cartesian_to_equinoctial",
        "the motion is along a straight line through the centre",
    )
    normal = momentum / size[..., None]
    upright = 1.0 + normal[..., 2]
    _require(
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
            _turn(longitude),
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


def _turn(angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Reduce to [0, 2 pi); a tiny negative angle becomes 0, not 2 pi."""
    reduced = np.mod(angle, _TWO_PI)
    return np.where(reduced >= _TWO_PI, 0.0, reduced)


def _columns(array: ArrayLike, what: str) -> list[NDArray[np.float64]]:
    values = np.asarray(array, dtype=np.float64)
    if values.ndim == 0 or values.shape[-1] != 6:
        raise InputError(f"{what}: expected shape (..., 6), got {values.shape}")
    return [values[..., column] for column in range(6)]


def _ellipses(elements: ArrayLike) -> list[NDArray[np.float64]]:
    columns = _columns(elements, "classical elements")
    a, e = columns[0], columns[1]
    _require(
        (a > 0) & np.isfinite(a) & (e >= 0) & (e < 1),
        "classical elements",
        "not an ellipse: expected a > 0 and 0 <= e < 1",
    )
    return columns


def _split_states(states: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    _columns(states, "states")
    values = np.asarray(states, dtype=np.float64)
    return values[..., :3], values[..., 3:]


def _split_equinoctial(elements: ArrayLike, what: str) -> list[NDArray[np.float64]]:
    columns = _columns(elements, "equinoctial elements")
    _require(columns[0] > 0, what, "the semilatus rectum p is not more than zero")
    return columns


def _require(good: NDArray[np.bool_], what: str, message: str) -> None:
    if not np.all(good):
        row = int(np.argmin(np.ravel(good)))
        raise InputError(f"{what}, row {row}: {message}")
