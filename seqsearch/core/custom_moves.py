"""`OwnMoves`: what a problem has that finds its starts and moves itself."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol, final, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.predictor import LegPredictor
from seqsearch.core.candidates import Candidates
from seqsearch.core.nodes import Nodes
from seqsearch.core.tree import FlownLeg
from seqsearch.settings import SearchSettings


@final
@dataclass(frozen=True, eq=False)
class Proposal:
    """Moves from nodes that a problem proposes.

    With n the number of moves.

    Attributes
    ----------
    candidates : Candidates
        The n hops.
    m_final : (n,) float64, kg
        Predicted masses at the last arrival, before anything is dropped there.
    questions : int
        Legs that the predictor was asked about.
    """

    candidates: Candidates
    m_final: NDArray[np.float64]
    questions: int


@runtime_checkable
class OwnMoves(Protocol):
    """What a `TourProblem` has besides if near neighbours and a grid of times do not fit it.

    A launch from a planet, say, has targets that are no neighbours of the
    planet, and a hop with a free direction in the middle is to be shaped before
    it is proposed.
    """

    def starts(self, settings: SearchSettings, rng: np.random.Generator, /) -> Nodes:
        """Return the start nodes of a pass, not yet in the tree."""
        ...

    def moves(
        self, nodes: Nodes, settings: SearchSettings, predictor: LegPredictor, threads: int, /
    ) -> Iterator[Proposal]:
        """Propose moves from nodes of one depth that respect the problem's limits.

        Together they are ordered by node, whatever the number of threads; empty
        proposals are left out.
        """
        ...

    def closing(self, row: int, t_mjd2000: float, mass: float, /) -> tuple[FlownLeg, ...]:
        """Return legs that complete a tour after its last visit; none where none are needed."""
        ...
