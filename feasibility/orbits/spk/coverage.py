"""When the motion of a body is known, and whether that is enough for a mission."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

from feasibility.errors import InputError
from feasibility.orbits.spk.dates import Calendar
from feasibility.orbits.spk.motion import Piece

Interval = tuple[float, float]
"""Seconds of TDB past J2000."""

_GAP_S: Final = 0.01
"""Shorter gaps between segments are rounding of their ends."""


def coverage(pieces: Sequence[Piece]) -> list[Interval]:
    """Return the times without a gap in which a motion is known, in order."""
    found: list[Interval] = []
    for piece in pieces:
        if found and piece.start - found[-1][1] <= _GAP_S:
            found[-1] = (found[-1][0], max(found[-1][1], piece.end))
        else:
            found.append((piece.start, piece.end))
    return found


def around(intervals: Sequence[Interval], window: Interval) -> Interval | None:
    """Return the interval that has a whole window, None where none has."""
    for start, end in intervals:
        if start - _GAP_S <= window[0] and window[1] <= end + _GAP_S:
            return start, end
    return None


def within(intervals: Sequence[Interval], window: Interval) -> list[Interval]:
    """Return what of a window is covered."""
    clipped = [(max(start, window[0]), min(end, window[1])) for start, end in intervals]
    return [(start, end) for start, end in clipped if start <= end]


def nearest(intervals: Sequence[Interval], epoch: float) -> float:
    """Return the covered epoch that is nearest to an epoch."""
    clamped = [min(max(epoch, start), end) for start, end in intervals]
    return min(clamped, key=lambda found: abs(found - epoch))


@final
@dataclass(frozen=True)
class BodyCoverage:
    """When a body is known, and what messages say about it.

    Attributes
    ----------
    path : Path
        What was read.
    label : str
        The body in words.
    files : tuple of str
        Names of its kernels.
    intervals : tuple
        When its motion about the Sun is known, at least one interval.
    calendar : Calendar
        Writes dates.
    """

    path: Path
    label: str
    files: tuple[str, ...]
    intervals: tuple[Interval, ...]
    calendar: Calendar

    def needs_all_of(self, window: Interval) -> None:
        """Refuse a window that is not covered from end to end.

        Raises
        ------
        InputError
            It is outside or has a gap in it.
        """
        if around(self.intervals, window) is None:
            raise InputError(self._apart(window))

    def needs_some_of(self, window: Interval) -> tuple[str, ...]:
        """Return a note where a window is covered in part, and refuse one that is not at all.

        Raises
        ------
        InputError
            Nothing of it is covered.
        """
        if around(self.intervals, window) is not None:
            return ()
        if not within(self.intervals, window):
            raise InputError(self._apart(window))
        return (self._words(window),)

    def _apart(self, window: Interval) -> str:
        return f"{self.path}: {self._words(window)}"

    def _words(self, window: Interval) -> str:
        have = self.calendar.spans(self.intervals)
        gap = "with gaps " if len(self.intervals) > 1 else ""
        where = "" if self.files == (self.path.name,) else f" by {', '.join(self.files)}"
        return (
            f"{self.label} is covered{where} {gap}from {have}, but the mission is "
            f"from {self.calendar.spans([window])}"
        )
