"""`RendezvousVariant`: a tour of rendezvous with rules of its own."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feasibility import Spacecraft
from feasibility.orbits import Catalogue
from seqsearch.core.custom_moves import CustomMoves
from seqsearch.core.ending import Ending
from seqsearch.core.hops import Hops
from seqsearch.core.nodes import Nodes
from seqsearch.core.tree import FlownLeg
from seqsearch.problems.rendezvous import RendezvousProblem
from seqsearch.settings import SearchSettings
from seqsearch.tours.tour import TourRules


@dataclass(frozen=True, kw_only=True, eq=False)
class RendezvousVariant:
    """A `Problem` that asks another one about everything; abstract, its children are final.

    A child overrides what differs. See `Problem` for what the members mean.

    Parameters
    ----------
    base : RendezvousProblem
        The problem without the rules of the child.
    """

    base: RendezvousProblem

    @property
    def name(self) -> str:
        """Name, for reports."""
        return self.base.name

    @property
    def catalogue(self) -> Catalogue:
        """The bodies."""
        return self.base.catalogue

    @property
    def spacecraft(self) -> Spacecraft:
        """Dry mass, thrust and specific impulse."""
        return self.base.spacecraft

    @property
    def m0(self) -> float:
        """Mass in kg at the first departure."""
        return self.base.m0

    @property
    def first_departure_mjd2000(self) -> tuple[float, float]:
        """Earliest and latest epoch of the first departure."""
        return self.base.first_departure_mjd2000

    @property
    def max_duration_days(self) -> float:
        """Longest time from the first departure to the last arrival."""
        return self.base.max_duration_days

    @property
    def min_stay_days(self) -> float:
        """Shortest time between an arrival and the next departure."""
        return self.base.min_stay_days

    @property
    def start_ids(self) -> tuple[int, ...]:
        """Ids of the bodies at which a tour may start; empty for any."""
        return self.base.start_ids

    @property
    def custom_moves(self) -> CustomMoves | None:
        """None: near neighbours and a range of flight times fit."""
        return self.base.custom_moves

    @property
    def ending(self) -> Ending | None:
        """What a tour needs to be complete; None where it is after any visit."""
        return self.base.ending

    @property
    def rows_to_avoid(self) -> NDArray[np.intp]:
        """Rows that are not visited on the way: without a score, excluded, or the end."""
        return self.base.rows_to_avoid

    def start_rows(self) -> NDArray[np.intp]:
        """Return the catalogue rows of the bodies at which a tour may start."""
        return self.base.start_rows()

    def start_nodes(self, rows: NDArray[np.intp], t_mjd2000: NDArray[np.float64], /) -> Nodes:
        """Return the (k,) nodes at bodies and epochs, with full tanks."""
        return self.base.start_nodes(rows, t_mjd2000)

    def may_visit(self, nodes: Nodes, target: NDArray[np.intp], /) -> NDArray[np.bool_]:
        """Return (n, t) whether targets, catalogue rows (n, t), may be visited."""
        return self.base.may_visit(nodes, target)

    def days_left(
        self, nodes: Nodes, t_dep_mjd2000: NDArray[np.float64], /
    ) -> NDArray[np.float64]:
        """Return (n, d) days until the longest duration is over; -inf outside the window."""
        return self.base.days_left(nodes, t_dep_mjd2000)

    def hops(
        self,
        nodes: Nodes,
        parent: NDArray[np.intp],
        target: NDArray[np.intp],
        t_dep_mjd2000: NDArray[np.float64],
        tof_days: NDArray[np.float64],
        /,
    ) -> Hops:
        """Return the (k,) hops, each a single leg."""
        return self.base.hops(nodes, parent, target, t_dep_mjd2000, tof_days)

    def closing(self, row: int, t_mjd2000: float, mass: float, /) -> tuple[FlownLeg, ...]:
        """Return the legs that complete a tour after its last visit: none."""
        return self.base.closing(row, t_mjd2000, mass)

    def tour_cost(self, nodes: Nodes, settings: SearchSettings, /) -> NDArray[np.float64]:
        """Return (n,) the weighted shares of time and propellant that are used up."""
        return self.base.tour_cost(nodes, settings)

    def tour_rules(self) -> TourRules:
        """Return the numbers of the problem; every visited body counts one."""
        return self.base.tour_rules()
