"""`VisitCount`: the number of visited bodies."""

from typing import ClassVar, final

import msgspec

from seqsearch.tours.records import TourBody, TourLeg


@final
class VisitCount(
    msgspec.Struct,
    frozen=True,
    kw_only=True,
    forbid_unknown_fields=True,
    tag_field="kind",
    tag="visits",
):
    """One for each visited body."""

    name: ClassVar[str] = ""
    unit: ClassVar[str] = ""

    def score(self, visits: tuple[TourBody, ...], legs: tuple[TourLeg, ...], /) -> float:  # noqa: ARG002
        """Return the number of bodies."""
        return float(len(visits))
