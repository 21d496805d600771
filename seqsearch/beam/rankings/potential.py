"""`PotentialRanking`: what a node has used up, and how many flyable legs lead on from it."""

from dataclasses import replace
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.predictor import LegPredictor
from feasibility.orbits import OrbitalNeighbours
from seqsearch.beam.rankings.protocol import Ranking
from seqsearch.core.hop_margins import least_margin
from seqsearch.core.nodes import Nodes
from seqsearch.core.problem import Problem

_TOF_DAYS: Final = (80.0, 120.0, 160.0)
"""Flight times that are asked about: those of legs worth having on a tour of the main belt."""

_CELL_DAYS: Final = 20.0
_CELL_MASS: Final = 0.04
"""Width of the cells in log(mass) that share an answer: margins change by 4 %."""


@final
class PotentialRanking:
    """Adds to another ranking a penalty for nodes from which few targets can be reached.

    The predictor is asked for the legs from the node's body to its nearest
    bodies. The answer is shared by all nodes at the same body, within the same
    days and nearly the same mass, and so ignores which bodies were visited.

    Parameters
    ----------
    base : Ranking
        Scores what has been used up.
    predictor : LegPredictor
        Predicts margins.
    neighbours : OrbitalNeighbours
        Finds the nearest bodies.
    weight : float
        Penalty of a node from which nothing can be reached.
    n_near : int
        How many of the nearest bodies are asked about.
    """

    def __init__(
        self,
        base: Ranking,
        predictor: LegPredictor,
        neighbours: OrbitalNeighbours,
        *,
        weight: float = 0.1,
        n_near: int = 24,
    ) -> None:
        self._base = base
        self._predictor = predictor
        self._neighbours = neighbours
        self._weight = weight
        self._n_near = n_near
        self._known: dict[tuple[int, int, int], float] = {}

    def score(self, nodes: Nodes, problem: Problem, /) -> NDArray[np.float64]:
        """Return (n,) float64, smaller is better."""
        penalty = self._weight * (1.0 - self.potential(nodes, problem))
        return self._base.score(nodes, problem) + penalty

    def potential(self, nodes: Nodes, problem: Problem, /) -> NDArray[np.float64]:
        """Return (n,) float64, 0 to 1: share of the near bodies that can be reached, soonest most.

        A body that can be reached at the shortest of the flight times asked about
        counts 1, at the second 2/3, at the third 1/3.
        """
        cells = [
            (int(row), int(day), int(mass))
            for row, day, mass in zip(
                nodes.row,
                np.floor(nodes.t_ready_mjd2000 / _CELL_DAYS),
                np.floor(np.log(nodes.mass) / _CELL_MASS),
                strict=True,
            )
        ]
        unknown = sorted(set(cells).difference(self._known))
        if unknown:
            found = self._ask(np.array(unknown), problem)
            self._known.update(zip(unknown, found.tolist(), strict=True))
        return np.array([self._known[cell] for cell in cells])

    def _ask(self, cells: NDArray[np.int64], problem: Problem) -> NDArray[np.float64]:
        """Return the potential at the centres of cells."""
        n = len(cells)
        rows = cells[:, 0].astype(np.intp)
        centres = cells.astype(np.float64) + 0.5
        epoch = centres[:, 1] * _CELL_DAYS
        mass = np.exp(centres[:, 2] * _CELL_MASS)
        nodes = Nodes.at_start(rows, epoch, mass)
        # One visit done: on some problems the first hop is of another kind than the rest.
        nodes = replace(
            nodes,
            depth=np.ones(n, dtype=np.int64),
            visited=np.column_stack([np.full(n, -1, dtype=np.intp), rows]),
        )
        n_near = min(self._n_near, len(problem.catalogue) - 1)
        near = self._neighbours.query(rows, epoch, n_near)
        tofs = np.array(_TOF_DAYS)
        i, j, k = (index.ravel() for index in np.indices((n, n_near, len(tofs))))
        hops = problem.hops(nodes, i, near[i, j], epoch[i], tofs[k])
        margin = least_margin(self._predictor.margin, hops)
        flyable = (np.nan_to_num(margin, nan=0.0) >= 1.0).reshape(n, n_near, len(tofs))
        worth: NDArray[np.float64] = 1.0 - np.arange(len(tofs)) / len(tofs)
        return np.asarray((flyable * worth).max(axis=2).mean(axis=1), dtype=np.float64)
