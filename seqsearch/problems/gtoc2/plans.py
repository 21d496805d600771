"""`Plans`: predicted launches and transfers, one row a leg, and how long they shall take."""

from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility import Legs, Spacecraft
from feasibility.arrays import StructOfArrays
from feasibility.orbits import Catalogue
from seqsearch.core.margin_curves import MarginCurves
from seqsearch.core.nodes import Nodes
from seqsearch.problems.moves.legs_between import legs_between

_Array = NDArray[np.float64]
_Rows = NDArray[np.intp]

LEVELS: Final = (0.01, 0.05, 0.12, 0.25)
"""log(m*/m0) of the flights to a target: the shortest, and longer ones that save propellant."""


@final
@dataclass(frozen=True, eq=False)
class Plans(StructOfArrays):
    """Legs from nodes, n of them.

    Attributes
    ----------
    parent : (n,) intp
        Positions of the nodes.
    target : (n,) intp
        Catalogue rows of the targets.
    velocity : (n, 3) float64, m/s
        At departure, relative to the body left: zero but for launches.
    tof_days : (n,) float64
        Flight times.
    """

    parent: _Rows
    target: _Rows
    velocity: _Array
    tof_days: _Array

    def legs(self, nodes: Nodes, catalogue: Catalogue, spacecraft: Spacecraft) -> Legs:
        """Return the n legs."""
        return legs_between(
            catalogue,
            spacecraft,
            nodes.row[self.parent],
            self.target,
            nodes.t_ready_mjd2000[self.parent],
            self.tof_days,
            nodes.mass[self.parent],
            least_mass=spacecraft.m_dry,
            departure_velocity=self.velocity,
        )


def at_levels(curves: MarginCurves) -> tuple[_Rows, _Array]:
    """Return curves and flight times: for each of n curves, the shortest at each level."""
    times = np.column_stack([curves.shortest(level) for level in LEVELS])
    k, level = np.nonzero(np.isfinite(times))
    return k, times[k, level]
