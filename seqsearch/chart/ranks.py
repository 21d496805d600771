"""The ranks of a beam over a chart, as arrays."""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from seqsearch.core.nodes import Nodes

_Array = NDArray[np.float64]
_Index = NDArray[np.intp]


@final
@dataclass(frozen=True, eq=False)
class Children:
    """What `expand` writes: m children, of which `home` is the duration if they go to the end."""

    row: NDArray[np.int32]
    parent: NDArray[np.int32]
    arrival: _Array
    mass: _Array
    score: _Array
    home: _Array


@final
@dataclass(frozen=True, eq=False)
class Rank:
    """Nodes of one depth; rows are positions in the chart.

    Attributes
    ----------
    depth : int
        Visits of the beam's first rank.
    row, parent, start : (w,) int32
        Where, of which node in the rank before, and of which start.
    ready, arrival, first_departure : (w,) float64
        Epochs in MJD2000.
    mass : (w,) float64, kg
        Mass.
    sets : (w,) uint64
        Sum of the keys of the bodies since the start.
    own : (w, d) int32
        Those bodies.
    """

    depth: int
    row: NDArray[np.int32]
    parent: NDArray[np.int32]
    start: NDArray[np.int32]
    ready: _Array
    arrival: _Array
    first_departure: _Array
    mass: _Array
    sets: NDArray[np.uint64]
    own: NDArray[np.int32]

    @classmethod
    def first(cls, starts: Nodes, rows: _Index) -> "Rank":
        """Return the first rank."""
        count = len(starts)
        row = rows.astype(np.int32)
        return cls(
            depth=int(starts.depth[0]),
            row=row,
            parent=np.full(count, -1, dtype=np.int32),
            start=np.arange(count, dtype=np.int32),
            ready=starts.t_ready_mjd2000,
            arrival=starts.t_arr_mjd2000,
            first_departure=starts.t_first_mjd2000,
            mass=starts.mass,
            sets=np.zeros(count, dtype=np.uint64),
            own=row[:, None],
        )

    def children(
        self,
        children: Children,
        taken: NDArray[np.int64],
        keys: NDArray[np.uint64],
        stay_days: float,
    ) -> "Rank":
        """Return the rank of some children."""
        parent, row = children.parent[taken], children.row[taken]
        arrival = children.arrival[taken]
        return Rank(
            depth=self.depth,
            row=row,
            parent=parent,
            start=self.start[parent],
            ready=arrival + stay_days,
            arrival=arrival,
            first_departure=self.first_departure[parent],
            mass=children.mass[taken],
            sets=self.sets[parent] + keys[row],
            own=np.column_stack([self.own[parent], row]),
        )
