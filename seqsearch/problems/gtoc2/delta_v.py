"""How much velocity change transfers need, and all of them that a tour still has ahead."""

from itertools import combinations
from typing import Final

import numpy as np
from numpy.typing import NDArray

from feasibility.constants import MU_SUN
from feasibility.orbits import Catalogue
from seqsearch.problems.gtoc2.group_sets import GroupSets

_Array = NDArray[np.float64]

_SPEED_WEIGHT: Final = 1.3
_PLANE_WEIGHT: Final = 2.2
_ECCENTRICITY_WEIGHT: Final = 0.16
"""Weights of squares, fitted to what the trained model says of transfers of one to three years
from near the Earth to the main belt, at their best epochs: right within 3 %."""

_RARITY: Final = 6
"""Phases fit only now and then: what counts is not the nearest body but the sixth."""


def transfer_delta_v(catalogue: Catalogue) -> _Array:
    """Return (n, n) m/s, the velocity changes of low-thrust transfers at the best phases.

    The root of the weighted squares of three differences: in the speed on circular
    orbits of the same size, in the plane (angle times the lower of the two speeds), and
    in the eccentricity vector (times the geometric mean of the speeds).
    """
    a, e, i, node, argp = catalogue.elements[:, :5].T
    speed = np.sqrt(MU_SUN / a)
    normal = np.column_stack([np.sin(i) * np.sin(node), -np.sin(i) * np.cos(node), np.cos(i)])
    angle = np.arccos(np.clip(normal @ normal.T, -1.0, 1.0))
    plane = angle * np.minimum(speed[:, None], speed)
    perihelion = node + argp
    vector = e[:, None] * np.column_stack([np.cos(perihelion), np.sin(perihelion)])
    gap = np.linalg.norm(vector[:, None] - vector, axis=2) * np.sqrt(speed[:, None] * speed)
    delta_v: _Array = np.sqrt(
        _SPEED_WEIGHT * (speed[:, None] - speed) ** 2
        + _PLANE_WEIGHT * plane**2
        + _ECCENTRICITY_WEIGHT * gap**2
    )
    return delta_v


def delta_v_to_go(delta_v: _Array, groups: GroupSets) -> _Array:
    """Return (2^g, n) m/s: from each body, by way of one body of each group of each set.

    Parameters
    ----------
    delta_v : (n, n) float64, m/s
        Between bodies.
    groups : GroupSets
        g groups of the n bodies.
    """
    g = groups.count
    to_go = np.zeros((1 << g, len(delta_v)))
    for size in range(1, g + 1):
        for members in combinations(range(g), size):
            whole = sum(1 << k for k in members)
            nearest = []
            for k in members:
                bodies = np.flatnonzero(groups.of_body == k)
                way = delta_v[:, bodies] + to_go[whole & ~(1 << k), bodies]
                rank = min(_RARITY, len(bodies)) - 1
                nearest.append(np.partition(way, rank, axis=1)[:, rank])
            to_go[whole] = np.min(nearest, axis=0)
    return to_go
