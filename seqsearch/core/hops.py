"""`Hops`: from nodes to their next visits."""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from feasibility import Legs
from feasibility.arrays import StructOfArrays


@final
@dataclass(frozen=True, eq=False)
class Hops(StructOfArrays):
    """From nodes to their next visits, each hop in one or more legs.

    With n the number of hops; all have the same number of legs.

    Parameters
    ----------
    legs : tuple of Legs
        The first legs of all hops, then the second legs, and so on, each n long, with
        departure epochs and ids of bodies of the catalogue. A leg begins when the one
        before ends. Initial masses of all but the first are predictions; the search
        solves the legs in order, each with the mass that the one before left.
    dropped_kg : tuple of (n,) float64
        The masses left behind at the ends of the first legs, of the second legs, and so on.
    """

    legs: tuple[Legs, ...]
    dropped_kg: tuple[NDArray[np.float64], ...]

    @property
    def t_dep_mjd2000(self) -> NDArray[np.float64]:
        """(n,) departure epoch."""
        return _departure(self.legs[0])

    @property
    def t_arr_mjd2000(self) -> NDArray[np.float64]:
        """(n,) arrival epoch at the next visit."""
        return _departure(self.legs[-1]) + self.legs[-1].tof_days

    @property
    def tof_days(self) -> NDArray[np.float64]:
        """(n,) time of flight of all legs together."""
        total: NDArray[np.float64] = np.sum([legs.tof_days for legs in self.legs], axis=0)
        return total


def _departure(legs: Legs) -> NDArray[np.float64]:
    assert legs.t_dep_mjd2000 is not None
    return legs.t_dep_mjd2000
