"""`GridExpander`: a fixed grid of flight times, a pruner, and the leg solver."""

import time
from typing import final

from feasibility.classifier.predictor import lambert_final_mass
from seqsearch.beam.counters import RankCounters
from seqsearch.beam.expanders.protocol import ExpanderTools
from seqsearch.beam.frontiers.protocol import Frontier
from seqsearch.core.candidates import Candidates, grid_candidates, reached
from seqsearch.core.flown_hops import FlownHops
from seqsearch.core.nodes import Nodes
from seqsearch.deadline import Deadline
from seqsearch.pruning.audit import Sample
from seqsearch.pruning.hop_pruning import keep_hops
from seqsearch.settings import SearchSettings


@final
class GridExpander:
    """Proposes a fixed grid of flight times, asks a pruner, and optimises what survives.

    What is optimised first, the ranking decides by Lambert's estimate of the masses.

    Parameters
    ----------
    tools : ExpanderTools
        What it works with.
    """

    def __init__(self, tools: ExpanderTools) -> None:
        self._tools = tools

    def expand(
        self,
        nodes: Nodes,
        frontier: Frontier,  # noqa: ARG002
        settings: SearchSettings,
        counters: RankCounters,
        sample: Sample,
        deadline: Deadline,
    ) -> FlownHops:
        """Return the flyable hops found and what it took."""
        tools = self._tools
        kept = self._pruned(nodes, settings, counters, sample, deadline)
        if not kept:
            return FlownHops.none()
        candidates = Candidates.concatenate(kept)
        clock = time.perf_counter()
        m_final = lambert_final_mass(candidates.hops.legs[-1])
        promise = tools.ranking.score(
            reached(tools.problem, nodes, candidates, m_final), tools.problem
        )
        optimised = tools.optimiser.run(candidates, promise, settings, deadline)
        counters.seconds_optimise = time.perf_counter() - clock
        return FlownHops.of(tools.problem, nodes, candidates, optimised)

    def _pruned(
        self,
        nodes: Nodes,
        settings: SearchSettings,
        counters: RankCounters,
        sample: Sample,
        deadline: Deadline,
    ) -> list[Candidates]:
        """Propose candidates and return those that every pruner keeps, in blocks."""
        tools = self._tools
        kept = []
        clock = time.perf_counter()
        for block in grid_candidates(tools.problem, nodes, tools.neighbours, settings):
            counters.proposed += len(block)
            counters.seconds_expand += time.perf_counter() - clock
            clock = time.perf_counter()
            survivors = keep_hops(tools.pruner, block.hops)
            counters.count_kept(survivors)
            counters.seconds_prune += time.perf_counter() - clock
            clock = time.perf_counter()
            sample.offer(block, survivors.mask)
            if survivors.mask.any():
                kept.append(block.take(survivors.mask))
            if deadline.passed():
                break
        return kept
