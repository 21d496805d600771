"""What expanders with a predictor do at the end: the pruner's word, then the solver's."""

import time

from seqsearch.beam.counters import RankCounters
from seqsearch.beam.expanders.protocol import ExpanderTools
from seqsearch.core.candidates import Candidates
from seqsearch.core.flown_hops import FlownHops
from seqsearch.core.nodes import Nodes
from seqsearch.deadline import Deadline
from seqsearch.pruning.audit import Sample
from seqsearch.pruning.hop_pruning import keep_hops
from seqsearch.settings import SearchSettings


def fly_best(
    tools: ExpanderTools,
    nodes: Nodes,
    best: tuple[Candidates, Nodes],
    settings: SearchSettings,
    counters: RankCounters,
    sample: Sample,
    deadline: Deadline,
) -> FlownHops:
    """Prune the best candidates and optimise what is left, the most promising first.

    Parameters
    ----------
    tools : ExpanderTools
        Pruner, ranking and solver.
    nodes : Nodes
        The nodes that are expanded.
    best : tuple of (Candidates, Nodes)
        n candidates and the nodes to which they are predicted to lead.
    settings, counters, deadline
        As for an `Expander`.
    sample : Sample
        Is shown the candidates and which of them were pruned.
    """
    clock = time.perf_counter()
    candidates, reached = best
    survivors = keep_hops(tools.pruner, candidates.hops)
    counters.count_kept(survivors)
    sample.offer(candidates, survivors.mask)
    candidates, reached = candidates.take(survivors.mask), reached.take(survivors.mask)
    counters.seconds_prune += time.perf_counter() - clock
    if len(candidates) == 0 or deadline.passed():
        return FlownHops.none()
    clock = time.perf_counter()
    promise = tools.ranking.score(reached, tools.problem)
    optimised = tools.optimiser.run_all(candidates, promise, settings, deadline)
    counters.seconds_optimise = time.perf_counter() - clock
    return FlownHops.of(tools.problem, nodes, candidates, optimised)
