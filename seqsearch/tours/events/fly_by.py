"""`FlyBy`: a body met at rest before is passed once more, fast."""

from itertools import pairwise
from typing import Self, final

import msgspec
import numpy as np

from seqsearch.tours.checks import (
    TIME_TOLERANCE_DAYS,
    Check,
    FlownTour,
    largest,
    smallest,
)
from seqsearch.tours.records import TourLeg


@final
class FlyBy(
    msgspec.Struct,
    frozen=True,
    kw_only=True,
    forbid_unknown_fields=True,
    tag_field="kind",
    tag="fly-by",
):
    """The rule of fly-bys of bodies that were met at rest before.

    Parameters
    ----------
    speed_min_m_s : float
        Least speed relative to the body.
    times : int
        How often each body may be passed; 0 for no fly-bys.
    """

    speed_min_m_s: float
    times: int = 1

    @classmethod
    def forbidden(cls) -> Self:
        """Return the rule of a tour without fly-bys."""
        return cls(speed_min_m_s=0.0, times=0)

    def checks(self, flown: FlownTour, /) -> list[Check]:
        """Return the checks of which bodies are passed, how fast, and without a stay after it."""
        astray = self._astray(flown.legs)
        wait = largest(
            abs(following.t_dep_mjd2000 - leg.t_arr_mjd2000)
            for leg, following in pairwise(flown.legs)
            if leg.is_fly_by
        )
        slowest = smallest(
            float(np.linalg.norm(arrival.reached[3:] - arrival.target[3:]))
            for leg, arrival in zip(flown.legs, flown.arrivals, strict=True)
            if leg.is_fly_by and arrival is not None
        )
        return [
            Check(
                "fly-bys of bodies met before, once each",
                not astray,
                str(astray) if astray else "all",
                "all" if self.times else "no fly-bys",
            ),
            Check(
                "no stay after a fly-by",
                wait <= TIME_TOLERANCE_DAYS,
                f"longest {wait:.2e} days",
                f"{TIME_TOLERANCE_DAYS:g} days",
            ),
            Check(
                "speed of fly-bys",
                slowest >= self.speed_min_m_s,
                f"slowest {slowest:.3f} m/s",
                f"at least {self.speed_min_m_s:g} m/s",
            ),
        ]

    def _astray(self, legs: tuple[TourLeg, ...]) -> list[int]:
        """Return the bodies that are passed too often, or before they were met at rest."""
        astray: list[int] = []
        met: set[int] = set()
        passed: list[int] = []
        for leg in legs:
            if not leg.is_fly_by:
                met.add(leg.to_id)
                continue
            if leg.to_id not in met or passed.count(leg.to_id) >= self.times:
                astray.append(leg.to_id)
            passed.append(leg.to_id)
        return astray
