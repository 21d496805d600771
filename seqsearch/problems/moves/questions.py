"""`Questions`: what a predictor is asked by problems that shape their moves, and how often.

Questions that only shape and order moves go to the predictor's quick answers, a few
percent off; one good answer a way corrects them.
"""

from collections.abc import Callable
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility import Legs
from feasibility.classifier.predictor import LegPredictor
from seqsearch.core.hop_margins import quick_margin_of
from seqsearch.core.margin_curves import MarginCurves, flight_times

_Array = NDArray[np.float64]
_Rows = NDArray[np.intp]

_NOWHERE: Final = -5.0
"""log(m*/m0) of legs of which nothing is known."""


@final
class Questions:
    """Asks a predictor and counts the legs.

    Parameters
    ----------
    predictor : LegPredictor
        Whom to ask; a `QuickPredictor` for its quick answers first.

    Attributes
    ----------
    count : int
        Legs that the predictor was asked about so far.
    """

    def __init__(self, predictor: LegPredictor) -> None:
        self._predictor = predictor
        self._quick = quick_margin_of(predictor)
        self.count = 0

    def quick_log_margin(self, legs: Legs) -> _Array:
        """Return (n,) quick answers of log(m*/m0), very low where nothing is known."""
        self.count += len(legs)
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.nan_to_num(np.log(self._quick(legs)), nan=_NOWHERE, neginf=_NOWHERE)

    def curves(
        self,
        pair: _Rows,
        first_days: _Array,
        last_days: _Array,
        knots: int,
        legs: Callable[[_Rows, _Array], Legs],
    ) -> MarginCurves:
        """Return the margin of each pair over the flight time, by quick answers.

        Parameters
        ----------
        pair : (n,) intp
            What `legs` knows the pairs by.
        first_days, last_days : (n,) float64
            Shortest and longest flight times.
        knots : int
            Flight times that are asked about.
        legs : callable
            Makes the legs of (m,) pairs at (m,) flight times.
        """
        tof = flight_times(first_days, last_days, knots)
        values = self.quick_log_margin(legs(np.repeat(pair, knots), tof.ravel()))
        return MarginCurves.through(first_days, last_days, values.reshape(tof.shape))

    def corrected(self, curves: MarginCurves, tof_days: _Array, legs: Legs) -> MarginCurves:
        """Return n curves shifted to the good answers for n legs of those flight times."""
        self.count += len(legs)
        with np.errstate(invalid="ignore", divide="ignore"):
            return curves.corrected(tof_days, np.log(self._predictor.margin(legs)))

    def final_mass(self, legs: Legs) -> _Array:
        """Return (n,) kg, good answers of the mass at arrival."""
        self.count += len(legs)
        return self._predictor.final_mass(legs)
