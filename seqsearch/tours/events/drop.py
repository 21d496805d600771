"""`Drop`: something is left behind at each body."""

from typing import Self, final

import msgspec

from seqsearch.tours.checks import MASS_TOLERANCE_KG, Check, FlownTour, largest


@final
class Drop(
    msgspec.Struct,
    frozen=True,
    kw_only=True,
    forbid_unknown_fields=True,
    tag_field="kind",
    tag="drop",
):
    """The rule of what is left behind.

    Parameters
    ----------
    rendezvous_kg : float
        At each arrival at rest.
    fly_by_kg : float
        At each fly-by.
    """

    rendezvous_kg: float
    fly_by_kg: float

    @classmethod
    def forbidden(cls) -> Self:
        """Return the rule of a tour that leaves nothing behind."""
        return cls(rendezvous_kg=0.0, fly_by_kg=0.0)

    def checks(self, flown: FlownTour, /) -> list[Check]:
        """Return the check of the masses."""
        unlike = largest(
            abs(leg.dropped_kg - (self.fly_by_kg if leg.is_fly_by else self.rendezvous_kg))
            for leg in flown.legs
        )
        return [
            Check(
                "masses left behind",
                unlike <= MASS_TOLERANCE_KG,
                f"largest difference {unlike:.2e} kg",
                f"{MASS_TOLERANCE_KG} kg",
            )
        ]
