"""`Nodes`: nodes of the search, as a struct of arrays."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Self, final

import numpy as np
from numpy.typing import NDArray

from feasibility.arrays import StructOfArrays


@final
@dataclass(frozen=True, eq=False)
class Nodes(StructOfArrays):
    """Nodes: where each spacecraft is, since when, and with what mass.

    With n the number of nodes and w the width of the table of visits, more
    than the greatest depth.

    Attributes
    ----------
    row : (n,) intp
        Catalogue row of the body at which the spacecraft is.
    depth : (n,) int64
        Visits after the start.
    t_ready_mjd2000 : (n,) float64
        Earliest epoch of the next departure: arrival plus stay, or the start epoch.
    t_arr_mjd2000 : (n,) float64
        Epoch of the arrival; the start epoch at depth 0.
    t_first_mjd2000 : (n,) float64
        Epoch of the tour's first departure; the start epoch at depth 0.
    mass : (n,) float64, kg
        Spacecraft mass, after what was dropped on arrival.
    visited : (n, w) intp
        Catalogue rows of the bodies in order of visit, the present one at
        position `depth`, then -1.
    tree_id : (n,) int64
        Id of the node in the search tree; -1 for a node that is not in it.
    parent_id : (n,) int64
        Id of the node's parent in the search tree; -1 for a start.
    velocity : (n, 3) float64, m/s
        Velocity relative to the body, of spacecraft that have passed it; zero, as unless given,
        for those that are at rest there.
    """

    row: NDArray[np.intp]
    depth: NDArray[np.int64]
    t_ready_mjd2000: NDArray[np.float64]
    t_arr_mjd2000: NDArray[np.float64]
    t_first_mjd2000: NDArray[np.float64]
    mass: NDArray[np.float64]
    visited: NDArray[np.intp]
    tree_id: NDArray[np.int64]
    parent_id: NDArray[np.int64]
    velocity: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 3)))

    def __post_init__(self) -> None:
        if len(self.velocity) == 0:
            object.__setattr__(self, "velocity", np.zeros((len(self.row), 3)))

    @classmethod
    def at_start(
        cls, rows: NDArray[np.intp], t_mjd2000: NDArray[np.float64], mass: NDArray[np.float64]
    ) -> Self:
        """Return n start nodes at bodies and epochs, not yet in the tree."""
        n = len(rows)
        return cls(
            row=rows,
            depth=np.zeros(n, dtype=np.int64),
            t_ready_mjd2000=t_mjd2000,
            t_arr_mjd2000=t_mjd2000,
            t_first_mjd2000=t_mjd2000,
            mass=mass,
            visited=rows[:, None],
            tree_id=np.full(n, -1, dtype=np.int64),
            parent_id=np.full(n, -1, dtype=np.int64),
        )

    @classmethod
    def concatenate(cls, parts: "Sequence[Nodes]") -> "Nodes":
        """Return the nodes of all parts, at least one, in order."""
        width = max(part.visited.shape[1] for part in parts)
        wide = [replace(part, visited=_padded(part.visited, width)) for part in parts]
        return super().concatenate(wide)

    def extended_visits(
        self, parent: NDArray[np.intp], target: NDArray[np.intp]
    ) -> NDArray[np.intp]:
        """Return the (m, w') visits of children: those of each `parent`, then its `target`."""
        depth = self.depth[parent] + 1
        width = max(self.visited.shape[1], int(depth.max(initial=0)) + 1)
        visited = _padded(self.visited[parent], width)
        visited[np.arange(len(parent)), depth] = target
        return visited


def _padded(visited: NDArray[np.intp], width: int) -> NDArray[np.intp]:
    """Return a copy with columns of -1 appended."""
    return np.pad(visited, ((0, 0), (0, width - visited.shape[1])), constant_values=-1)


def no_nodes() -> Nodes:
    """Return an empty batch of nodes."""
    return Nodes.at_start(np.zeros(0, dtype=np.intp), np.zeros(0), np.zeros(0))
