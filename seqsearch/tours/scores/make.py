"""Score rules by the names of their kinds."""

from functools import cache
from typing import Any, Final

from seqsearch.tours.kinds import kinds_of, record_of
from seqsearch.tours.scores.mass_rate import MassRate
from seqsearch.tours.scores.points import Points
from seqsearch.tours.scores.protocol import ScoreRule
from seqsearch.tours.scores.visits import VisitCount

ENTRY_POINTS: Final = "seqsearch.scores"
"""Group of entry points by which other packages bring score rules."""

_OURS: Final[tuple[type[ScoreRule], ...]] = (VisitCount, Points, MassRate)


@cache
def score_kinds() -> dict[str, type[ScoreRule]]:
    """Return the kinds of score rules that tour files may name."""
    return kinds_of(_OURS, ENTRY_POINTS)


def make_score(plain: Any) -> ScoreRule:
    """Return the score rule that a JSON object of a tour file describes.

    Raises
    ------
    InputError
        Its kind is unknown, or its fields do not fit the kind.
    """
    return record_of(plain, score_kinds(), "score rule")
