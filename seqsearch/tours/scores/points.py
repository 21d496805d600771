"""`Points`: so much for a body's rendezvous, so much for a fly-by of it later."""

from typing import ClassVar, final

import msgspec

from seqsearch.tours.records import TourBody, TourLeg


@final
class Points(
    msgspec.Struct,
    frozen=True,
    kw_only=True,
    forbid_unknown_fields=True,
    tag_field="kind",
    tag="points",
):
    """Points for the first rendezvous with each body and the first fly-by after it.

    Parameters
    ----------
    rendezvous, fly_by : float
        The points.
    bonus_ids : tuple of int
        Bodies that count more.
    bonus_factor : float
        How much more.
    """

    name: ClassVar[str] = "score"
    unit: ClassVar[str] = ""

    rendezvous: float
    fly_by: float
    bonus_ids: tuple[int, ...] = ()
    bonus_factor: float = 1.0

    def score(self, visits: tuple[TourBody, ...], legs: tuple[TourLeg, ...], /) -> float:  # noqa: ARG002
        """Return the sum of the points."""
        score = 0.0
        met: set[int] = set()
        passed: set[int] = set()
        for leg in legs:
            weight = self.bonus_factor if leg.to_id in self.bonus_ids else 1.0
            if not leg.is_fly_by and leg.to_id not in met:
                met.add(leg.to_id)
                score += weight * self.rendezvous
            elif leg.is_fly_by and leg.to_id in met - passed:
                passed.add(leg.to_id)
                score += weight * self.fly_by
        return score
