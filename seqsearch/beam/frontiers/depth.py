"""Frontiers: which of the nodes that wait are expanded next."""

from typing import Protocol, final, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from seqsearch.beam.frontiers.selection import select
from seqsearch.beam.frontiers.time_slices import TimeSliceFrontier
from seqsearch.beam.rankings.protocol import Ranking
from seqsearch.core.nodes import Nodes
from seqsearch.core.problem import TourProblem
from seqsearch.settings import SearchSettings


@runtime_checkable
class Frontier(Protocol):
    """Holds the nodes of a pass that wait for expansion.

    The search calls `push` with the start nodes, then in turn `pop`, `admit`
    with what was reached from there, and `push` with those that were admitted,
    until `pop` gives no nodes. All methods are deterministic. A frontier that
    is made anew and given the nodes of `waiting` goes on as the old one would
    have.
    """

    def admit(self, nodes: Nodes, /, spare: float = 1.0) -> NDArray[np.intp]:
        """Return the (k,) positions of nodes just reached that are worth going on with.

        With `spare` above 1, of nodes that are only predicted and of which some will
        fall away: about that many times as many.
        """
        ...

    def push(self, nodes: Nodes, /) -> None:
        """Take in nodes, which are in the tree now."""
        ...

    def pop(self) -> Nodes:
        """Remove and return the nodes to expand next; none when all is done.

        Starts are never mixed with others.
        """
        ...

    def waiting(self) -> Nodes | None:
        """Return all nodes that wait, in the order in which `push` wants them; None for none."""
        ...


@final
class DepthFrontier:
    """Beam search: all nodes of one depth are expanded together, the best of them.

    Parameters
    ----------
    settings : SearchSettings
        Beam width and caps, see `select`.
    problem : TourProblem
        For the ranking.
    ranking : Ranking
        Which nodes are best.
    """

    def __init__(self, settings: SearchSettings, problem: TourProblem, ranking: Ranking) -> None:
        self._settings = settings
        self._problem = problem
        self._ranking = ranking
        self._nodes: Nodes | None = None

    def admit(self, nodes: Nodes, /, spare: float = 1.0) -> NDArray[np.intp]:
        """Return the positions of the best nodes within the beam width and the caps."""
        if len(nodes) == 0:
            return np.zeros(0, dtype=np.intp)
        score = self._ranking.score(nodes, self._problem)
        return select(score, nodes, self._settings, spare)

    def push(self, nodes: Nodes, /) -> None:
        """Take in the next rank."""
        self._nodes = nodes

    def pop(self) -> Nodes:
        """Return the whole rank."""
        nodes, self._nodes = self._nodes, None
        return no_nodes() if nodes is None else nodes

    def waiting(self) -> Nodes | None:
        """Return the next rank."""
        return self._nodes


def make_frontier(settings: SearchSettings, problem: TourProblem, ranking: Ranking) -> Frontier:
    """Return the frontier that the settings ask for."""
    if settings.frontier == "time":
        return TimeSliceFrontier(settings, problem, ranking)
    return DepthFrontier(settings, problem, ranking)


def no_nodes() -> Nodes:
    """Return an empty batch of nodes."""
    return Nodes.at_start(np.zeros(0, dtype=np.intp), np.zeros(0), np.zeros(0))
