"""Scores: what problems count, one rule a file.

| rule | what counts |
|---|---|
| `VisitCount` | visited bodies |
| `Points` | points for rendezvous and fly-bys |
| `MassRate` | final mass over flight time |

Another package brings a rule of its own through the entry points `seqsearch.scores`.
"""

from seqsearch.tours.scores.make import make_score, score_kinds
from seqsearch.tours.scores.mass_rate import MassRate
from seqsearch.tours.scores.points import Points
from seqsearch.tours.scores.protocol import ScoreRule
from seqsearch.tours.scores.visits import VisitCount

__all__ = ["MassRate", "Points", "ScoreRule", "VisitCount", "make_score", "score_kinds"]
