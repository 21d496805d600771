"""`MassRate`: final mass over flight time, for tours that are complete."""

from typing import ClassVar, final

import msgspec

from feasibility.constants import YEAR_DAYS
from seqsearch.tours.records import TourBody, TourLeg


@final
class MassRate(
    msgspec.Struct,
    frozen=True,
    kw_only=True,
    forbid_unknown_fields=True,
    tag_field="kind",
    tag="mass-rate",
):
    """Mass after the last arrival over the time from the first departure, in kg per year.

    Parameters
    ----------
    visits : int
        Visits of a complete tour; with fewer the score is 0.
    """

    name: ClassVar[str] = "J"
    unit: ClassVar[str] = "kg/year"

    visits: int

    def score(self, visits: tuple[TourBody, ...], legs: tuple[TourLeg, ...], /) -> float:
        """Return the rate."""
        if len(visits) < self.visits or not legs:
            return 0.0
        years = (legs[-1].t_arr_mjd2000 - legs[0].t_dep_mjd2000) / YEAR_DAYS
        return (legs[-1].m_final_kg - legs[-1].dropped_kg) / years
