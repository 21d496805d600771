"""`SearchTree`: every node that the beam kept, as a networkx DiGraph."""

from dataclasses import dataclass
from typing import Any, final

import networkx as nx
import numpy as np
from numpy.typing import NDArray


@final
@dataclass(frozen=True, eq=False)
class FlownLeg:
    """One optimised leg of a tour.

    Attributes
    ----------
    dep_row, arr_row : int
        Catalogue rows of the two bodies.
    rv_dep, rv_arr : (6,) float64, m and m/s
        States at departure and arrival, which need not be those of the bodies: the excess
        velocities of free ends are in them.
    t_dep_mjd2000, tof_days : float
        Departure epoch and flight time.
    m0, m_final, m_star : float, kg
        Initial, final and maximum initial mass; the margin is m_star / m0. `m_star` is inf for
        a leg that needs no thrust.
    dropped : float, kg
        Mass that is left behind at the arrival, after `m_final`.
    throttles : (s, 3) float64
        Throttle of each of the s segments.
    mismatch : float
        Scaled mismatch, see `feasibility.LegSolutions`.
    """

    dep_row: int
    arr_row: int
    rv_dep: NDArray[np.float64]
    rv_arr: NDArray[np.float64]
    t_dep_mjd2000: float
    tof_days: float
    m0: float
    m_final: float
    m_star: float
    dropped: float
    throttles: NDArray[np.float64]
    mismatch: float

    @property
    def t_arr_mjd2000(self) -> float:
        """Arrival epoch."""
        return self.t_dep_mjd2000 + self.tof_days


def with_excess(state: NDArray[np.float64], excess: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the (6,) state of a spacecraft that has a velocity (3,) relative to a body in it."""
    flown = state.copy()
    flown[3:] += excess
    return flown


@final
class SearchTree:
    """The tree of visits. A node is a body, an epoch and a mass; an edge is a flown hop.

    `graph` is a `networkx.DiGraph` whose nodes carry ``row``, ``rank``,
    ``t_mjd2000`` (arrival, or start) and ``mass``, and whose edges carry
    ``legs``, a tuple of `FlownLeg`.
    """

    def __init__(self) -> None:
        self.graph: nx.DiGraph[int] = nx.DiGraph()

    def __len__(self) -> int:
        return int(self.graph.number_of_nodes())

    def add_start(self, row: int, t_mjd2000: float, mass: float) -> int:
        """Add a start node and return its id."""
        return self._add(row, 0, t_mjd2000, mass)

    def add_hop(self, parent: int, legs: tuple[FlownLeg, ...]) -> int:
        """Add the node reached by a chain of legs from `parent` and return its id."""
        rank = self.graph.nodes[parent]["rank"] + 1
        last = legs[-1]
        node = self._add(last.arr_row, rank, last.t_arr_mjd2000, last.m_final - last.dropped)
        self.graph.add_edge(parent, node, legs=legs)
        return node

    def _add(self, row: int, rank: int, t_mjd2000: float, mass: float) -> int:
        node = len(self)
        self.graph.add_node(node, row=row, rank=rank, t_mjd2000=t_mjd2000, mass=mass)
        return node

    def rank(self, node: int) -> int:
        """Return the number of hops that lead to a node."""
        return int(self.graph.nodes[node]["rank"])

    def node(self, node: int) -> dict[str, Any]:
        """Return the attributes of a node."""
        attributes: dict[str, Any] = self.graph.nodes[node]
        return attributes

    def legs_to(self, node: int) -> list[FlownLeg]:
        """Return the legs from the start to a node, in order of flight."""
        legs: list[FlownLeg] = []
        while parents := list(self.graph.predecessors(node)):
            legs.extend(reversed(self.graph.edges[parents[0], node]["legs"]))
            node = parents[0]
        return legs[::-1]
