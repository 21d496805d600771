"""Rankings beyond the weighted sum: each a small class that scores nodes that compete.

To write one of your own, give a class the method of `seqsearch.ranking.Ranking`
and hand an object to ``seqsearch.search(problem, ranking=...)``.
"""

from seqsearch.rankings.balanced import BalancedRanking
from seqsearch.rankings.make import make_ranking
from seqsearch.rankings.pareto import ParetoRanking
from seqsearch.rankings.potential import PotentialRanking

__all__ = ["BalancedRanking", "ParetoRanking", "PotentialRanking", "make_ranking"]
