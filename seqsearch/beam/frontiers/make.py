"""The frontier that the settings name."""

from seqsearch.beam.frontiers.depth import DepthFrontier
from seqsearch.beam.frontiers.protocol import Frontier
from seqsearch.beam.frontiers.time_slices import TimeSliceFrontier
from seqsearch.beam.rankings.protocol import Ranking
from seqsearch.core.problem import Problem
from seqsearch.settings import SearchSettings


def make_frontier(settings: SearchSettings, problem: Problem, ranking: Ranking) -> Frontier:
    """Return the frontier that the settings ask for."""
    if settings.frontier.kind == "time":
        return TimeSliceFrontier(settings, problem, ranking)
    return DepthFrontier(settings.frontier, problem, ranking)
