"""`FixedEnds`: tours have to end at a body, or to visit some."""

from typing import final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.predictor import LegPredictor
from seqsearch.beam.best_tour import Best
from seqsearch.beam.endings.best_ended import BestEndedTour
from seqsearch.beam.endings.homebound import HomeboundFrontier, HomeboundRanking
from seqsearch.beam.endings.outlook import EndOutlook
from seqsearch.beam.frontiers.protocol import Frontier
from seqsearch.beam.rankings.protocol import Ranking
from seqsearch.budget import Budget
from seqsearch.core.ending import Ending
from seqsearch.core.nodes import Nodes
from seqsearch.core.optimisation import LegOptimiser
from seqsearch.core.problem import Problem
from seqsearch.settings import SearchSettings


@final
class FixedEnds:
    """Looks to the end of tours that have one; an `Ends`.

    Parameters
    ----------
    problem : Problem
        What to solve.
    ending : Ending
        What completes its tours.
    predictor : LegPredictor
        Predicts the last legs.
    threads : int
        How many questions are worked on at once; the answers do not depend on it.
    """

    def __init__(
        self, problem: Problem, ending: Ending, predictor: LegPredictor, threads: int
    ) -> None:
        self._problem = problem
        self._predictor = predictor
        self._outlook = EndOutlook(problem, ending, predictor, threads)

    def ranking(self, ranking: Ranking) -> Ranking:
        """Return a ranking of nodes as they would be at the end, the nearer the more so."""
        return HomeboundRanking(ranking, self._outlook)

    def frontier(self, frontier: Frontier) -> Frontier:
        """Return a frontier that gives up nodes from which there is no way to the end."""
        return HomeboundFrontier(frontier, self._outlook)

    def reachable(self, nodes: Nodes) -> NDArray[np.bool_]:
        """Return (n,) whether there is a way to the end from each of n nodes."""
        return self._outlook.homecoming(nodes).surely & (nodes.depth > 0)

    def best(self, settings: SearchSettings, optimiser: LegOptimiser, budget: Budget) -> Best:
        """Return what flies the way to the end from the best nodes."""
        return BestEndedTour(
            self._problem,
            settings,
            predictor=self._predictor,
            optimiser=optimiser,
            outlook=self._outlook,
            budget=budget,
        )
