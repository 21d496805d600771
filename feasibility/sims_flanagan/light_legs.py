"""Which legs may burn less on another arc than on that of m*: light ones."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from feasibility.constants import MU_SUN
from feasibility.legs import Legs

LIGHT: Final = 4.0
"""A leg this many times lighter than m* may burn less on another arc than on that of m*.

Below it two-impulse arcs won on fewer than 1 % of belt legs.
"""

LIGHT_AND_LONG: Final = 2.0
"""The same for legs of more than half a turn of either orbit.

Between 2 and 4, two-impulse arcs save more than 0.5 % of the final mass on 4 to 14 % of legs of
one to four turns and on 3 to 12 % of launches, up to a half.
"""

_LONG: Final = 0.5
"""Turns of the smaller of both orbits beyond which a leg is long."""


def are_light(legs: Legs, heaviest: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return (n,) whether other arcs than that of m* are worth looking at.

    Parameters
    ----------
    legs : Legs
        n legs.
    heaviest : (n,) float64, kg
        Their m*.
    """
    motion = np.maximum(_mean_motion(legs.rv_dep), _mean_motion(legs.rv_arr))
    long = motion * legs.tof_s > _LONG * 2.0 * np.pi
    light: NDArray[np.bool_] = legs.m0 * np.where(long, LIGHT_AND_LONG, LIGHT) < heaviest
    return light


def _mean_motion(states: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (n,) rad/s of states (n, 6), 0 on unbound orbits."""
    r, v = states[:, :3], states[:, 3:]
    inverse = 2.0 / np.sqrt(np.sum(r * r, axis=1)) - np.sum(v * v, axis=1) / MU_SUN
    motion: NDArray[np.float64] = np.sqrt(MU_SUN * np.maximum(inverse, 0.0) ** 3)
    return motion
