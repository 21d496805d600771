"""The `TourEvent` protocol: what a tour's rules may allow beyond legs from rest to rest."""

from typing import Protocol, Self, runtime_checkable

from seqsearch.tours.checks import Check, FlownTour


@runtime_checkable
class TourEvent(Protocol):
    """A rule about one kind of event, such as a launch, and how to check that a tour keeps it.

    An implementation is a frozen `msgspec.Struct` whose tag (``tag_field="kind"``) names the kind
    in the tour file; its fields are the rule's numbers. Checks see the flown tour, never the
    search, and use nothing of the leg solver. Tours whose rules do not have an event of a kind
    are checked against `forbidden`, so that nothing of that kind happens unnoticed.
    """

    @classmethod
    def forbidden(cls) -> Self | None:
        """Return the rule for tours that do not allow events of this kind; None for no rule."""
        ...

    def checks(self, flown: FlownTour, /) -> list[Check]:
        """Return the checks of this rule, at least one, the same ones for every tour."""
        ...
