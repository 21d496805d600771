"""`TimeSliceFrontier`: nodes compete with those that are equally far on in time."""

from typing import final

import numpy as np
from numpy.typing import NDArray

from seqsearch.beam.frontiers.selection import select
from seqsearch.beam.rankings.protocol import Ranking
from seqsearch.core.nodes import Nodes, no_nodes
from seqsearch.core.problem import Problem
from seqsearch.settings import SearchSettings

_STARTS = -1
"""Slice of the start nodes, which are expanded before all others."""


@final
class TimeSliceFrontier:
    """Racing: nodes wait in slices of elapsed time, and the earliest slice is expanded first.

    A beam by depth compares nodes with the same number of visits, one early and
    another late. Here a node competes with those that arrived within the same
    `slice_days` after their own start, whatever their number of visits (as in
    the lazy race tree search of Izzo, Hennes, Simões and Märtens 2016, "Designing
    complex interplanetary trajectories for the global trajectory optimization
    competitions"). A visit more counts as the share that it has in a tour of
    `nominal_visits`; the ranking says what has been used up for it.

    Parameters
    ----------
    settings : SearchSettings
        The weights, and the table of the frontier: `slice_days`, `nominal_visits` and the
        caps of `select`. The beam width is for each slice.
    problem : Problem
        For the ranking.
    ranking : Ranking
        Scores what has been used up.
    """

    def __init__(self, settings: SearchSettings, problem: Problem, ranking: Ranking) -> None:
        self._settings = settings
        self._problem = problem
        self._ranking = ranking
        self._slices: dict[int, Nodes] = {}

    def admit(self, nodes: Nodes, /, width: int, spare: float = 1.0) -> NDArray[np.intp]:
        """Return the positions of the nodes that are among the best of their slice."""
        admitted: list[NDArray[np.intp]] = []
        for number, positions in self._by_slice(nodes):
            rivals = nodes.take(positions)
            waiting = self._slices.get(number)
            if waiting is not None:
                rivals = Nodes.concatenate([rivals, waiting])
            chosen = self._best(rivals, width, spare)
            admitted.append(positions[chosen[chosen < len(positions)]])
        return np.concatenate(admitted) if admitted else np.zeros(0, dtype=np.intp)

    def push(self, nodes: Nodes, /) -> None:
        """Take in nodes, each into its slice."""
        for number, positions in self._by_slice(nodes):
            parts = [nodes.take(positions)]
            if number in self._slices:
                parts.insert(0, self._slices[number])
            self._slices[number] = Nodes.concatenate(parts)

    def pop(self, width: int) -> Nodes:
        """Return the best nodes of the earliest slice; those beyond the beam width are dropped."""
        if not self._slices:
            return no_nodes()
        number = min(self._slices)
        nodes = self._slices.pop(number)
        return nodes if number == _STARTS else nodes.take(self._best(nodes, width))

    def waiting(self) -> Nodes:
        """Return the nodes of all slices, earliest slice first."""
        if not self._slices:
            return no_nodes()
        return Nodes.concatenate([self._slices[number] for number in sorted(self._slices)])

    def _best(self, nodes: Nodes, width: int, spare: float = 1.0) -> NDArray[np.intp]:
        progress = nodes.depth / self._settings.frontier.nominal_visits
        scores = self._ranking.score(nodes, self._problem) - progress * self._worth_of_a_tour()
        return select(scores, nodes, self._settings.frontier, width, spare)

    def _worth_of_a_tour(self) -> float:
        """Return the score of a tour that used up everything."""
        return self._settings.time_weight + self._settings.propellant_weight

    def _by_slice(self, nodes: Nodes) -> list[tuple[int, NDArray[np.intp]]]:
        elapsed = nodes.t_arr_mjd2000 - nodes.t_first_mjd2000
        slices = np.floor(elapsed / self._settings.frontier.slice_days).astype(np.int64)
        slices[nodes.depth == 0] = _STARTS
        return [(int(number), np.flatnonzero(slices == number)) for number in np.unique(slices)]
