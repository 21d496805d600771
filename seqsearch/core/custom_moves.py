"""`CustomMoves`: the starts and candidates of a problem that finds them itself."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol, final, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.predictor import LegPredictor
from seqsearch.core.hops import Hops
from seqsearch.core.nodes import Nodes
from seqsearch.settings import SearchSettings


@final
@dataclass(frozen=True, eq=False)
class CustomCandidates:
    """Candidates from some nodes, shaped by the problem.

    With n the number of candidates, at least one.

    Attributes
    ----------
    parent : (n,) intp
        Position of the node among those that are expanded.
    target : (n,) intp
        Catalogue row of the target.
    hops : Hops
        The n hops, from the parent's mass.
    m_final : (n,) float64, kg
        Predicted masses at the last arrival, before anything is dropped there.
    questions : int
        Legs that the predictor was asked about.
    """

    parent: NDArray[np.intp]
    target: NDArray[np.intp]
    hops: Hops
    m_final: NDArray[np.float64]
    questions: int


@runtime_checkable
class CustomMoves(Protocol):
    """What a `Problem` offers if near neighbours and a range of times do not fit it.

    A launch from a planet, say, has targets that are no neighbours of the
    planet, and a hop with a free direction in the middle is to be shaped before
    it is proposed.
    """

    def starts(self, settings: SearchSettings, rng: np.random.Generator, /) -> Nodes:
        """Return the start nodes of a pass, not yet in the tree."""
        ...

    def candidates(
        self, nodes: Nodes, settings: SearchSettings, predictor: LegPredictor, threads: int, /
    ) -> Iterator[CustomCandidates]:
        """Propose hops from nodes of one depth that respect the problem's limits.

        Together they are ordered by node, whatever the number of threads.
        """
        ...
