"""How far apart orbits are when phase is left out: which targets are worth a look."""

import numpy as np
from numpy.typing import NDArray

from feasibility.constants import EARTH_VELOCITY
from feasibility.orbits import Catalogue


def phase_free_points(catalogue: Catalogue) -> NDArray[np.float64]:
    """Return (n, 5) points in m/s whose distance estimates the velocity change between orbits.

    For small differences on near-circular orbits with speed v, a change of the
    semi-major axis costs v da / 2a, of the eccentricity vector v de / 2, of the
    inclination vector v di (Gauss's equations, thrust at the best places); the
    three are put together as if they were independent, with v that of the Earth.
    """
    a, e, i, node, argp = catalogue.elements[:, :5].T
    perihelion = node + argp
    points: NDArray[np.float64] = EARTH_VELOCITY * np.column_stack(
        [
            0.5 * np.log(a),
            0.5 * e * np.cos(perihelion),
            0.5 * e * np.sin(perihelion),
            np.sin(i) * np.cos(node),
            np.sin(i) * np.sin(node),
        ]
    )
    return points
