"""`Campaign`: the whole search for a mother ship's flight and the tours of her probes.

Stages: rate orbits, look for second orbits, find the tours of all probes for the best plans,
improve those of the best crew. What each stage found is kept in a `CampaignState`.
"""

import functools
import pickle
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from typing import Any, Final, final

import numpy as np

from feasibility.runtime.cluster import shared
from seqsearch.carriers.crew import (
    Crew,
    find_crew,
    find_probe,
    own_problem,
    polished_probe,
    rebuilt_probe,
)
from seqsearch.carriers.flight import carrier_of
from seqsearch.carriers.homing import HomingSettings
from seqsearch.carriers.plans import Plan, Screen
from seqsearch.deadline import Deadline
from seqsearch.problems.rendezvous import RendezvousProblem

_NARROW: Final = 40
"""Width of the beams that rate plans."""

_WIDE: Final = 150
_ANEW: Final = 0.25
_REBUILT: Final = 0.5
"""Width of the beams that improve a tour, about; shares of attempts; the rest are polished."""

_SHARES: Final = (0.25, 0.4, 0.6)
"""Shares of a time limit after which the stages before improving end."""


@final
@dataclass(frozen=True)
class CampaignSettings:
    """How much is done in each stage; under a time limit less of it, or more of the last.

    Attributes
    ----------
    bodies : int
        Asteroids whose orbits are rated.
    pairs : int
        Plans for which second orbits are looked for.
    crews : int
        Plans for which the tours of all probes are found.
    width : int
        Width of the beams that find them.
    improvements : int
        Attempts to improve a crew, where there is no time limit.
    kept : int
        Crews that are improved.
    """

    bodies: int = 400
    pairs: int = 30
    crews: int = 12
    width: int = 150
    improvements: int = 60
    kept: int = 4


@final
@dataclass
class CampaignState:
    """What has been found, to go on from.

    Attributes
    ----------
    seed : int
        Varies the release windows and the attempts to improve.
    limit_s : float, optional
        Wall-clock time of all sessions; None for no limit.
    catalogue_sha256 : str
        Which asteroid table it is.
    rated, paired : list of Plan
        Plans with one orbit, and with two.
    looked : int
        Bodies that were rated.
    joined : int
        Rated plans for which second orbits were looked for.
    manned : int
        Paired plans for which crews were found.
    tried : int
        Attempts to improve.
    crews : list of Crew
        The best, of different plans, best first.
    spent_s : float
        Wall-clock time.
    """

    seed: int = 0
    limit_s: float | None = None
    catalogue_sha256: str = ""
    rated: list[Plan] = field(default_factory=list)
    paired: list[Plan] = field(default_factory=list)
    looked: int = 0
    joined: int = 0
    manned: int = 0
    tried: int = 0
    crews: list[Crew] = field(default_factory=list)
    spent_s: float = 0.0


@final
@dataclass(frozen=True, eq=False)
class _Context:
    """What all tasks have in common."""

    screen: Screen
    problem: RendezvousProblem


@final
class Campaign:
    """Runs the stages.

    Parameters
    ----------
    screen : Screen
        Rates plans.
    problem : RendezvousProblem
        One probe.
    settings : CampaignSettings
        How much.
    executor : Executor, optional
        Where tasks are done; default: this process.
    workers : int
        How many at a time.
    on_step : callable
        Called with a line that says what happened, whenever the state has changed.
    """

    def __init__(
        self,
        screen: Screen,
        problem: RendezvousProblem,
        *,
        settings: CampaignSettings,
        executor: Executor | None,
        workers: int,
        on_step: Callable[[CampaignState, str], None],
    ) -> None:
        self._context = _Context(screen, problem)
        self._settings = settings
        self._executor = executor
        self._at_once = max(2, 2 * workers)
        self._on_step = on_step
        self._common: Any = executor and shared(executor, pickle.dumps(self._context))

    def run(self, state: CampaignState) -> None:
        """Go on from a state to the end, or until the time is up."""
        self._begin = time.monotonic() - state.spent_s
        self._limit_s = state.limit_s
        for stage in (self._rate, self._pair, self._man, self._improve):
            stage(state)

    def _rate(self, state: CampaignState) -> None:
        settings, deadline = self._settings, self._until(_SHARES[0])
        if state.looked >= settings.bodies or deadline.passed():
            return
        rows = self._context.screen.crowded(settings.bodies)
        offset = float(np.random.default_rng([state.seed, 0]).uniform(0.0, 1.0))
        while state.looked < len(rows) and not deadline.passed():
            chunk = rows[state.looked : state.looked + self._at_once]
            for plans in self._all(_rated, [(int(row), _NARROW, offset) for row in chunk]):
                state.rated += plans
            state.looked += len(chunk)
            state.rated.sort(key=lambda plan: -plan.value)
            best = state.rated[0].value if state.rated else 0.0
            self._report(state, f"{state.looked} orbits rated, best {best:.2f}")

    def _pair(self, state: CampaignState) -> None:
        deadline = self._until(_SHARES[1])
        screen = self._context.screen
        while state.joined < min(self._settings.pairs, len(state.rated)):
            plan = state.rated[state.joined]
            others = screen.continued(plan)
            for first in range(0, len(others), self._at_once):
                if deadline.passed():
                    return
                chunk = others[first : first + self._at_once]
                rated = self._all(_valued, [(other, _NARROW) for other in chunk])
                state.paired += [other for other in rated if other.value > 0.0]
            state.joined += 1
            state.paired.sort(key=lambda plan: -plan.value)
            best = state.paired[0].value if state.paired else 0.0
            self._report(state, f"{state.joined} plans continued, best {best:.2f}")

    def _man(self, state: CampaignState) -> None:
        deadline = self._until(_SHARES[2])
        plans = _different([*state.paired, *state.rated])
        while state.manned < min(self._settings.crews, len(plans)):
            if deadline.passed() and state.crews:
                return
            chunk = plans[state.manned : state.manned + self._at_once]
            wide = HomingSettings(width=self._settings.width)
            for crew in self._all(_manned, [(plan, wide) for plan in chunk]):
                self._keep(state, crew)
            state.manned += len(chunk)
            self._report(state, f"{state.manned} crews found, {_told(state)}")

    def _improve(self, state: CampaignState) -> None:
        settings, deadline = self._settings, self._until(1.0)
        while state.crews and not deadline.passed():
            if self._limit_s is None and state.tried >= settings.improvements:
                return
            moves = [self._move(state, state.tried + k) for k in range(self._at_once)]
            for crew in self._all(_improved, moves):
                self._keep(state, crew)
            state.tried += len(moves)
            self._report(state, f"{state.tried} attempts, {_told(state)}")

    def _move(self, state: CampaignState, number: int) -> tuple[Crew, int, int]:
        """Return a crew, one of its probes, and a seed for how that one is improved."""
        rng = np.random.default_rng([state.seed, 1, number])
        crew = state.crews[min(int(rng.exponential(0.8)), len(state.crews) - 1)]
        return crew, int(rng.integers(len(crew.flights))), int(rng.integers(1 << 31))

    def _keep(self, state: CampaignState, crew: Crew | None) -> None:
        """Put a crew among the best, one of each plan, if its mother ship can fly."""
        if crew is None:
            return
        same = [k for k, other in enumerate(state.crews) if other.plan.same(crew.plan)]
        if same and state.crews[same[0]].worth() >= crew.worth():
            return
        if carrier_of(self._context.screen, crew) is None:
            return
        for k in same:
            del state.crews[k]
        state.crews.append(crew)
        state.crews.sort(key=lambda crew: -crew.worth())
        del state.crews[self._settings.kept :]

    def _all(self, task: Callable[..., Any], calls: Sequence[tuple[Any, ...]]) -> Iterator[Any]:
        """Yield the results of a task in the order of its calls."""
        if self._executor is None:
            for call in calls:
                yield task(self._context, *call)
            return
        futures = [self._executor.submit(_there, self._common, task, call) for call in calls]
        for future in futures:
            yield future.result()

    def _until(self, share: float) -> Deadline:
        left = None if self._limit_s is None else share * self._limit_s - self._spent_s()
        return Deadline(left)

    def _spent_s(self) -> float:
        return time.monotonic() - self._begin

    def _report(self, state: CampaignState, line: str) -> None:
        state.spent_s = self._spent_s()
        self._on_step(state, line)


def _rated(context: _Context, row: int, width: int, offset: float) -> list[Plan]:
    return context.screen.rate(row, width, offset)


def _valued(context: _Context, plan: Plan, width: int) -> Plan:
    return context.screen.valued(plan, width)


def _manned(context: _Context, plan: Plan, settings: HomingSettings) -> Crew | None:
    count = context.screen.rules.craft_count
    crew = find_crew(context.screen, context.problem, plan, count, settings)
    return crew if len(crew.flights) == count else None


def _improved(context: _Context, crew: Crew, number: int, seed: int) -> Crew | None:
    """Look for a better tour of one probe: anew, from some visit on, or by exchanges."""
    screen, problem = context.screen, context.problem
    rng = np.random.default_rng(seed)
    settings = HomingSettings(
        width=int(_WIDE * rng.uniform(0.5, 3.0)),
        propellant_weight=float(rng.uniform(0.2, 1.5)),
        distance_weight=float(rng.uniform(0.05, 0.6)),
    )
    kind = rng.random()
    if kind < _ANEW:
        offset, closed = float(rng.uniform(0.0, 60.0)), crew.closed(number)
        weights = (settings.propellant_weight,)
        own = own_problem(problem, crew, number)
        flight = find_probe(screen, problem, crew.plan, closed, settings, offset, weights, own)
    elif kind < _ANEW + _REBUILT:
        kept = int(rng.integers(1, len(crew.flights[number].itinerary) - 2))
        flight = rebuilt_probe(screen, problem, crew, number, kept, settings)
    else:
        flight = polished_probe(problem, screen.predictor, crew, number, seed)
    return None if flight is None else crew.with_flight(number, flight)


@functools.lru_cache(maxsize=1)
def _unpacked(context: bytes) -> _Context:
    unpacked = pickle.loads(context)
    assert isinstance(unpacked, _Context)
    return unpacked


def _there(context: bytes, task: Callable[..., Any], call: tuple[Any, ...]) -> Any:
    return task(_unpacked(context), *call)


def _different(plans: list[Plan]) -> list[Plan]:
    """Return plans of different orbits, best first."""
    seen: set[tuple[int, int]] = set()
    chosen = []
    for plan in sorted(plans, key=lambda plan: -plan.value):
        if (plan.first, plan.second) not in seen:
            seen.add((plan.first, plan.second))
            chosen.append(plan)
    return chosen


def _told(state: CampaignState) -> str:
    if not state.crews:
        return "none that a mother ship can serve"
    best = state.crews[0]
    return f"best {best.visits()} asteroids, {best.slack_days():.0f} days left"
