"""Epochs of SPICE (seconds of TDB past J2000) beside MJD2000 and calendar dates."""

import datetime
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Self, final

from feasibility.constants import DAY_S
from feasibility.errors import InputError
from feasibility.orbits.spk.text_kernel import read_text_kernel

_J2000: Final = datetime.datetime(2000, 1, 1, 12)
_J2000_MJD2000: Final = 0.5
_DAYS_LATEST: Final = 2_900_000.0
"""What Python's calendar reaches after J2000."""

_DAYS_EARLIEST: Final = -730_000.0
_MONTHS: Final = "JANFEBMARAPRMAYJUNJULAUGSEPOCTNOVDEC"


def seconds_of(t_mjd2000: Any) -> Any:
    """Return seconds of TDB past J2000, of a number or an array."""
    return (t_mjd2000 - _J2000_MJD2000) * DAY_S


def mjd2000_of(seconds: Any) -> Any:
    """Return epochs in MJD2000, of a number or an array."""
    return seconds / DAY_S + _J2000_MJD2000


@final
@dataclass(frozen=True)
class Calendar:
    """Writes epochs as dates: in UTC where there is a leap-second kernel, else in TDB.

    Attributes
    ----------
    leaps : tuple
        Seconds by which TAI is ahead of UTC, and since when (UTC seconds past J2000's noon).
    tt_tai_s : float
        Seconds by which terrestrial time is ahead of TAI.
    """

    leaps: tuple[tuple[float, float], ...] = ()
    tt_tai_s: float = 32.184

    @classmethod
    def read(cls, leap_seconds: Path | None) -> Self:
        """Return the calendar of a leap-second kernel, or one without any.

        Raises
        ------
        InputError
            The kernel has no leap seconds, or they are not readable.
        """
        if leap_seconds is None:
            return cls()
        table = read_text_kernel(leap_seconds)
        pairs = table.get("DELTET/DELTA_AT", [])
        try:
            leaps = tuple(
                (float(pairs[k]), (_date(pairs[k + 1]) - _J2000).total_seconds())
                for k in range(0, len(pairs), 2)
            )
            tt_tai_s = float(table["DELTET/DELTA_T_A"][0])
        except (KeyError, ValueError, IndexError):
            leaps, tt_tai_s = (), 0.0
        if not leaps:
            raise InputError(
                f"{leap_seconds}: no leap seconds; expected DELTET/DELTA_AT and DELTET/DELTA_T_A"
            )
        return cls(leaps, tt_tai_s)

    def text(self, seconds: float) -> str:
        """Return an epoch, in seconds of TDB past J2000, as a date such as ``2030-01-01``.

        The time of day is left out at midnight.
        """
        if self.leaps:
            # TDB is within 2 ms of terrestrial time.
            tai = seconds - self.tt_tai_s
            ahead = [delta for delta, since in self.leaps if tai - delta >= since - 0.5]
            seconds = tai - (ahead[-1] if ahead else self.leaps[0][0])
        days = min(max(seconds / DAY_S, _DAYS_EARLIEST), _DAYS_LATEST)
        when = _J2000 + datetime.timedelta(seconds=round(days * DAY_S))
        midnight = when.time() == datetime.time()
        return f"{when:%Y-%m-%d}" if midnight else f"{when:%Y-%m-%d %H:%M:%S}"

    @property
    def scale(self) -> str:
        """Name of the time scale."""
        return "UTC" if self.leaps else "TDB"

    def spans(self, intervals: Sequence[tuple[float, float]], most: int = 3) -> str:
        """Return intervals of time in words, the first ones where there are many."""
        texts = [f"{self.text(start)} to {self.text(end)}" for start, end in intervals[:most]]
        more = f" and {len(intervals) - most} more" if len(intervals) > most else ""
        return f"{' and '.join(texts)}{more} ({self.scale})"


def _date(text: str) -> datetime.datetime:
    """Return a date of a text kernel, such as ``@1972-JAN-1``."""
    year, month, day = text.lstrip("@").split("-")
    return datetime.datetime(int(year), _MONTHS.index(month.upper()[:3]) // 3 + 1, int(day))
