"""Events by the names of their kinds: ours, and those that other packages bring."""

from functools import cache
from importlib import metadata
from typing import Any, Final

import msgspec

from feasibility.errors import InputError
from seqsearch.tours.events.drop import Drop
from seqsearch.tours.events.fly_by import FlyBy
from seqsearch.tours.events.groups import Groups
from seqsearch.tours.events.launch import Launch
from seqsearch.tours.events.protocol import TourEvent

ENTRY_POINTS: Final = "seqsearch.events"
"""Group of entry points by which other packages bring kinds of events."""

_OURS: Final[tuple[type[TourEvent], ...]] = (Launch, FlyBy, Drop, Groups)


@cache
def event_kinds() -> dict[str, type[TourEvent]]:
    """Return the kinds of events that tour files may name."""
    kinds = {_kind(event): event for event in _OURS}
    for entry in metadata.entry_points(group=ENTRY_POINTS):
        kinds.setdefault(entry.name, entry.load())
    return kinds


def make_event(record: Any) -> TourEvent:
    """Return the event that a JSON object of a tour file describes.

    Raises
    ------
    InputError
        Its kind is unknown, or its fields do not fit the kind.
    """
    kind = record.get("kind") if isinstance(record, dict) else None
    kinds = event_kinds()
    if kind not in kinds:
        raise InputError(f"event of kind {kind!r}, known are {', '.join(sorted(kinds))}")
    try:
        event: TourEvent = msgspec.convert(record, type=kinds[kind])
    except msgspec.ValidationError as error:
        raise InputError(f"event of kind {kind!r}: {error}") from None
    return event


def _kind(event: type[Any]) -> str:
    return str(event.__struct_config__.tag)
