"""How a crew is found for a plan, and one attempt to improve it."""

from typing import Final

import numpy as np

from seqsearch.carriers.crew import (
    Crew,
    find_crew,
    find_probe,
    polished_probe,
    rebuilt_probe,
    repaired_probe,
)
from seqsearch.carriers.flight import carrier_of
from seqsearch.carriers.homing import HomingSettings
from seqsearch.carriers.joint import Wishes, joined, joined_crew
from seqsearch.carriers.plans import RELEASES_DAYS, Plan, Screen
from seqsearch.carriers.varying import variations
from seqsearch.polish.flight import Flight
from seqsearch.problems.rendezvous import RendezvousProblem

_TWO_ANEW: Final = 0.2
_ANEW: Final = 0.2
_REBUILT: Final = 0.2
_REPAIRED: Final = 0.3
"""Shares of attempts to improve; the rest are polished."""

_JOINED: Final = (0.25, 0.08)
"""Share of attempts before them that polish all at once: for a crew that has not been, and has."""

_REPLANNED: Final = 0.25
"""Share of the others that vary the plan."""

_WIDTHS: Final = (300.0, 5000.0)
"""Widths of beams that improve a tour."""


def manned(
    screen: Screen, problem: RendezvousProblem, plan: Plan, settings: HomingSettings
) -> Crew | None:
    """Return the tours of a plan's probes, polished with the mother ship where she needs that.

    None where there are too few tours, or no mother ship can serve them.
    """
    return _served(screen, problem, find_crew(screen, problem, plan, settings))


def _served(screen: Screen, problem: RendezvousProblem, crew: Crew) -> Crew | None:
    """Return a crew that a mother ship can serve; polished with her where she needs that."""
    if len(crew.flights) < len(crew.plan.ends):
        return None
    if carrier_of(screen, crew) is not None:
        return crew
    wishes = Wishes((1.0,) * len(crew.flights))
    return joined(screen, problem, crew, wishes, rng=np.random.default_rng(0))


def replanned(
    screen: Screen,
    problem: RendezvousProblem,
    crew: Crew,
    number: int,
    rng: np.random.Generator,
    settings: HomingSettings,
) -> Crew | None:
    """Return a crew of a varied plan, with new tours where the old ones do not fit; None for none.

    That of one probe is new in any case.
    """
    plan = next(variations(screen, crew.plan, rng), None)
    if plan is None:
        return None
    kept = {
        k: flight
        for k, flight in enumerate(crew.flights)
        if crew.course is None and k != number and _fits(flight, plan, k)
    }
    return _served(screen, problem, find_crew(screen, problem, plan, settings, kept))


def _fits(flight: Flight, plan: Plan, number: int) -> bool:
    """Tell whether a tour is one of a plan's probe."""
    rows, begin = flight.itinerary.rows, float(flight.itinerary.t_dep_mjd2000[0])
    first, last = plan.windows_mjd2000[number]
    ends = int(rows[0]) == plan.first and int(rows[-1]) == plan.end(number)
    return ends and first <= begin <= last and not set(rows[1:-1].tolist()) & set(plan.orbits)


def improved(
    screen: Screen, problem: RendezvousProblem, crew: Crew, number: int, seed: int
) -> Crew | None:
    """Look for a better crew in one of several ways that the seed draws; None where there is none.

    One probe or two are looked for anew, one is rebuilt from some visit on, repaired or polished
    by exchanges; the plan is varied; or the mother ship and all probes are polished together.
    """
    rng = np.random.default_rng(seed)
    if rng.random() < _JOINED[crew.course is not None]:
        return joined_crew(screen, problem, crew, rng)
    settings = HomingSettings(
        width=int(np.exp(rng.uniform(*np.log(_WIDTHS)))),
        propellant_weight=float(rng.uniform(0.1, 0.6)),
        distance_weight=float(rng.uniform(0.05, 0.5)),
        results=int(rng.integers(2, 12)),
    )
    weights, offset = (settings.propellant_weight,), float(rng.uniform(0.0, RELEASES_DAYS))
    if rng.random() < _REPLANNED:
        return replanned(screen, problem, crew, number, rng, settings)
    kind = rng.random()
    if kind < _TWO_ANEW:
        other = int((number + rng.integers(1, len(crew.flights))) % len(crew.flights))
        closed = crew.closed(number, other)
        for probe in (other, number):
            found = find_probe(screen, problem, crew, probe, closed, settings, offset, weights)
            if found is None:
                return None
            crew = crew.with_flight(probe, found)
            closed = crew.closed(number)
        return crew
    if kind < _TWO_ANEW + _ANEW:
        closed = crew.closed(number)
        flight = find_probe(screen, problem, crew, number, closed, settings, offset, weights)
    elif kind < _TWO_ANEW + _ANEW + _REBUILT:
        kept = int(rng.integers(1, len(crew.flights[number].itinerary) - 2))
        flight = rebuilt_probe(screen, problem, crew, number, kept, settings)
    elif kind < _TWO_ANEW + _ANEW + _REBUILT + _REPAIRED:
        flight = repaired_probe(screen, problem, crew, number, rng)
    else:
        flight = polished_probe(problem, screen.predictor, crew, number, seed)
    return None if flight is None else crew.with_flight(number, flight)
