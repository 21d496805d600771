"""What a run says while it works: a line a rank, and a sign of life in between."""

import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final, final

from feasibility.runtime.terminal import Level, say, shows
from seqsearch.beam.counters import RankCounters
from seqsearch.tours.tour import Tour

_PIPED_S: Final = 60.0
_TERMINAL_S: Final = 10.0
"""Longest silence, where a person watches and where a file or a program does."""


@final
class Progress:
    """Prints how far a run is, in lines that fit 80 columns unless all details are wanted.

    Parameters
    ----------
    time_limit_s : float, optional
        The run's limit.
    spent_s : float
        What the sessions before used of it.
    """

    def __init__(self, time_limit_s: float | None, spent_s: float) -> None:
        self._limit_s = time_limit_s
        self._began = time.monotonic() - spent_s
        self._best = "nothing found yet"
        self._lock = threading.Lock()
        self._said = time.monotonic()

    def rank(self, counters: RankCounters, tour: Tour) -> None:
        """Say what a rank, or the scouts before a pass, found."""
        with self._lock:
            self._best = _short(tour)
            self._said = time.monotonic()
            detailed = shows(Level.DETAILS)
            say(_long_line(counters, tour) if detailed else self._line(counters), Level.PROGRESS)

    @contextmanager
    def alive(self) -> Iterator[None]:
        """Print a line from time to time, as long as nothing else is printed."""
        over = threading.Event()
        silence_s = _TERMINAL_S if sys.stdout.isatty() else _PIPED_S
        thread = threading.Thread(target=self._watch, args=(over, silence_s), daemon=True)
        thread.start()
        try:
            yield
        finally:
            over.set()
            thread.join()

    def _watch(self, over: threading.Event, silence_s: float) -> None:
        while not over.wait(silence_s / 20):
            with self._lock:
                if time.monotonic() - self._said >= silence_s:
                    self._said = time.monotonic()
                    say(f"still searching: {self._clock()} | {self._best}", Level.PROGRESS)

    def _line(self, counters: RankCounters) -> str:
        if counters.rank == 0:
            what = f"scouts: {counters.kept} itineraries"
        else:
            what = f"rank {counters.rank:>2}: {counters.optimised} solved, {counters.kept} kept"
        return f"pass {counters.pass_number} {what}, {self._clock()} | {self._best}"

    def _clock(self) -> str:
        elapsed = _minutes(time.monotonic() - self._began)
        return elapsed if self._limit_s is None else f"{elapsed} of {_minutes(self._limit_s)}"


def _minutes(seconds: float) -> str:
    """Return a duration such as ``3:07`` or ``1:03:07``."""
    minutes, rest = divmod(int(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"


def _short(tour: Tour) -> str:
    if not tour.legs:
        return "no leg yet"
    rule = tour.rules.score
    counts = f"{rule.name} {tour.score:.1f}" if rule.name else f"{tour.n_asteroids} asteroids"
    return f"{counts}, {tour.duration_days:.0f} d, {tour.m_final_kg:.0f} kg"


def _long_line(counters: RankCounters, tour: Tour) -> str:
    if counters.rank == 0:
        return (
            f"pass {counters.pass_number} scouts: {counters.nodes} nodes, "
            f"{counters.proposed} proposed, {counters.kept} itineraries to optimise, "
            f"{counters.seconds:.1f} s | best {tour.headline()}"
        )
    pruned = ", ".join(f"{name} {count}" for name, count in counters.pruned.items())
    return (
        f"pass {counters.pass_number} rank {counters.rank:>2}: {counters.nodes} nodes, "
        f"{counters.proposed} proposed, pruned {pruned or 'none'}, "
        f"{counters.optimised} optimised, {counters.feasible} feasible, {counters.kept} kept, "
        f"{counters.seconds:.1f} s | best {tour.headline()}"
    )
