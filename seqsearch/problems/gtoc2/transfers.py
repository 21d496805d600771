"""Transfers from rest at asteroids to rest at others.

Three rounds, each about fewer targets and with better answers: a few quick questions over
the flight times that are possible at all; a curve of quick answers for targets that seem to
lead to the best tours; and good answers for the flight times that are proposed.
"""

from collections.abc import Callable
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility import Legs
from seqsearch.core.margin_curves import MarginCurves
from seqsearch.problems.gtoc2.plans import LEVELS, Plans, at_levels
from seqsearch.problems.gtoc2.prospects import Pairs, Prospects
from seqsearch.problems.moves.questions import Questions
from seqsearch.settings import SearchSettings

_Array = NDArray[np.float64]
_Rows = NDArray[np.intp]

_COARSE: Final = 5
_FINE: Final = 12
"""Flight times that are asked about in the first two rounds."""

_LOOKED_AT: Final = 30
_PURSUED: Final = 12
"""Targets of a node in the last two rounds."""

_CLOSE_CALL: Final = -0.1
"""log(m*/m0) by coarse answers that may be 0 in fact."""

_SOONEST: Final = 0.75
"""Shortest flight time that is asked about, over what the difference of the orbits needs."""

_LONGEST: Final = 3.5
_LONGEST_DAYS: Final = 120.0
"""Longest flight time that is asked about: this many times the shortest, and days more."""


@final
class Transfers:
    """Plans transfers.

    Parameters
    ----------
    prospects : Prospects
        The nodes, and which targets are worth questions.
    legs : callable
        Makes the legs of plans.
    questions : Questions
        Asks the predictor.
    settings : SearchSettings
        `neighbours`: targets of the first round; `tof_days_min` and `tof_days_max`.
    """

    def __init__(
        self,
        prospects: Prospects,
        legs: Callable[[Plans], Legs],
        questions: Questions,
        settings: SearchSettings,
    ) -> None:
        self._prospects = prospects
        self._legs = legs
        self._questions = questions
        self._settings = settings

    def plans(self, block: _Rows) -> Plans:
        """Return transfers from some nodes, at several flight times for each target."""
        prospects, ask = self._prospects, self._questions
        pairs = prospects.pairs(block, 0.0, self._settings.neighbours)
        soonest = self._curves(pairs, _COARSE).shortest(_CLOSE_CALL)
        pairs = pairs.take(prospects.best(pairs, soonest, _LOOKED_AT))
        curves = self._curves(pairs, _FINE)
        chosen = prospects.best(pairs, curves.shortest(LEVELS[0]), _PURSUED)
        pairs, curves = pairs.take(chosen), curves.take(chosen)
        soonest = curves.shortest(LEVELS[0])
        curves = ask.corrected(curves, soonest, self._legs(_planned(pairs, soonest)))
        k, tof = at_levels(curves)
        return _planned(pairs.take(k), tof)

    def _curves(self, pairs: Pairs, knots: int) -> MarginCurves:
        least, most = self._settings.tof_days_min, self._settings.tof_days_max
        first = np.clip(_SOONEST * pairs.shortest_days, least, most)
        last = np.minimum(_LONGEST * first + _LONGEST_DAYS, most)
        return self._questions.curves(
            np.arange(len(pairs)),
            first,
            last,
            knots,
            lambda k, tof: self._legs(_planned(pairs.take(k), tof)),
        )


def _planned(pairs: Pairs, tof_days: _Array) -> Plans:
    return Plans(pairs.parent, pairs.target, np.zeros((len(pairs), 3)), tof_days)
