"""When to stop: a wall-clock budget that every loop of the search looks at."""

import time
from typing import final


@final
class Deadline:
    """A point in time after which no new work is begun.

    Parameters
    ----------
    seconds : float, optional
        Budget from now on; None for no limit.
    """

    def __init__(self, seconds: float | None = None) -> None:
        self._end = None if seconds is None else time.monotonic() + seconds

    def passed(self) -> bool:
        """Tell whether the time is up."""
        return self._end is not None and time.monotonic() >= self._end

    def remaining_s(self) -> float | None:
        """Return the seconds left, at least 0; None without a limit."""
        return None if self._end is None else max(0.0, self._end - time.monotonic())
