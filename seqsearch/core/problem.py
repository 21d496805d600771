"""`TourProblem`: what the search needs to know of a problem, and `Hops`, its moves."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, final, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from feasibility import Legs, Spacecraft
from feasibility.orbits import Catalogue
from seqsearch.core.nodes import Nodes


@final
@dataclass(frozen=True, eq=False)
class Hops:
    """Ways from nodes to their next visits: chains of one or more legs.

    With n the number of hops; all have the same number of stages.

    Parameters
    ----------
    stages : tuple of Legs
        The legs in order of flight, each n long, with departure epochs and ids
        of bodies of the catalogue. A stage begins when the one before ends.
        Initial masses of all stages but the first are predictions; the search
        solves the stages in order, each with the mass that the one before left.
    dropped_kg : tuple of (n,) float64
        For each stage, the mass that is left behind at its end.
    """

    stages: tuple[Legs, ...]
    dropped_kg: tuple[NDArray[np.float64], ...]

    def __len__(self) -> int:
        return len(self.stages[0])

    @property
    def t_dep_mjd2000(self) -> NDArray[np.float64]:
        """(n,) departure epoch."""
        return _departure(self.stages[0])

    @property
    def t_arr_mjd2000(self) -> NDArray[np.float64]:
        """(n,) arrival epoch at the next visit."""
        return _departure(self.stages[-1]) + self.stages[-1].tof_days

    @property
    def tof_days(self) -> NDArray[np.float64]:
        """(n,) time of flight of all stages together."""
        total: NDArray[np.float64] = np.sum([legs.tof_days for legs in self.stages], axis=0)
        return total

    def take(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> "Hops":
        """Return the hops at the given rows (indices or a mask)."""
        return Hops(
            tuple(legs.take(rows) for legs in self.stages),
            tuple(mass[rows] for mass in self.dropped_kg),
        )

    @staticmethod
    def concatenate(parts: "Sequence[Hops]") -> "Hops":
        """Return the hops of all parts, at least one, in order."""
        return Hops(
            tuple(
                Legs.concatenate(list(stage))
                for stage in zip(*(part.stages for part in parts), strict=True)
            ),
            tuple(
                np.concatenate(mass)
                for mass in zip(*(part.dropped_kg for part in parts), strict=True)
            ),
        )


def _departure(legs: Legs) -> NDArray[np.float64]:
    assert legs.t_dep_mjd2000 is not None
    return legs.t_dep_mjd2000


@runtime_checkable
class TourProblem(Protocol):
    """A problem as the search sees it: bodies, means, limits, starts and moves.

    `Problem`, a tour of rendezvous, is one. Another competition's rules are a
    class with the same members. With n the number of bodies of the catalogue.

    Attributes
    ----------
    name : str
        Name, for reports.
    catalogue : Catalogue
        The n bodies; also those at which a tour starts. No body is visited twice.
    spacecraft : Spacecraft
        Dry mass, thrust and specific impulse.
    m0 : float
        Mass in kg at the first departure.
    first_departure_mjd2000 : tuple of float
        Earliest and latest epoch of the first departure.
    max_duration_days : float
        Longest time from the first departure to the last arrival.
    min_stay_days : float
        Shortest time between an arrival and the next departure.
    start_ids : tuple of int
        Ids of the bodies at which a tour may start; empty for any.
    """

    @property
    def name(self) -> str: ...  # noqa: D102
    @property
    def catalogue(self) -> Catalogue: ...  # noqa: D102
    @property
    def spacecraft(self) -> Spacecraft: ...  # noqa: D102
    @property
    def m0(self) -> float: ...  # noqa: D102
    @property
    def first_departure_mjd2000(self) -> tuple[float, float]: ...  # noqa: D102
    @property
    def max_duration_days(self) -> float: ...  # noqa: D102
    @property
    def min_stay_days(self) -> float: ...  # noqa: D102
    @property
    def start_ids(self) -> tuple[int, ...]: ...  # noqa: D102

    def start_rows(self) -> NDArray[np.intp]:
        """Return the catalogue rows of the bodies at which a tour may start."""
        ...

    def start_nodes(self, rows: NDArray[np.intp], t_mjd2000: NDArray[np.float64], /) -> Nodes:
        """Return the (k,) nodes that start at the given bodies and epochs."""
        ...

    def hops(
        self,
        nodes: Nodes,
        parent: NDArray[np.intp],
        target: NDArray[np.intp],
        t_dep_mjd2000: NDArray[np.float64],
        tof_days: NDArray[np.float64],
        /,
    ) -> Hops:
        """Return the (k,) hops from nodes to bodies.

        All of them with the same number of stages.

        Parameters
        ----------
        nodes : Nodes
            Starts only, or none.
        parent : (k,) intp
            Positions among `nodes`.
        target : (k,) intp
            Catalogue rows of the bodies to visit next.
        t_dep_mjd2000, tof_days : (k,) float64
            Departure epochs and whole times of flight.
        """
        ...
