"""`polish`: retime tours, rebuild their ends, and let them grow.

An iterated local search. The moves are `Extension`s: a part of a tour is kept,
the rest is rebuilt with as many bodies (an exchange) or one more (growth), and
the whole is retimed. Tours that are too long for the mission are worked on all
the same, at their least duration, until one fits.
"""

import functools
import pickle
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility import InputError
from feasibility.classifier.predictor import LegPredictor
from feasibility.runtime.cluster import shared
from seqsearch.core.ending import ending_of, fixed_start
from seqsearch.core.problem import Problem
from seqsearch.deadline import Deadline
from seqsearch.polish.extension import Extender, Extension, ExtensionSettings
from seqsearch.polish.itinerary import Itinerary
from seqsearch.polish.retiming import Retimed, retime
from seqsearch.tours.tour import Tour

_QUICK_ITERATIONS: Final = 5
_THOROUGH_ITERATIONS: Final = 12
_GROWTH_ITERATIONS: Final = 30
"""A tour that has just grown is far from its best timetable."""


_HOPELESS_DAYS: Final = 80.0
"""After the quick iterations, how far behind the tour it came from an exchange is given up."""

_NOTEWORTHY_DAYS: Final = 1.0
"""By how much a tour of the same length has to be better to be reported."""


@final
@dataclass(frozen=True)
class PolishSettings:
    """How long and how broadly tours are polished.

    Attributes
    ----------
    rounds : int
        Rounds without a time limit; with one, rounds go on until it is up.
    moves_per_round : int
        Moves tried side by side. Part of the result: not the number of workers.
    pool : int
        Tours of each length that are kept and worked on.
    growth_share : float
        Share of the moves that lengthen tours; the other moves exchange bodies, half of them
        on tours that fit, half on tours that are one body too long, once there are any.
    avoid_share : float
        Share of the removed bodies that a move may not take again.
    extension : ExtensionSettings
        How thoroughly ends are rebuilt; width and price of propellant vary about it.
    """

    rounds: int = 12
    moves_per_round: int = 8
    pool: int = 6
    growth_share: float = 0.25
    avoid_share: float = 0.15
    extension: ExtensionSettings = field(default_factory=ExtensionSettings)


@final
@dataclass(frozen=True)
class PolishStep:
    """A tour that was the best so far.

    Attributes
    ----------
    action : str
        What led to it: "as found", "retimed", "exchange" or "growth".
    n_asteroids : int
        Bodies visited.
    duration_days, m_final_kg : float
        Time used and mass left.
    seconds : float
        Wall-clock time since the beginning.
    moves : int
        Moves tried so far.
    """

    action: str
    n_asteroids: int
    duration_days: float
    m_final_kg: float
    seconds: float
    moves: int


@final
@dataclass(frozen=True, eq=False)
class PolishResult:
    """What polishing gained.

    Attributes
    ----------
    tour : Tour
        The best tour: most bodies, then least duration. Never worse than the given ones.
    steps : tuple of PolishStep
        From the best given tour to the result.
    moves : int
        Moves that were tried.
    stopped : str
        ``"complete"``, ``"time limit"`` or ``"interrupted"``.
    """

    tour: Tour
    steps: tuple[PolishStep, ...]
    moves: int
    stopped: str

    def table(self) -> str:
        """Return the steps as a text table."""
        header = f"{'step':<10} {'asteroids':>9} {'days':>8} {'mass kg':>8} {'moves':>6} {'s':>7}"
        lines = [header, "-" * len(header)]
        lines += [
            f"{step.action:<10} {step.n_asteroids:>9} {step.duration_days:>8.1f} "
            f"{step.m_final_kg:>8.1f} {step.moves:>6} {step.seconds:>7.1f}"
            for step in self.steps
        ]
        return "\n".join(lines)


def polish(
    problem: Problem,
    tours: Tour | Sequence[Tour],
    *,
    predictor: LegPredictor,
    rng: np.random.Generator | None = None,
    executor: Executor | None = None,
    time_limit_s: float | None = None,
    settings: PolishSettings | None = None,
    on_step: Callable[[PolishStep, Tour], None] | None = None,
) -> PolishResult:
    """Make tours shorter in time and, with what that frees, longer in asteroids.

    Parameters
    ----------
    problem : Problem
        The problem of the tours.
    tours : Tour or sequence of Tour
        What to begin with; several tours of different bodies give more to work on.
    predictor : LegPredictor
        Margins and final masses of legs, such as a `FeasibilityClassifier`.
    rng : numpy.random.Generator, optional
        Draws the moves; default: seed 0. The same seed gives the same result
        with any executor, unless a time limit cuts the work short.
    executor : concurrent.futures.Executor, optional
        Where moves are tried; default: this process.
    time_limit_s : float, optional
        No move is begun after this wall-clock time.
    settings : PolishSettings, optional
        How long and how broadly.
    on_step : callable, optional
        Called with each new best tour.

    Returns
    -------
    PolishResult
        A tour every leg of which the leg solver has flown. An interrupt from
        the keyboard ends the work early and is no error.

    Raises
    ------
    InputError
        No tour is given, or a body of one is not in the catalogue.
    """
    given = [tours] if isinstance(tours, Tour) else list(tours)
    if not given:
        raise InputError("polish: no tour is given, expected at least one")
    return _Polish(
        problem,
        predictor,
        settings or PolishSettings(),
        Deadline(time_limit_s),
        on_step,
    ).run(
        given,
        rng or np.random.default_rng(0),
        executor,
        endless=time_limit_s is not None,
    )


@final
@dataclass(frozen=True, eq=False)
class _Move:
    """One thing to try; can travel to another process."""

    origin: Retimed
    extension: Extension
    avoid: NDArray[np.intp]
    settings: ExtensionSettings

    grows: bool


@final
@dataclass(frozen=True, eq=False)
class _Context:
    """What all moves have in common."""

    problem: Problem
    predictor: LegPredictor


def _try_move(context: _Context, move: _Move) -> Retimed | None:
    """Rebuild an end of a tour and return the best result, retimed; None if there is none."""
    problem = context.problem
    extender = Extender(problem, context.predictor, move.settings)
    itineraries = extender.extend(move.origin.flight, move.extension, avoid=move.avoid)
    old = move.origin.flight.itinerary.rows
    found = [
        retimed
        for itinerary in itineraries
        if not np.array_equal(itinerary.rows, old)
        if (retimed := retime(problem, itinerary, max_iterations=_QUICK_ITERATIONS))
    ]
    if not found:
        return None
    best = min(found, key=lambda retimed: retimed.merit_days)
    if not move.grows and best.merit_days > move.origin.merit_days + _HOPELESS_DAYS:
        return None
    iterations = _GROWTH_ITERATIONS if move.grows else _THOROUGH_ITERATIONS
    return retime(problem, best.flight.itinerary, max_iterations=iterations)


@functools.lru_cache(maxsize=1)
def _unpacked(context: bytes) -> _Context:
    unpacked = pickle.loads(context)
    assert isinstance(unpacked, _Context)
    return unpacked


def _try_move_there(context: bytes, move: _Move) -> Retimed | None:
    return _try_move(_unpacked(context), move)


@final
class _Polish:
    """The state of one polish: the pools, and the best tour so far."""

    def __init__(
        self,
        problem: Problem,
        predictor: LegPredictor,
        settings: PolishSettings,
        deadline: Deadline,
        on_step: Callable[[PolishStep, Tour], None] | None,
    ) -> None:
        self._problem = problem
        self._ending = ending_of(problem)
        self._fixed = (
            int(fixed_start(problem) is not None),
            int(self._ending is not None and self._ending.row is not None),
        )
        self._context = _Context(problem, predictor)
        self._settings = settings
        self._deadline = deadline
        self._on_step = on_step
        self._begin = time.monotonic()
        self._pools: dict[int, list[Retimed]] = {}
        self._steps: list[PolishStep] = []
        self._moves = 0

    def run(
        self,
        tours: list[Tour],
        rng: np.random.Generator,
        executor: Executor | None,
        *,
        endless: bool,
    ) -> PolishResult:
        self._best = max(tours, key=lambda tour: (self._length(tour), -tour.duration_days))
        self._note("as found", self._best)
        stopped = "complete"
        rounds = 0
        try:
            self._retime_given(tours)
            common = executor and shared(executor, pickle.dumps(self._context))
            while self._pools and not self._deadline.passed():
                if not endless and rounds == self._settings.rounds:
                    break
                rounds += 1
                moves = [self._draw(rng) for _ in range(self._settings.moves_per_round)]
                for move, found in zip(
                    moves, self._try_all(moves, executor, common), strict=False
                ):
                    self._moves += 1
                    if found is not None:
                        self._keep(found, "growth" if move.grows else "exchange")
        except KeyboardInterrupt:
            stopped = "interrupted"
        if stopped == "complete" and self._deadline.passed():
            stopped = "time limit"
        return PolishResult(self._best, tuple(self._steps), self._moves, stopped)

    def _length(self, tour: Tour) -> int:
        """Return the number of bodies of a tour, 0 where it does not end where it has to."""
        if self._ending is None or not tour.legs:
            return len(tour.bodies)
        rows = Itinerary.from_tour(self._problem, tour).rows
        return len(rows) if self._ending.is_complete(rows) else 0

    def _retime_given(self, tours: list[Tour]) -> None:
        for tour in sorted(tours, key=lambda tour: (-len(tour.bodies), tour.duration_days)):
            if not tour.legs or self._deadline.passed():
                continue
            itinerary = Itinerary.from_tour(self._problem, tour)
            if self._ending is not None:
                itinerary = itinerary.ended(
                    self._problem, self._ending, self._context.predictor, tour.m_final_kg
                )
            found = retime(self._problem, itinerary, max_iterations=_THOROUGH_ITERATIONS)
            if found is not None:
                self._keep(found, "retimed")

    def _try_all(
        self, moves: list[_Move], executor: Executor | None, common: Any
    ) -> Iterator[Retimed | None]:
        """Yield the results in the order of the moves, until the time is up."""
        if executor is None:
            for move in moves:
                if self._deadline.passed():
                    return
                yield _try_move(self._context, move)
            return
        futures = [executor.submit(_try_move_there, common, move) for move in moves]
        try:
            for future in futures:
                if self._deadline.passed() and not future.running() and not future.done():
                    return
                yield future.result()
        finally:
            for future in futures:
                future.cancel()

    def _keep(self, found: Retimed, action: str) -> None:
        """Put a tour into the pool of its length, and note it if it is the best that fits."""
        flight = found.flight
        if self._ending is not None and not self._ending.is_complete(flight.itinerary.rows):
            return
        pool = self._pools.setdefault(flight.itinerary.n_asteroids, [])
        same = [
            k
            for k, other in enumerate(pool)
            if np.array_equal(other.flight.itinerary.rows, flight.itinerary.rows)
        ]
        if same and pool[same[0]].merit_days <= found.merit_days:
            return
        for k in same:
            del pool[k]
        pool.append(found)
        pool.sort(key=lambda retimed: retimed.merit_days)
        del pool[self._settings.pool :]
        days = flight.itinerary.duration_days
        best = (self._length(self._best), -self._best.duration_days + _NOTEWORTHY_DAYS)
        if flight.keeps_rules(self._problem) and (flight.itinerary.n_asteroids, -days) > best:
            self._note(action, flight.to_tour(self._problem))

    def _note(self, action: str, tour: Tour) -> None:
        self._best = tour
        step = PolishStep(
            action,
            tour.n_asteroids,
            tour.duration_days,
            tour.m_final_kg,
            time.monotonic() - self._begin,
            self._moves,
        )
        self._steps.append(step)
        if self._on_step is not None:
            self._on_step(step, tour)

    def _draw(self, rng: np.random.Generator) -> _Move:
        """Draw a tour from the pools and what to rebuild of it."""
        settings = self._settings
        longest = self._length(self._best)
        fits = max((k for k in self._pools if k <= longest), default=min(self._pools))
        too_long = [k for k in self._pools if k > fits]
        grow = rng.random() < settings.growth_share
        length = max(too_long) if too_long and not grow and rng.random() < 0.5 else fits
        pool = self._pools[length]
        origin = pool[min(int(rng.exponential(len(pool) / 3.0)), len(pool) - 1)]
        rows = origin.flight.itinerary.rows
        # Bodies at which tours have to start or end are not replaced.
        first, last = self._fixed[0], length - 1 - self._fixed[1]
        free = last - first + 1
        # A tour grows at an end that is mostly its own.
        n_new = min(
            int(rng.geometric(0.4)) - 1 if grow else int(rng.integers(1, max(free, 2))), free - 1
        )
        at_start = rng.random() < 0.35
        more = int(grow)
        if at_start:
            extension = Extension(first + n_new, length - 1, n_new + more, 0)
            removed = rows[first : first + n_new]
        else:
            extension = Extension(0, last - n_new, 0, n_new + more)
            removed = rows[last + 1 - n_new : last + 1]
        avoid = removed[rng.random(len(removed)) < settings.avoid_share]
        base = settings.extension
        varied = ExtensionSettings(
            width=max(2, round(base.width * rng.uniform(0.5, 1.5))),
            neighbours=base.neighbours,
            predicted=base.predicted,
            results=base.results,
            tofs_days=base.tofs_days,
            reference_tof_days=base.reference_tof_days * rng.uniform(0.75, 1.35),
            propellant_days_per_kg=base.propellant_days_per_kg * 2.0 ** rng.uniform(-1.5, 0.5),
        )
        return _Move(origin, extension, avoid, varied, grow)
