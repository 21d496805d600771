"""`Nodes`: the nodes of one rank of the beam, as a struct of arrays."""

from dataclasses import dataclass
from typing import Self, final

import numpy as np
from numpy.typing import NDArray


@final
@dataclass(frozen=True, eq=False)
class Nodes:
    """Nodes of one rank: where each spacecraft is, since when, and with what mass.

    With n the number of nodes and d the rank (legs flown so far).

    Attributes
    ----------
    row : (n,) intp
        Catalogue row of the body at which the spacecraft is.
    t_ready_mjd2000 : (n,) float64
        Earliest epoch of the next departure: arrival plus stay, or the start epoch.
    t_arr_mjd2000 : (n,) float64
        Epoch of the arrival; the start epoch at rank 0.
    t_first_mjd2000 : (n,) float64
        Epoch of the tour's first departure; the start epoch at rank 0.
    mass : (n,) float64, kg
        Spacecraft mass.
    visited : (n, d + 1) intp
        Catalogue rows of the bodies in order of visit, the present one last.
    tree_id : (n,) int64
        Id of the node in the search tree.
    """

    row: NDArray[np.intp]
    t_ready_mjd2000: NDArray[np.float64]
    t_arr_mjd2000: NDArray[np.float64]
    t_first_mjd2000: NDArray[np.float64]
    mass: NDArray[np.float64]
    visited: NDArray[np.intp]
    tree_id: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.row)

    @property
    def rank(self) -> int:
        """Legs flown so far."""
        return int(self.visited.shape[1]) - 1

    def take(self, index: NDArray[np.intp]) -> Self:
        """Return the nodes at the given positions."""
        return type(self)(
            row=self.row[index],
            t_ready_mjd2000=self.t_ready_mjd2000[index],
            t_arr_mjd2000=self.t_arr_mjd2000[index],
            t_first_mjd2000=self.t_first_mjd2000[index],
            mass=self.mass[index],
            visited=self.visited[index],
            tree_id=self.tree_id[index],
        )
