"""`CustomMovesExpander`: optimises the candidates that a problem finds itself."""

import time
from typing import Final, final

from feasibility.classifier.predictor import LegPredictor
from seqsearch.beam.counters import RankCounters
from seqsearch.beam.expanders.finish import fly_best
from seqsearch.beam.expanders.protocol import ExpanderTools
from seqsearch.beam.frontiers.protocol import Frontier
from seqsearch.core.candidates import Candidates, reached
from seqsearch.core.custom_moves import CustomMoves
from seqsearch.core.flown_hops import FlownHops
from seqsearch.core.nodes import Nodes
from seqsearch.deadline import Deadline
from seqsearch.pruning.audit import Sample
from seqsearch.settings import SearchSettings

_SOLVED: Final = 2.0
"""Hops that are optimised, for each node that can go on: predicted masses are a percent off."""


@final
class CustomMovesExpander:
    """Optimises those candidates of a problem that seem to go on; an `Expander`.

    Parameters
    ----------
    tools : ExpanderTools
        What it works with.
    moves : CustomMoves
        Finds the candidates.
    predictor : LegPredictor
        Predicts margins and masses for the problem.
    """

    def __init__(self, tools: ExpanderTools, moves: CustomMoves, predictor: LegPredictor) -> None:
        self._tools = tools
        self._moves = moves
        self._predictor = predictor

    def expand(
        self,
        nodes: Nodes,
        frontier: Frontier,
        settings: SearchSettings,
        counters: RankCounters,
        sample: Sample,
        deadline: Deadline,
    ) -> FlownHops:
        """Return the flyable hops found and what it took."""
        tools = self._tools
        parts = self._candidates(nodes, settings, counters, deadline)
        if not parts or deadline.passed():
            return FlownHops.none()
        clock = time.perf_counter()
        found = Nodes.concatenate([nodes for _, nodes in parts])
        chosen = frontier.admit(found, settings.beam_width, _SOLVED)
        best = Candidates.concatenate([candidates for candidates, _ in parts]).take(chosen)
        counters.count_pruned({"predictor": len(found) - len(chosen)})
        counters.seconds_prune += time.perf_counter() - clock
        chosen_hops = best, found.take(chosen)
        return fly_best(tools, nodes, chosen_hops, settings, counters, sample, deadline)

    def _candidates(
        self,
        nodes: Nodes,
        settings: SearchSettings,
        counters: RankCounters,
        deadline: Deadline,
    ) -> list[tuple[Candidates, Nodes]]:
        """Return candidates and the nodes to which they seem to lead, in parts."""
        parts = []
        clock = time.perf_counter()
        for part in self._moves.candidates(nodes, settings, self._predictor, self._tools.threads):
            candidates = Candidates(part.parent, part.target, part.hops)
            counters.proposed += len(candidates)
            counters.questions += part.questions
            parts.append(
                (candidates, reached(self._tools.problem, nodes, candidates, part.m_final))
            )
            if deadline.passed():
                break
        counters.seconds_expand += time.perf_counter() - clock
        return parts
