"""The `Problem` protocol: what the search needs to know of a problem."""

from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from feasibility import Spacecraft
from feasibility.orbits import Catalogue
from seqsearch.core.custom_moves import CustomMoves
from seqsearch.core.hops import Hops
from seqsearch.core.nodes import Nodes
from seqsearch.core.tree import FlownLeg
from seqsearch.settings import SearchSettings
from seqsearch.tours.tour import TourRules


@runtime_checkable
class Problem(Protocol):
    """A problem as the search sees it: bodies, means, limits, starts, hops and what counts.

    `RendezvousProblem`, a tour of rendezvous, is one. Another competition's rules are a
    class with the same members; `check_problem` tests it against this contract. The search
    sends problems to worker processes, so they must be picklable. With n the number of
    nodes, k the number of hops.

    Attributes
    ----------
    name : str
        Name, for reports.
    catalogue : Catalogue
        The bodies; also those at which a tour starts. No body is visited twice.
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
    custom_moves : CustomMoves or None
        Starts and candidates of the problem's own; None where near neighbours and a range
        of flight times fit it.
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
    @property
    def custom_moves(self) -> CustomMoves | None: ...  # noqa: D102

    def start_rows(self) -> NDArray[np.intp]:
        """Return the catalogue rows of the bodies at which a tour may start."""
        ...

    def start_nodes(self, rows: NDArray[np.intp], t_mjd2000: NDArray[np.float64], /) -> Nodes:
        """Return the (n,) nodes that start at the given bodies and epochs."""
        ...

    def may_visit(self, nodes: Nodes, target: NDArray[np.intp], /) -> NDArray[np.bool_]:
        """Return (n, t) whether each node may go on to each of its t targets.

        Parameters
        ----------
        nodes : Nodes
            n nodes.
        target : (n, t) intp
            Catalogue rows.
        """
        ...

    def days_left(
        self, nodes: Nodes, t_dep_mjd2000: NDArray[np.float64], /
    ) -> NDArray[np.float64]:
        """Return (n, d) the longest time of flight in days of a hop from each node.

        Negative where the node may not depart at that epoch at all.

        Parameters
        ----------
        nodes : Nodes
            n nodes.
        t_dep_mjd2000 : (n, d) float64
            Departure epochs, d for each node.
        """
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

        All of them with the same number of legs.

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

    def closing(self, row: int, t_mjd2000: float, mass: float, /) -> tuple[FlownLeg, ...]:
        """Return the solved legs that complete a tour after its last visit, none for most.

        Parameters
        ----------
        row : int
            Catalogue row of the body visited last.
        t_mjd2000 : float
            Epoch of the arrival there.
        mass : float
            Mass in kg after it.
        """
        ...

    def tour_cost(self, nodes: Nodes, settings: SearchSettings, /) -> NDArray[np.float64]:
        """Return (n,) which of equally deep nodes end better tours; smaller is better."""
        ...

    def tour_rules(self) -> TourRules:
        """Return what a tour of this problem has to respect, as its file says it."""
        ...
