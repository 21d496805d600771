"""`FlyBy`: bodies are passed with some speed: new ones, or those met at rest before."""

from itertools import pairwise
from typing import Self, final

import msgspec
import numpy as np
from msgspec import UNSET, UnsetType

from seqsearch.tours.checks import (
    SPEED_TOLERANCE_M_S,
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
    """The rule of fly-bys: of bodies that were met at rest before, and as visits themselves.

    Parameters
    ----------
    speed_min_m_s : float
        Least speed relative to the body.
    times : int
        How often each body that was met before may be passed; 0 for no such fly-bys.
    visit_max_m_s : float or None, optional
        Largest speed with which a body may be visited, None for any; tours whose file says
        nothing have to be at rest.
    last_max_m_s : float or None, optional
        The same for the last visit of the tour, where that differs.
    """

    speed_min_m_s: float
    times: int = 1
    visit_max_m_s: float | UnsetType | None = UNSET
    last_max_m_s: float | UnsetType | None = UNSET

    @classmethod
    def forbidden(cls) -> Self:
        """Return the rule of a tour without fly-bys."""
        return cls(speed_min_m_s=0.0, times=0)

    def checks(self, flown: FlownTour, /) -> list[Check]:
        """Return the checks of which bodies are passed, how fast, and without a stay after it."""
        astray = self._astray(flown.legs)
        met_before = self.visit_max_m_s is UNSET and self.last_max_m_s is UNSET
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
                "fly-bys of bodies met before, once each" if met_before else "fly-bys",
                not astray,
                str(astray) if astray else "all",
                ("all" if self.times else "no fly-bys") if met_before else "of bodies to visit",
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
            *self._speeds_of_visits(flown.legs),
        ]

    def visit_bound(self, *, last: bool) -> float:
        """Return m/s, the largest speed of the last visit, or of those before; inf for any."""
        bound = self.visit_max_m_s
        if last and self.last_max_m_s is not UNSET:
            bound = self.last_max_m_s
        if bound is UNSET:
            return 0.0
        return np.inf if bound is None else float(bound)

    def _speeds_of_visits(self, legs: tuple[TourLeg, ...]) -> list[Check]:
        """Return a check of the speeds of visits, where they have a bound but need not rest."""
        checks = []
        for last, name in ((False, "speed of visits"), (True, "speed at the last arrival")):
            bound = self.visit_bound(last=last)
            if 0.0 < bound < np.inf:
                fastest = largest(
                    float(np.linalg.norm(leg.arr_velocity_m_s))
                    for leg in (legs[-1:] if last else legs[:-1])
                )
                checks.append(
                    Check(
                        name,
                        fastest <= bound + SPEED_TOLERANCE_M_S,
                        f"fastest {fastest:.6f} m/s",
                        f"{bound:g} m/s",
                    )
                )
        return checks

    def _astray(self, legs: tuple[TourLeg, ...]) -> list[int]:
        """Return bodies that are passed too often, or that had to be met at rest before."""
        astray: list[int] = []
        met: set[int] = set()
        passed: list[int] = []
        for leg in legs:
            visit = leg.to_id not in met and self.visit_bound(last=leg is legs[-1]) > 0.0
            if not leg.is_fly_by or visit:
                met.add(leg.to_id)
                continue
            if leg.to_id not in met or passed.count(leg.to_id) >= self.times:
                astray.append(leg.to_id)
            passed.append(leg.to_id)
        return astray
