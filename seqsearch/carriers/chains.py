"""Plans with a third orbit: `chained_plans` finds them, `later_window` says when probes leave.

She goes on from the second orbit once a probe or two have been caught there, and catches the rest
on a third one: one more asteroid at which a probe can stay. The probes for the third orbit are
released later, so that she has time for both changes.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from seqsearch.carriers.homing import HomingSettings
from seqsearch.carriers.mother import change_costs, next_orbits
from seqsearch.carriers.plans import Plan, Screen
from seqsearch.carriers.routes import Route
from seqsearch.tours.carrier.path import mass_after

_LATER_DAYS: Final = 1000.0
_EARLY_DAYS: Final = 250.0
_LATE_DAYS: Final = 300.0
"""Latest departure of probes for the third orbit after the first probe's earliest one; lengths of
the windows of probes for the second and for the third orbit."""

_LEAST_LATER_DAYS: Final = 700.0
"""Less than that is too little time for the second change."""

RETURN_DAYS: Final = 2160.0
"""Time from a release to the capture, at which she has to be there."""

_PROBE_KG: Final = 850.0
"""Mass of a probe that is caught."""

_SHIFTS_DAYS: Final = (-200.0, 0.0, 200.0)
"""Beginnings of the windows that are tried, after that of a plan with fewer orbits."""

HOPEFUL: Final = 1.04
"""Changes may be that much too dear: with impulses at the best time they cost less."""

_MOST: Final = 80
"""Second orbits that are gone on from."""

_RATED: Final = 16
_KEPT: Final = 8
"""Chains that are rated for all probes, by the sum of their ends' ratings, and kept."""


@final
@dataclass(frozen=True)
class _Chain:
    second: int
    third: int
    window_mjd2000: float
    later_days: float

    def plan(self, first: int, ends: tuple[int, ...]) -> Plan:
        """Return the plan of a chain, by the orbits on which the probes are caught."""
        begin = self.window_mjd2000
        late = begin + self.later_days
        windows = tuple(
            (begin, begin + _EARLY_DAYS) if end == 1 else (late - _LATE_DAYS, late) for end in ends
        )
        return Plan((first, self.second, self.third), ends, windows)


def chained_plans(screen: Screen, plan: Plan, settings: HomingSettings) -> list[Plan]:
    """Return the best plans with three orbits, of which the first is a plan's, with their values.

    Parameters
    ----------
    screen : Screen
        Rates them.
    plan : Plan
        With fewer orbits; its first one and the beginning of its windows count.
    settings : HomingSettings
        Of the beams.
    """
    count = screen.rules.craft_count
    if count < 2:
        return []
    chains = [chain for shift in _SHIFTS_DAYS for chain in _chains(screen, plan, shift)]
    worth: dict[tuple[int, float, bool], float] = {}

    def rated(chain: _Chain, end: int) -> float:
        """Return the value of one probe's tour, to one of the two orbits."""
        row = chain.second if end == 1 else chain.third
        key = row, chain.window_mjd2000, end == 1
        if key not in worth:
            one = chain.plan(plan.first, (end,))
            worth[key] = screen.valued(one, settings, 1).value
        return worth[key]

    ways = [(1,) * k + (2,) * (count - k) for k in range(1, count)]
    choices = [
        (sum(rated(chain, end) for end in ends), chain, ends) for chain in chains for ends in ways
    ]
    choices.sort(key=lambda choice: -choice[0])
    plans = [
        screen.valued(chain.plan(plan.first, ends), settings, count)
        for _, chain, ends in choices[:_RATED]
    ]
    return sorted(plans, key=lambda plan: -plan.value)[:_KEPT]


def _chains(screen: Screen, plan: Plan, shift_days: float) -> Iterator[_Chain]:
    """Yield the second and third orbits that she can get to."""
    begin = plan.begin_mjd2000 + shift_days
    later = _LATER_DAYS
    route = _route(screen, plan.first, begin, later)
    if route is None:
        later = _LEAST_LATER_DAYS
        route = _route(screen, plan.first, begin, later)
    if route is None:
        return
    rules, orbits = screen.rules, screen.catalogue
    exhaust = rules.isp_s * rules.g0_m_s2
    alone = mass_after(rules, rules.m0_kg, route.delta_v)
    alone -= rules.craft_count * rules.craft.m0_kg
    if alone <= rules.m_dry_kg:
        return
    seconds, costs = next_orbits(
        orbits,
        plan.first,
        (begin + later, begin + RETURN_DAYS),
        HOPEFUL * exhaust * float(np.log(alone / rules.m_dry_kg)),
    )
    for second, cost in zip(seconds[:_MOST], costs[:_MOST], strict=True):
        mass = mass_after(rules, alone, float(cost) / HOPEFUL) + _PROBE_KG
        left = exhaust * float(np.log(mass / (rules.m_dry_kg + _PROBE_KG)))
        if left <= 0.0:
            continue
        between = begin + RETURN_DAYS, begin + later + RETURN_DAYS
        for third in next_orbits(orbits, int(second), between, HOPEFUL * left)[0]:
            if third != plan.first:
                yield _Chain(int(second), int(third), begin, later)


def _route(screen: Screen, first: int, begin: float, later_days: float) -> Route | None:
    window = (begin, begin + later_days)
    return screen.route(Plan((first,), (0,), (window,)))


_TOUR_DAYS: Final = 2060.0
"""From a departure to the capture, if a tour is short."""

_WINDOW_STEP_DAYS: Final = 50.0
_SHORT_KG: Final = 40.0
"""Propellant that may be missing: impulses at the best time save that much."""


def later_window(
    screen: Screen,
    plan: Plan,
    number: int,
    releases_mjd2000: Sequence[float],
    captures_mjd2000: Sequence[float],
) -> tuple[float, float]:
    """Return when a probe for the third orbit had best leave, if those for the second are known.

    The later it leaves the less time there is for the first change of orbit, and the more for the
    second one.

    Parameters
    ----------
    screen : Screen
        Knows the way to the first orbit.
    plan : Plan
        With three orbits.
    number : int
        The probe.
    releases_mjd2000, captures_mjd2000 : sequence of float
        Of the probes for the second orbit.

    Returns
    -------
    tuple of float
        Earliest and latest departure in MJD2000; those of the plan where none is good.
    """
    begin, end = plan.windows_mjd2000[number]
    route = screen.route(plan)
    if route is None:
        return begin, end
    released, first, last = max(releases_mjd2000), min(captures_mjd2000), max(captures_mjd2000)
    latest = route.launch_mjd2000 + screen.rules.max_duration_days - screen.duration_days
    epochs = np.arange(begin - _LATE_DAYS, latest, _WINDOW_STEP_DAYS)
    missing = np.full(len(epochs), np.inf)
    for k, epoch in enumerate(epochs):
        changes = (max(released, epoch), first), (last, epoch + _TOUR_DAYS)
        if min(after - before for before, after in changes) >= _WINDOW_STEP_DAYS:
            missing[k] = -left_kg(screen, plan, route, changes)
    if not np.isfinite(missing).any():
        return begin, end
    good = epochs[missing <= max(_SHORT_KG, float(missing.min()) + _SHORT_KG)]
    return float(good[0]), float(max(good[-1], good[0] + _WINDOW_STEP_DAYS))


def left_kg(
    screen: Screen,
    plan: Plan,
    route: Route,
    changes_mjd2000: Sequence[tuple[float, float]],
    hopeful: float = 1.0,
) -> float:
    """Return the propellant that a mother ship has left at the end; negative for what is missing.

    Parameters
    ----------
    screen : Screen
        Knows bodies and rules.
    plan : Plan
        Her orbits, and on which of them probes are caught.
    route : Route
        To the first one.
    changes_mjd2000 : sequence of tuple of float
        Earliest departure and latest arrival of each change of orbit.
    hopeful : float
        By what factor changes may cost less than Lambert arcs on a rough grid.
    """
    rules = screen.rules
    mass = mass_after(rules, rules.m0_kg, route.delta_v) - rules.craft_count * rules.craft.m0_kg
    for orbit, (begin, end) in enumerate(changes_mjd2000):
        if mass <= rules.m_dry_kg or end <= begin:
            return -np.inf
        aboard = _PROBE_KG * sum(end_ <= orbit for end_ in plan.ends)
        goal = np.array([plan.orbits[orbit + 1]])
        cost = float(change_costs(screen.catalogue, plan.orbits[orbit], goal, (begin, end))[0])
        if not np.isfinite(cost):
            return -np.inf
        mass = mass_after(rules, mass + aboard, cost / hopeful) - aboard
    return mass - rules.m_dry_kg
