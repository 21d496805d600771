"""Events by the names of their kinds."""

from functools import cache
from typing import Any, Final

from seqsearch.tours.events.drop import Drop
from seqsearch.tours.events.fly_by import FlyBy
from seqsearch.tours.events.groups import Groups
from seqsearch.tours.events.launch import Launch
from seqsearch.tours.events.protocol import TourEvent
from seqsearch.tours.kinds import kinds_of, record_of

ENTRY_POINTS: Final = "seqsearch.events"
"""Group of entry points by which other packages bring kinds of events."""

_OURS: Final[tuple[type[TourEvent], ...]] = (Launch, FlyBy, Drop, Groups)


@cache
def event_kinds() -> dict[str, type[TourEvent]]:
    """Return the kinds of events that tour files may name."""
    return kinds_of(_OURS, ENTRY_POINTS)


def make_event(plain: Any) -> TourEvent:
    """Return the event that a JSON object of a tour file describes.

    Raises
    ------
    InputError
        Its kind is unknown, or its fields do not fit the kind.
    """
    return record_of(plain, event_kinds(), "event")
