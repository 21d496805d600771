"""`OwnMovesExpander`: optimises what a problem with moves of its own proposes."""

import time
from typing import Final, final

from feasibility import AllOf
from feasibility.classifier.predictor import LegPredictor
from seqsearch.beam.counters import RankCounters
from seqsearch.beam.expanders.forecast import Expanded, keep_hops
from seqsearch.beam.frontiers.depth import Frontier
from seqsearch.beam.rankings.protocol import Ranking
from seqsearch.core.candidates import Candidates, reached
from seqsearch.core.custom_moves import OwnMoves
from seqsearch.core.nodes import Nodes
from seqsearch.core.optimisation import LegOptimiser
from seqsearch.core.problem import TourProblem
from seqsearch.deadline import Deadline
from seqsearch.pruning.audit import RankSample
from seqsearch.settings import SearchSettings

_SOLVED: Final = 2.0
"""Hops that are optimised, for each node that can go on: predicted masses are a percent off."""


@final
class OwnMovesExpander:
    """Optimises the proposals of a problem that seem to go on; an `Expander`.

    Parameters
    ----------
    problem : TourProblem
        For the nodes that are reached.
    moves : OwnMoves
        The same problem, as it proposes.
    predictor : LegPredictor
        Whom the problem may ask.
    pruner : AllOf
        What survives of the proposals.
    ranking : Ranking
        What is optimised first.
    optimiser : LegOptimiser
        How it is optimised.
    threads : int
        Threads in which the problem may ask.
    """

    def __init__(
        self,
        problem: TourProblem,
        moves: OwnMoves,
        predictor: LegPredictor,
        pruner: AllOf,
        ranking: Ranking,
        optimiser: LegOptimiser,
        threads: int,
    ) -> None:
        self._problem = problem
        self._moves = moves
        self._predictor = predictor
        self._pruner = pruner
        self._ranking = ranking
        self._optimiser = optimiser
        self._threads = threads

    def expand(
        self,
        nodes: Nodes,
        frontier: Frontier,
        settings: SearchSettings,
        counters: RankCounters,
        sample: RankSample | None,
        deadline: Deadline,
    ) -> Expanded | None:
        """Return the hops found; None where nothing was worth optimising."""
        clock = time.perf_counter()
        candidates, found = [], []
        for proposal in self._moves.moves(nodes, settings, self._predictor, self._threads):
            counters.proposed += len(proposal.candidates)
            counters.questions += proposal.questions
            candidates.append(proposal.candidates)
            found.append(reached(self._problem, nodes, proposal.candidates, proposal.m_final))
            if deadline.passed():
                return None
        counters.seconds_expand += time.perf_counter() - clock
        if not candidates:
            return None
        clock = time.perf_counter()
        reachable = Nodes.concatenate(found)
        chosen = frontier.admit(reachable, _SOLVED)
        best = Candidates.concatenate(candidates).take(chosen)
        counters.count_pruned({"predictor": len(reachable) - len(chosen)})
        mask = keep_hops(self._pruner, best.hops, counters)
        if sample is not None:
            sample.offer(best, mask)
        best, reachable = best.take(mask), reachable.take(chosen).take(mask)
        counters.seconds_prune += time.perf_counter() - clock
        if len(best) == 0 or deadline.passed():
            return None
        clock = time.perf_counter()
        promise = self._ranking.score(reachable, self._problem)
        optimised = self._optimiser.run_all(best, promise, settings, deadline)
        counters.seconds_optimise = time.perf_counter() - clock
        return Expanded(best, optimised)
