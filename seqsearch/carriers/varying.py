"""Variations of plans: other orbits near those of a good one, other windows, other ends.

What makes a plan good are the asteroids around its orbits, so that plans with near orbits are good
as well, and some of them are better.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import permutations
from typing import Final

import numpy as np

from seqsearch.carriers.chains import HOPEFUL, RETURN_DAYS, left_kg
from seqsearch.carriers.homing import HomingSettings
from seqsearch.carriers.mother import change_costs, next_orbits
from seqsearch.carriers.plans import Plan, Screen

_ORBIT: Final = 0.5
_WINDOWS: Final = 0.4
_ONE_END: Final = 0.4
"""Shares of variations with another orbit and with other windows, of the probes with one end
or of all; the rest change an end."""

_TRIED: Final = 8
"""Other orbits that are drawn until one can be flown to."""

_DEARER: Final = 150.0
_APART: Final = 1000.0
"""m/s that another change of orbit may cost more; how far another single orbit may be from one."""

_SHIFT_DAYS: Final = 120.0
"""Most by which windows are moved."""

_LEAST_KG: Final = 50.0
"""Propellant that has to be left: tours shorten the time for a change."""


def varied(screen: Screen, plan: Plan, seed: int, settings: HomingSettings) -> list[Plan]:
    """Return a variation of a plan with its value; none where she cannot fly it.

    Parameters
    ----------
    screen : Screen
        Rates it.
    plan : Plan
        What is varied.
    seed : int
        Says how.
    settings : HomingSettings
        Of the beams.
    """
    found = next(variations(screen, plan, np.random.default_rng(seed)), None)
    return [] if found is None else [screen.valued(found, settings, len(found.ends))]


def variations(screen: Screen, plan: Plan, rng: np.random.Generator) -> Iterator[Plan]:
    """Yield variations of a plan, all in the same respect, that she may be able to fly."""
    kind = rng.random()
    if kind < _ORBIT:
        others: Iterable[Plan] = _other_orbits(screen, plan, rng)
    elif kind < _ORBIT + _WINDOWS:
        others = [_other_windows(plan, rng)]
    else:
        others = _other_ends(plan, rng)
    return (other for other in others if _can_be_flown(screen, other))


def _other_orbits(screen: Screen, plan: Plan, rng: np.random.Generator) -> Iterator[Plan]:
    """Yield plans with another orbit in one's place, from which or to which she can go."""
    place = int(rng.integers(len(plan.orbits)))
    begin, most = plan.begin_mjd2000, _APART
    at, between = plan.first, (begin, begin + RETURN_DAYS)
    if len(plan.orbits) > 1:
        # Between two orbits it costs nearly the same in both directions.
        at = plan.orbits[place - 1 if place else 1]
        between = _changes(plan)[max(place - 1, 0)]
        now = np.array([plan.orbits[place]])
        most = _DEARER + float(change_costs(screen.catalogue, at, now, between)[0])
    near, _ = next_orbits(screen.catalogue, at, between, most)
    for row in rng.permutation(near[~np.isin(near, plan.orbits)])[:_TRIED]:
        orbits = list(plan.orbits)
        orbits[place] = int(row)
        yield replace(plan, orbits=tuple(orbits))


def _other_windows(plan: Plan, rng: np.random.Generator) -> Plan:
    """Return a plan with windows moved: all of them, or those of the probes with one end."""
    days = float(rng.uniform(-_SHIFT_DAYS, _SHIFT_DAYS))
    moved = {int(rng.choice(plan.ends))} if rng.random() < _ONE_END else set(plan.ends)
    windows = tuple(
        (begin + days, last + days) if end in moved else (begin, last)
        for (begin, last), end in zip(plan.windows_mjd2000, plan.ends, strict=True)
    )
    return replace(plan, windows_mjd2000=windows)


def _other_ends(plan: Plan, rng: np.random.Generator) -> Iterator[Plan]:
    """Yield plans in which one probe has the end and the window of another one.

    Probes for earlier orbits stay before those for later ones.
    """
    for number, other in rng.permutation(list(permutations(range(len(plan.ends)), 2))):
        probes = list(zip(plan.ends, plan.windows_mjd2000, strict=True))
        probes[number] = probes[other]
        ends, windows = zip(*sorted(probes), strict=True)
        if plan.ends != ends and set(ends) == set(plan.ends):
            yield replace(plan, ends=ends, windows_mjd2000=windows)


def _can_be_flown(screen: Screen, plan: Plan) -> bool:
    """Tell whether the mother ship may have enough propellant for a plan."""
    if plan.begin_mjd2000 < screen.launch_mjd2000[0]:
        return False
    route = screen.route(plan)
    if route is None:
        return False
    return left_kg(screen, plan, route, _changes(plan), HOPEFUL) >= _LEAST_KG


def _changes(plan: Plan) -> list[tuple[float, float]]:
    """Return the earliest departure and the latest arrival of each change of orbit."""
    changes = []
    for orbit in range(1, len(plan.orbits)):
        pairs = list(zip(plan.windows_mjd2000, plan.ends, strict=True))
        caught = [window[0] + RETURN_DAYS for window, end in pairs if end < orbit]
        here = [window for window, end in pairs if end == orbit]
        arrives = max(window[1] if orbit > 1 else window[0] for window in here) + RETURN_DAYS
        changes.append((max([plan.last_mjd2000, *caught]), arrives))
    return changes
