"""Rankings: each a small class that scores nodes that compete.

To write one of your own, give a class the method of `Ranking`, test an object with
`check_ranking`, and hand it to ``seqsearch.search(problem, ranking=...)``.
"""

from seqsearch.beam.rankings.balanced import BalancedRanking
from seqsearch.beam.rankings.check import RankingContractError, check_ranking
from seqsearch.beam.rankings.make import make_ranking
from seqsearch.beam.rankings.pareto import ParetoRanking
from seqsearch.beam.rankings.potential import PotentialRanking
from seqsearch.beam.rankings.protocol import Ranking
from seqsearch.beam.rankings.time_propellant import TimePropellantRanking

__all__ = [
    "BalancedRanking",
    "ParetoRanking",
    "PotentialRanking",
    "Ranking",
    "RankingContractError",
    "TimePropellantRanking",
    "check_ranking",
    "make_ranking",
]
