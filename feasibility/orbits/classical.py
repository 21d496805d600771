"""Classical elements: Kepler's equation, and conversion to and from Cartesian states.

Everything is vectorised over the last axis: arrays of shape (..., 6), usually
(n, 6), float64 in SI units and radians.

- classical: semi-major axis a [m], eccentricity e, inclination i, longitude of
  the ascending node, argument of pericentre, MEAN anomaly M [rad];
- Cartesian: position [m] and velocity [m/s].

Classical elements describe ellipses only (0 <= e < 1); an unbound orbit is an
`InputError`.

Singular cases have one documented answer each, so that a round trip always
returns the same state:

- exactly equatorial orbit (i = 0 or i = pi): the node is 0, on the x axis;
- exactly circular orbit: the argument of pericentre is 0 and M counts from the
  node.

Near these cases single angles are ill-determined, but their sums, and with
them the state, are not. All angles returned lie in [0, 2 pi).
"""

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from feasibility.constants import MU_SUN
from feasibility.orbits.element_rows import TWO_PI, ellipses, require, split_states, turn

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
    turns = np.round(mean / TWO_PI)
    reduced = mean - turns * TWO_PI
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
    result: NDArray[np.float64] = np.copysign(root, reduced) + turns * TWO_PI
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
    a, e, _, _, _, mean = ellipses(elements)
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
    a, e, inclination, node, argp, _ = ellipses(elements)
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
    position, velocity = split_states(states)
    radius = np.linalg.norm(position, axis=-1)
    momentum = np.cross(position, velocity)
    momentum_size = np.linalg.norm(momentum, axis=-1)
    speed2 = np.einsum("...i,...i->...", velocity, velocity)
    with np.errstate(divide="ignore", invalid="ignore"):
        a = 1.0 / (2.0 / radius - speed2 / mu)
    require(
        (a > 0) & np.isfinite(a) & (momentum_size > 0),
        "cartesian_to_classical",
        "the state is not on an ellipse; classical elements describe bound orbits only",
    )
    e_cos = radius * speed2 / mu - 1.0
    e_sin = np.einsum("...i,...i->...", position, velocity) / np.sqrt(mu * a)
    e = np.hypot(e_cos, e_sin)
    anomaly = np.arctan2(e_sin, e_cos)
    require(
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
    return np.stack([a, e, inclination, turn(node), turn(argp), turn(mean)], axis=-1)
