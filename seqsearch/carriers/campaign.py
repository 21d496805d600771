"""`Campaign`: the whole search for a mother ship's flight and the tours of her probes.

Stages: chart all legs; rate plans that keep to one orbit, roughly and then better; look for second
orbits, and for third ones; rate the best with wide beams, and variations of them; find the tours
of all probes for those; improve the best crews. What each stage found is kept in a
`CampaignState`.
"""

import functools
import pickle
import time
from collections.abc import Callable, Hashable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Any, Final, final

import numpy as np

from feasibility.runtime.cluster import shared
from seqsearch.carriers.chains import chained_plans
from seqsearch.carriers.chart_files import has_chart, write_chart
from seqsearch.carriers.crew import Crew
from seqsearch.carriers.flight import carrier_of
from seqsearch.carriers.homing import HomingSettings
from seqsearch.carriers.improving import improved, manned
from seqsearch.carriers.leg_chart import ChartPart
from seqsearch.carriers.plans import Plan, Screen
from seqsearch.carriers.state_files import CampaignState
from seqsearch.carriers.varying import varied
from seqsearch.deadline import Deadline
from seqsearch.problems.rendezvous import RendezvousProblem
from seqsearch.tours.carrier.records import CarrierRules

_ROUGH: Final = HomingSettings(width=40, results=1, thorough=False)
_BETTER: Final = HomingSettings(width=300, results=1)
_WIDE: Final = HomingSettings(width=1500, results=1)
_CREWS: Final = HomingSettings(width=2000, results=12)
"""Beams that rate plans, in three stages, and those that find crews."""

_KEPT_PLANS: Final = 5000
"""Plans that are kept of each stage."""

_BATCHES: Final = (60, 12, 12, 1, 2)
"""Plans in a task of each stage that rates: a task takes half a second and more."""

_SHARES: Final = (0.12, 0.2, 0.27, 0.42, 0.5)
_VARIED_SHARE: Final = 0.64
_MANNED_SHARE: Final = 0.78
"""Shares of a time limit after which the stages before improving end."""

_PARENTS: Final = 25.0
"""How far down the best plans those that are varied are, in the mean."""


@final
@dataclass(frozen=True)
class CampaignSettings:
    """How much is done in each stage; under a time limit less of it, or more of the last.

    Attributes
    ----------
    rated, sifted : int
        Plans with one orbit that are rated roughly, and better.
    continued, chained : int
        Plans for which second orbits are looked for, and third ones.
    judged : int
        Plans that are rated with wide beams.
    varied : int
        Variations of these that are rated so, too; they count as judged.
    manned : int
        Plans for which the tours of all probes are found.
    improvements : int
        Attempts to improve a crew, where there is no time limit.
    kept : int
        Crews that are improved.
    crews : HomingSettings
        Beams that find the tours.
    launch_share : float
        Share of the launch window that is looked at; where it lies depends on the seed.
    """

    rated: int = 100_000
    sifted: int = 4000
    continued: int = 150
    chained: int = 300
    judged: int = 900
    varied: int = 3000
    manned: int = 150
    improvements: int = 400
    kept: int = 6
    crews: HomingSettings = _CREWS
    launch_share: float = 1.0


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
        self._probes = screen.rules.craft_count
        self._settings = settings
        self._executor = executor
        self._at_once = max(2, 2 * workers)
        self._on_step = on_step
        self._common: Any = executor and shared(executor, pickle.dumps(self._context))

    def run(self, state: CampaignState) -> None:
        """Go on from a state to the end, or until the time is up."""
        self._begin = time.monotonic() - state.spent_s
        self._limit_s = state.limit_s
        self._chart(state)
        for stage in (
            self._rate,
            self._continue,
            self._chain,
            self._judge,
            self._vary,
            self._man,
            self._improve,
        ):
            stage(state)

    def _chart(self, state: CampaignState) -> None:
        """Ask about all legs, if that has not been done."""
        screen = self._context.screen
        if has_chart(screen.chart_folder):
            return
        count = screen.chart_intervals()
        parts = []
        for part in self._all(_charted, [(k,) for k in range(count + 1)]):
            parts.append(part)
            if len(parts) % 10 == 0:
                self._report(state, f"{len(parts)} of {count + 1} intervals charted")
        chart = screen.chart(parts)
        write_chart(chart, screen.chart_folder)
        self._report(state, f"{len(chart.rows)} bodies and {len(chart.target)} pairs on the chart")

    def _rate(self, state: CampaignState) -> None:
        """Rate plans that keep to one orbit: all of them roughly, the best of them better."""
        settings, rng = self._settings, np.random.default_rng([state.seed, 0])
        offset = float(rng.uniform(0.0, 1.0))
        if not _is_over(state, 0):
            plans = self._context.screen.candidates(offset)
            some = rng.permutation(len(plans))[: settings.rated]
            plans = [plans[k] for k in some]
            self._stage(state, 0, plans, state.rated, _rating(_ROUGH, 1), "rated")
        better = _rating(_BETTER, self._probes)
        self._stage(state, 1, state.rated[: settings.sifted], state.sifted, better, "rated again")

    def _continue(self, state: CampaignState) -> None:
        """Look for second orbits, for the best plan of each first one."""
        best = _different(state.sifted)[: self._settings.continued]
        plans: list[Plan] = []
        if not _is_over(state, 2):
            for others in self._all(_continued, [(plan,) for plan in best]):
                plans += others
        better = _rating(_BETTER, self._probes)
        self._stage(state, 2, plans, state.continued, better, "continued")

    def _chain(self, state: CampaignState) -> None:
        """Look for third orbits, for the best plan of each first one."""
        best = _best_of_first([*state.continued, *state.sifted])[: self._settings.chained]
        self._stage(state, 3, best, state.chained, _chained, "chained")

    def _judge(self, state: CampaignState) -> None:
        """Rate the best with wide beams."""
        plans = _different([*state.chained, *state.continued, *state.sifted])
        wide = _rating(_WIDE, self._probes)
        self._stage(state, 4, plans[: self._settings.judged], state.judged, wide, "judged")

    def _stage(
        self,
        state: CampaignState,
        stage: int,
        plans: Sequence[Plan],
        found: list[Plan],
        rate: "_Rate",
        name: str,
    ) -> None:
        """Rate plans from where the stage is, keep the best."""
        if _is_over(state, stage):
            return
        deadline, size = self._until(_SHARES[stage]), _BATCHES[stage]
        while state.looked[stage] < len(plans):
            if deadline.passed() and found:
                return
            first = state.looked[stage]
            batches = [
                plans[at : at + size]
                for at in range(first, first + size * self._at_once, size)
                if at < len(plans)
            ]
            for valued in self._all(_valued, [(batch, rate) for batch in batches]):
                found += [plan for plan in valued if plan.value > 0.0]
            state.looked[stage] += sum(map(len, batches))
            found.sort(key=lambda plan: -plan.value)
            del found[_KEPT_PLANS:]
            best = found[0].value if found else 0.0
            line = f"{state.looked[stage]} of {len(plans)} plans {name}, best {best:.2f}"
            self._report(state, line)

    def _vary(self, state: CampaignState) -> None:
        """Rate variations of the best plans, and of what has come of that."""
        deadline = self._until(_VARIED_SHARE)
        while state.judged and not state.manned and state.varied < self._settings.varied:
            if deadline.passed():
                return
            moves = []
            for number in range(state.varied, state.varied + 2 * self._at_once):
                rng = np.random.default_rng([state.seed, 3, number])
                plan = state.judged[min(int(rng.exponential(_PARENTS)), len(state.judged) - 1)]
                moves.append((plan, int(rng.integers(1 << 31))))
            batches = [moves[k : k + 2] for k in range(0, len(moves), 2)]
            for plans in self._all(_varied, [(batch,) for batch in batches]):
                state.judged += [plan for plan in plans if plan.value > 0.0]
            state.varied += len(moves)
            state.judged = _different(state.judged)[:_KEPT_PLANS]
            best = state.judged[0].value
            self._report(state, f"{state.varied} variations looked at, best {best:.2f}")

    def _man(self, state: CampaignState) -> None:
        deadline = self._until(_MANNED_SHARE)
        plans = state.judged[: self._settings.manned]
        while state.manned < len(plans):
            if deadline.passed() and state.crews:
                return
            chunk = plans[state.manned : state.manned + self._at_once]
            for crew in self._all(_manned, [(plan, self._settings.crews) for plan in chunk]):
                self._keep(state, crew)
            state.manned += len(chunk)
            self._report(state, f"{state.manned} crews looked for, {_told(state)}")

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


def launches_of(rules: CarrierRules, state: CampaignState) -> tuple[float, float]:
    """Return the launches that are looked at: a share of the window, moved by the seed."""
    first, last = rules.launch_mjd2000
    days = state.launch_share * (last - first)
    at = float(np.random.default_rng([state.seed, 2]).uniform(0.0, 1.0))
    begin = first + at * (last - first - days)
    return begin, begin + days


def _is_over(state: CampaignState, stage: int) -> bool:
    """Tell whether a later stage has begun; then none goes back to this one."""
    return any(state.looked[stage + 1 :]) or state.varied > 0 or state.manned > 0


def _charted(context: _Context, k: int) -> ChartPart:
    return context.screen.chart_part(k)


def _continued(context: _Context, plan: Plan) -> list[Plan]:
    return context.screen.continued(plan)


_Rate = Callable[[Screen, Plan], list[Plan]]
"""Gives what becomes of a plan: itself with a value, or plans that go on from it."""


def _rating(beams: HomingSettings, probes: int) -> _Rate:
    return functools.partial(_with_value, beams=beams, probes=probes)


def _with_value(screen: Screen, plan: Plan, *, beams: HomingSettings, probes: int) -> list[Plan]:
    return [screen.valued(plan, beams, probes)]


def _chained(screen: Screen, plan: Plan) -> list[Plan]:
    return chained_plans(screen, plan, _BETTER)


def _varied(context: _Context, moves: Sequence[tuple[Plan, int]]) -> list[Plan]:
    return [found for plan, seed in moves for found in varied(context.screen, plan, seed, _WIDE)]


def _valued(context: _Context, plans: Sequence[Plan], rate: _Rate) -> list[Plan]:
    return [found for plan in plans for found in rate(context.screen, plan)]


def _manned(context: _Context, plan: Plan, settings: HomingSettings) -> Crew | None:
    return manned(context.screen, context.problem, plan, settings)


def _improved(context: _Context, crew: Crew, number: int, seed: int) -> Crew | None:
    return improved(context.screen, context.problem, crew, number, seed)


@functools.lru_cache(maxsize=1)
def _unpacked(context: bytes) -> _Context:
    unpacked = pickle.loads(context)
    assert isinstance(unpacked, _Context)
    return unpacked


def _there(context: bytes, task: Callable[..., Any], call: tuple[Any, ...]) -> Any:
    return task(_unpacked(context), *call)


def _different(plans: list[Plan]) -> list[Plan]:
    """Return plans of different orbits, best first."""
    return _best_by(plans, lambda plan: (plan.orbits, plan.ends))


def _best_of_first(plans: list[Plan]) -> list[Plan]:
    """Return plans of different first orbits, best first."""
    return _best_by(plans, lambda plan: plan.first)


def _best_by(plans: list[Plan], kind: Callable[[Plan], Hashable]) -> list[Plan]:
    seen: set[Hashable] = set()
    chosen = []
    for plan in sorted(plans, key=lambda plan: -plan.value):
        if kind(plan) not in seen:
            seen.add(kind(plan))
            chosen.append(plan)
    return chosen


def _told(state: CampaignState) -> str:
    if not state.crews:
        return "none that a mother ship can serve"
    best = state.crews[0]
    return f"best {best.visits()} asteroids, {best.slack_days():.0f} days left"
