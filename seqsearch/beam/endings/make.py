"""What looks to the ends of a problem's tours."""

from feasibility.classifier.predictor import LegPredictor
from seqsearch.beam.endings.fixed import FixedEnds
from seqsearch.beam.endings.free import FreeEnds
from seqsearch.beam.endings.protocol import Ends
from seqsearch.core.ending import ending_of
from seqsearch.core.problem import Problem
from seqsearch.pruning.mima_predictor import MimaPredictor


def make_ends(problem: Problem, predictor: LegPredictor | None, threads: int = 1) -> Ends:
    """Return what looks to the ends of tours; without a predictor, with MIMA's answers."""
    ending = ending_of(problem)
    if ending is None:
        return FreeEnds(problem)
    return FixedEnds(problem, ending, predictor or MimaPredictor(), threads)
