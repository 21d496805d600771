"""`Ending`: what a tour needs to be complete, besides its visits."""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from seqsearch.core.mission import days_until_end
from seqsearch.core.nodes import Nodes
from seqsearch.core.problem import Problem


@final
@dataclass(frozen=True, eq=False)
class Ending:
    """A body at which tours have to end, and bodies that they have to visit before.

    Attributes
    ----------
    row : int or None
        Catalogue row of the body at which tours end; None for any.
    required : (k,) intp
        Rows of the bodies that have to be visited; none for most.
    last_start_mjd2000 : float
        Latest epoch of a first departure.
    max_duration_days : float
        Longest time from the first departure to the arrival at the end.
    """

    row: int | None
    required: NDArray[np.intp]
    last_start_mjd2000: float
    max_duration_days: float

    def missing(self, nodes: Nodes) -> NDArray[np.int64]:
        """Return (n,) how many of the required bodies each node has not visited."""
        there = (self.required[:, None] == nodes.visited[:, None, :]).any(axis=2)
        return np.asarray(len(self.required) - there.sum(axis=1), dtype=np.int64)

    def is_complete(self, rows: NDArray[np.intp]) -> bool:
        """Tell whether a tour of these bodies ends where it has to, and visits what it has to."""
        visited = bool(np.isin(self.required, rows).all())
        return visited and self.row in (None, int(rows[-1]))

    def days_left(self, nodes: Nodes, t_dep_mjd2000: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return (n, d) the longest flight to the end, from each node at d epochs."""
        return days_until_end(
            nodes, t_dep_mjd2000, self.last_start_mjd2000, self.max_duration_days
        )


def ending_of(problem: Problem) -> Ending | None:
    """Return the `ending` of a problem; None where tours are complete after any visit.

    The attribute is no part of `Problem`: most problems have none.
    """
    ending: Ending | None = getattr(problem, "ending", None)
    return ending


def fixed_start(problem: Problem) -> int | None:
    """Return the row of the only body at which tours may start, if no tour may visit it."""
    rows = problem.start_rows()
    alone = len(rows) == 1 and np.isin(rows[0], rows_to_avoid(problem))
    return int(rows[0]) if alone else None


def rows_to_avoid(problem: Problem) -> NDArray[np.intp]:
    """Return the rows that no tour may visit on its way, such as those without a score."""
    rows: NDArray[np.intp] = getattr(problem, "rows_to_avoid", np.zeros(0, dtype=np.intp))
    return rows
