"""Rankings beyond the weighted sum: each a small class that scores nodes that compete.

To write one of your own, give a class the method of `seqsearch.beam.rankings.protocol.Ranking`
and hand an object to ``seqsearch.search(problem, ranking=...)``.
"""

from seqsearch.beam.rankings.balanced import BalancedRanking
from seqsearch.beam.rankings.make import make_ranking
from seqsearch.beam.rankings.pareto import ParetoRanking
from seqsearch.beam.rankings.potential import PotentialRanking

__all__ = ["BalancedRanking", "ParetoRanking", "PotentialRanking", "make_ranking"]
