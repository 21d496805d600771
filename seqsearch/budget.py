"""`Limits`, what a user allows, and `Budget`, what is left of it while a search runs."""

import time
from dataclasses import dataclass
from typing import final

from feasibility.errors import InputError
from seqsearch.deadline import Deadline


@final
@dataclass(frozen=True, kw_only=True)
class Limits:
    """What a run may use, sessions before included, and who works on it.

    Parameters
    ----------
    time_limit_s : float, optional
        Wall-clock time.
    max_solves : int, optional
        Legs that are given to the solver, the audit's not counted.
    workers : int, optional
        Processes; default: one a core. With a scheduler: threads of this process.
    scheduler : str, optional
        Address of a Dask scheduler whose workers take the place of processes.

    Raises
    ------
    InputError
        A number below one.
    """

    time_limit_s: float | None = None
    max_solves: int | None = None
    workers: int | None = None
    scheduler: str | None = None

    def __post_init__(self) -> None:
        for option, number in (("--workers", self.workers), ("--max-solves", self.max_solves)):
            if number is not None and number < 1:
                raise InputError(f"{option} {number}: expected one or more")


@final
class Budget:
    """Knows when a search has to stop; there is one for each search.

    Parameters
    ----------
    time_limit_s : float, optional
        Wall-clock time of all sessions; None for no limit.
    max_solves : int, optional
        Legs that may be given to the solver in all sessions; None for no limit.
    spent_s : float
        Wall-clock time of the sessions before.
    solves : int
        Legs given to the solver in the sessions before.

    Attributes
    ----------
    deadline : Deadline
        When the time is up, for those who begin many small pieces of work.
    solves : int
        Legs given to the solver so far.
    limited : bool
        Whether there is a limit; then passes go on until it is reached.
    """

    def __init__(
        self,
        time_limit_s: float | None = None,
        max_solves: int | None = None,
        *,
        spent_s: float = 0.0,
        solves: int = 0,
    ) -> None:
        self.deadline = Deadline(None if time_limit_s is None else time_limit_s - spent_s)
        self.solves = solves
        self.limited = time_limit_s is not None or max_solves is not None
        self._max_solves = max_solves
        self._spent_before_s = spent_s
        self._began = time.monotonic()

    @property
    def spent_s(self) -> float:
        """Wall-clock time so far, over all sessions."""
        return self._spent_before_s + time.monotonic() - self._began

    def charge(self, solves: int) -> None:
        """Count legs that were given to the solver."""
        self.solves += solves

    def affordable(self, solves: int) -> int:
        """Return how many of the wanted solves are left."""
        return solves if self._max_solves is None else min(solves, self._max_solves - self.solves)

    def used_up(self) -> bool:
        """Tell whether no new work may be begun."""
        return self._solves_used_up() or self.deadline.passed()

    def ending(self) -> str:
        """Return ``"time limit"`` or ``"solve limit"`` if it is reached, or ``"complete"``."""
        if self.deadline.passed():
            return "time limit"
        return "solve limit" if self._solves_used_up() else "complete"

    def _solves_used_up(self) -> bool:
        return self._max_solves is not None and self.solves >= self._max_solves
