"""The `Expander` protocol: from nodes to flyable hops; and the tools that expanders share."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, final

from feasibility import AllOf
from feasibility.orbits import OrbitalNeighbours
from seqsearch.beam.counters import RankCounters
from seqsearch.beam.frontiers.protocol import Frontier
from seqsearch.beam.rankings.protocol import Ranking
from seqsearch.core.flown_hops import FlownHops
from seqsearch.core.nodes import Nodes
from seqsearch.core.optimisation import LegOptimiser
from seqsearch.core.problem import Problem
from seqsearch.deadline import Deadline
from seqsearch.pruning.audit import Sample
from seqsearch.settings import SearchSettings


@final
@dataclass(frozen=True, eq=False)
class ExpanderTools:
    """What expanders work with.

    Attributes
    ----------
    problem : Problem
        What hops there are.
    neighbours : OrbitalNeighbours
        Which targets are near.
    pruner : AllOf
        Which candidates survive.
    ranking : Ranking
        What is optimised first.
    optimiser : LegOptimiser
        How it is optimised.
    threads : int
        Threads that ask a predictor; results do not depend on it.
    """

    problem: Problem
    neighbours: OrbitalNeighbours
    pruner: AllOf
    ranking: Ranking
    optimiser: LegOptimiser
    threads: int


class Expander(Protocol):
    """Finds flyable hops from nodes."""

    def expand(
        self,
        nodes: Nodes,
        frontier: Frontier,
        settings: SearchSettings,
        counters: RankCounters,
        sample: Sample,
        deadline: Deadline,
    ) -> FlownHops:
        """Return the flyable hops found and what it took; the same with any number of workers.

        Parameters
        ----------
        nodes : Nodes
            Starts only, or none.
        frontier : Frontier
            Tells which nodes would go on.
        settings : SearchSettings
            Settings of the pass, with the beam width of this rank.
        counters : RankCounters
            To be filled in.
        sample : Sample
            To be shown the candidates.
        deadline : Deadline
            After it no new work is begun; what is finished counts.
        """
        ...


MakeExpander = Callable[[ExpanderTools], Expander]
"""Makes the expander of a pass from the tools of the search."""
