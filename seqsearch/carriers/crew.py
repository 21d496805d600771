"""`Crew`: the tours of all probes of one mother ship, and how they are found.

One probe after another, each leaves its asteroids to none that follow; then each is looked for
again, with the others' asteroids closed.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from types import MappingProxyType
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.predictor import LegPredictor
from seqsearch.carriers.chains import later_window
from seqsearch.carriers.course import Course
from seqsearch.carriers.homing import Homecoming, HomingSettings
from seqsearch.carriers.plans import STAY_DAYS, Plan, Screen
from seqsearch.core.nodes import Nodes
from seqsearch.polish import PolishSettings, polish
from seqsearch.polish.flight import Flight, fly
from seqsearch.polish.itinerary import Itinerary
from seqsearch.polish.retiming import retime
from seqsearch.problems.rendezvous import RendezvousProblem

_Index = NDArray[np.intp]

TOUCH_DAYS: Final = 0.01
"""Flight time between the mother ship and the asteroid at which she is: they are together."""

STAY_MARGIN_DAYS: Final = 0.002
"""By how much stays exceed the shortest one, as epochs are rounded."""

WAIT_DAYS: Final = STAY_DAYS + TOUCH_DAYS + STAY_MARGIN_DAYS
"""What it costs a probe to stay at such an asteroid."""

MISSION_DAYS: Final = 2191.5
"""Longest time from a release to the capture."""

_ROUNDING_DAYS: Final = 1e-6

WEIGHTS: Final = (0.15, 0.25, 0.4)
"""Weights of propellant in the beams for one probe: which of them balances time and propellant
depends on the orbits."""

_POLISH: Final = PolishSettings(rounds=2, moves_per_round=4)
_ITERATIONS: Final = 12
_TRIED: Final = 6
"""Predicted tours of one number of visits of which the timetables are made good."""

_SHIFTS: Final = (-5.0, 5.0)
_SHIFTED: Final = np.arange(-60.0, 61.0, 10.0)
"""By how many days the departure of a repaired tour is moved."""

_REPAIR_WIDTH: Final = 600
_MOST_LOST: Final = 3
"""Width of the beams that repair tours, and the most visits that are replaced."""

_VISIT_DAYS: Final = 170.0
"""What a visit takes."""

_MOST_SHARES: Final = 1.7
_DAYS_WORTH: Final = 0.98
"""Up to how many times that count of what a probe has left; what they are worth if all probes have
them."""


@final
@dataclass(frozen=True, eq=False)
class Crew:
    """Tours from the first orbit of a plan to its others, each flown by the leg solver.

    Attributes
    ----------
    plan : Plan
        The orbits.
    flights : tuple of Flight
        One a probe. The first and the last row of each are orbits.
    course : Course, optional
        What the mother ship does in between; default: she releases all probes on the first orbit
        and catches them on those of the plan. On a course each probe has orbits of its own, which
        take the place of the asteroids' in `own_problem`.
    """

    plan: Plan
    flights: tuple[Flight, ...]
    course: Course | None = None

    def visits(self) -> int:
        """Return the asteroids that count, those of the orbits included."""
        return sum(len(flight.itinerary) - 1 for flight in self.flights) + sum(
            probe is not None for probe in self.waits()
        )

    def slack_days(self) -> float:
        """Return the days that all probes together have left."""
        return sum(MISSION_DAYS - flight.itinerary.duration_days for flight in self.flights)

    def mass_kg(self) -> float:
        """Return what is left of all probes."""
        return float(sum(flight.mass[-1] for flight in self.flights))

    def worth(self) -> float:
        """Return the visits, and what the days that are left after all stays are worth.

        Days of one probe are worth more than as many of two: a visit needs them together. More
        than a visit takes are worth more still, as hardly any tour has one for exactly that. All
        days together are worth less than a visit.
        """
        waits = self.waits()
        days = self._days_left(waits)
        shares = [min(max(left, 0.0) / _VISIT_DAYS, _MOST_SHARES) for left in days]
        best = max(len(shares), 1) * _MOST_SHARES**2
        return self.visits() + _DAYS_WORTH * sum(share**2 for share in shares) / best

    def _days_left(self, waits: Sequence[int | None]) -> list[float]:
        """Return the days that each probe has left if some stay at the orbits' asteroids."""
        left = [MISSION_DAYS - flight.itinerary.duration_days for flight in self.flights]
        for orbit, probe in enumerate(waits):
            if probe is not None:
                left[probe] -= self._wait_days(orbit)
        return left

    def closed(self, *but: int) -> tuple[int, ...]:
        """Return rows that probes visit, those of some probes left out."""
        return tuple(
            int(row)
            for number, flight in enumerate(self.flights)
            if number not in but
            for row in flight.itinerary.rows[1:-1]
        )

    def waits(self) -> tuple[int | None, ...]:
        """Return the probes that stay at the asteroids of all orbits.

        At that of the first one after its release, at the others before the capture. None where
        no probe has the time. On a course only those that it provides for.
        """
        course, plan = self.course, self.plan
        ways: list[list[int | None]] = [
            [k for k in range(len(self.flights)) if orbit in (0, plan.ends[k])]
            for orbit in range(len(plan.orbits))
        ]
        if course is not None:
            ways = [[stay] for stay in course.stays]
        best: tuple[int | None, ...] = (None,) * len(ways)
        value = (0, -np.inf)
        for probes in product(*[[*way, None] for way in ways]):
            left = self._days_left(probes)
            count = sum(probe is not None for probe in probes)
            if min(left, default=0.0) >= 0.0 and (count, min(left, default=0.0)) > value:
                best, value = probes, (count, min(left, default=0.0))
        return best

    def _wait_days(self, orbit: int) -> float:
        """Return what it costs to stay at an orbit's asteroid; inf where that is late."""
        course = self.course
        probe = None if course is None else course.stays[orbit]
        if course is None or probe is None:
            return WAIT_DAYS
        itinerary = self.flights[probe].itinerary
        begin, end = float(itinerary.t_dep_mjd2000[0]), float(itinerary.t_arr_mjd2000[-1])
        days = course.stay_epochs[orbit] - end if orbit else begin - course.stay_epochs[0]
        return days if days >= WAIT_DAYS - _ROUNDING_DAYS else np.inf

    def with_flight(self, number: int, flight: Flight) -> "Crew":
        """Return the crew with another tour of one probe."""
        flights = list(self.flights)
        flights[number] = flight
        return replace(self, flights=tuple(flights))


def own_problem(problem: RendezvousProblem, crew: Crew, number: int) -> RendezvousProblem:
    """Return the problem of one probe of a crew; on a course it has orbits of its own."""
    plan, course = crew.plan, crew.course
    allowed = plan.windows_mjd2000[number]
    if course is None:
        return replace(problem, first_departure_mjd2000=allowed)
    begin, end = course.window(course.starts[number])
    window = max(begin + TOUCH_DAYS, allowed[0]), end - TOUCH_DAYS
    # She may be there before the plan's window.
    departures = [float(f.itinerary.t_dep_mjd2000[0]) for f in crew.flights[number : number + 1]]
    return replace(
        problem,
        catalogue=course.catalogue_for(problem.catalogue, plan, number),
        first_departure_mjd2000=(min(*window, *departures), max(*window, *departures)),
    )


def find_probe(
    screen: Screen,
    problem: RendezvousProblem,
    crew: Crew,
    number: int,
    avoid: Sequence[int],
    settings: HomingSettings,
    offset_days: float = 0.0,
    weights: tuple[float, ...] = WEIGHTS,
) -> Flight | None:
    """Return the best tour of a probe of a crew that can be flown in time; None for none.

    Parameters
    ----------
    screen : Screen
        Runs the beams.
    problem : RendezvousProblem
        One probe.
    crew : Crew
        Its plan and its course count; on a course the probe leaves from its own coast.
    number : int
        Which probe.
    avoid : sequence of int
        Rows that it leaves alone.
    settings : HomingSettings
        Of the beams.
    offset_days : float
        By how much the departures that are tried are moved.
    weights : tuple of float
        Of the propellant: a beam each.
    """
    own, plan = own_problem(problem, crew, number), crew.plan
    if crew.course is not None:
        plan = plan.with_window(number, own.first_departure_mjd2000)
    tours = [
        tour
        for weight in weights
        for tour in screen.tours(
            plan, number, replace(settings, propellant_weight=weight), avoid, offset_days
        )
    ]
    return _best_fitted(own, tours, None)


def _best_fitted(
    problem: RendezvousProblem, tours: list[Homecoming], found: Flight | None
) -> Flight | None:
    """Return the best of predicted tours that can be flown in time, or what there is already."""
    different = {tuple(tour.itinerary.rows.tolist()): tour for tour in reversed(tours)}
    ordered = sorted(different.values(), key=lambda tour: (-tour.visits, tour.duration_days))
    tried: Counter[int] = Counter()
    for tour in ordered:
        if found is not None and tour.visits < len(found.itinerary) - 1:
            break
        tried[tour.visits] += 1
        if tried[tour.visits] > _TRIED:
            continue
        flight = fitted(problem, tour.itinerary)
        if flight is not None and (found is None or _better(flight, found)):
            found = flight
    return found


def rebuilt_probe(
    screen: Screen,
    problem: RendezvousProblem,
    crew: Crew,
    number: int,
    kept: int,
    settings: HomingSettings,
) -> Flight | None:
    """Return a better tour of a probe that keeps its first visits; None for none.

    Parameters
    ----------
    kept : int
        How many visits, at least one.
    """
    before = crew.flights[number]
    head = before.itinerary.part(0, kept)
    node = Nodes(
        row=head.rows[-1:],
        depth=np.array([kept]),
        t_ready_mjd2000=before.itinerary.t_dep_mjd2000[kept : kept + 1],
        t_arr_mjd2000=head.t_arr_mjd2000[-1:],
        t_first_mjd2000=head.t_dep_mjd2000[:1],
        mass=before.mass[kept : kept + 1],
        visited=head.rows[None, :],
        tree_id=np.array([-1]),
        parent_id=np.array([-1]),
    )
    plan = crew.plan
    avoid = np.unique([*plan.orbits, *crew.closed(number)])
    own = own_problem(problem, crew, number)
    tails = screen.homing.run(node, plan.end(number), avoid, settings)
    tours = [replace(tail, itinerary=joined(head, tail.itinerary)) for tail in tails]
    best = _best_fitted(own, tours, before)
    return None if best is before else best


def repaired_probe(
    screen: Screen,
    problem: RendezvousProblem,
    crew: Crew,
    number: int,
    rng: np.random.Generator,
) -> Flight | None:
    """Return a better tour of a probe, of which a few visits in a row are replaced; None for none.

    All places, and replacements by as many visits and by one more, are looked at.
    """
    before, plan = crew.flights[number], crew.plan
    visits = before.itinerary.rows[1:-1].tolist()
    avoid = np.unique([*plan.orbits, *crew.closed(number)])
    own = own_problem(problem, crew, number)
    first = before.itinerary.t_dep_mjd2000[0] + rng.uniform(*_SHIFTS) + _SHIFTED
    window = own.first_departure_mjd2000
    epochs = np.unique(np.clip(first, window[0], window[1]))
    starts = Nodes.at_start(
        np.full(len(epochs), plan.first), epochs, np.full(len(epochs), problem.m0)
    )
    settings = HomingSettings(
        width=_REPAIR_WIDTH,
        propellant_weight=float(rng.uniform(0.1, 0.6)),
        distance_weight=0.0,
        results=2,
        fine=True,
    )
    tours: list[Homecoming] = []
    for place in range(len(visits) + 1):
        for lost in range(min(_MOST_LOST, len(visits) - place) + 1):
            for more in range(2):
                if lost + more:
                    free = [None] * (lost + more)
                    steps = [*visits[:place], *free, *visits[place + lost :]]
                    tours += screen.homing.run(starts, plan.end(number), avoid, settings, steps)
    best = _best_fitted(own, tours, before)
    return None if best is before else best


def joined(head: Itinerary, tail: Itinerary) -> Itinerary:
    """Return two itineraries as one; the second begins where the first ends."""
    return Itinerary(
        np.concatenate([head.rows, tail.rows[1:]]),
        np.concatenate([head.t_dep_mjd2000, tail.t_dep_mjd2000]),
        np.concatenate([head.tof_days, tail.tof_days]),
    )


def polished_probe(
    problem: RendezvousProblem,
    predictor: LegPredictor,
    crew: Crew,
    number: int,
    seed: int,
) -> Flight | None:
    """Return a better tour of a probe by exchanges at both ends; None for none."""
    ids, plan = problem.catalogue.ids, crew.plan
    ends = int(ids[plan.first]), int(ids[plan.end(number)])
    own = replace(
        own_problem(problem, crew, number),
        start_ids=ends[:1],
        end_id=ends[1],
        unscored_ids=tuple(sorted(set(ends))),
        excluded_ids=tuple(sorted({int(ids[row]) for row in _others(crew, number)})),
    )
    before = crew.flights[number]
    result = polish(
        own,
        before.to_tour(own),
        predictor=predictor,
        rng=np.random.default_rng(seed),
        settings=_POLISH,
    )
    flight = fly(own, Itinerary.from_tour(own, result.tour))
    return flight if flight is not None and _better(flight, before) else None


def _others(crew: Crew, number: int) -> list[int]:
    """Return rows that a probe leaves alone: other probes' visits, other orbits' asteroids."""
    plan = crew.plan
    return [*crew.closed(number), *set(plan.orbits) - {plan.first, plan.end(number)}]


def fitted(problem: RendezvousProblem, itinerary: Itinerary) -> Flight | None:
    """Return an itinerary with its best timetable; None where it does not keep the limits."""
    retimed = retime(problem, itinerary, max_iterations=_ITERATIONS)
    if retimed is None or not retimed.flight.keeps_rules(problem):
        return None
    return retimed.flight


def _better(one: Flight, other: Flight) -> bool:
    return (len(one.itinerary), -one.itinerary.duration_days) > (
        len(other.itinerary),
        -other.itinerary.duration_days,
    )


def find_crew(
    screen: Screen,
    problem: RendezvousProblem,
    plan: Plan,
    settings: HomingSettings,
    kept: Mapping[int, Flight] = MappingProxyType({}),
) -> Crew:
    """Return the tours of all probes, found one after another; fewer where there are no more.

    Those of some probes may be there already.
    """
    crew = Crew(plan, ())
    taken = [int(row) for flight in kept.values() for row in flight.itinerary.rows[1:-1]]
    for number, end in enumerate(plan.ends):
        flight = kept.get(number)
        if flight is None:
            if end > 1:
                window = _later_window(screen, crew, number)
                crew = replace(crew, plan=crew.plan.with_window(number, window))
            avoid = [*crew.closed(), *taken]
            flight = find_probe(screen, problem, crew, number, avoid, settings)
        if flight is None:
            break
        crew = replace(crew, flights=(*crew.flights, flight))
    return crew


def _later_window(screen: Screen, crew: Crew, number: int) -> tuple[float, float]:
    """Return when a probe for the third orbit leaves, after those for the second one."""
    before = [
        flight for flight, end in zip(crew.flights, crew.plan.ends, strict=False) if end == 1
    ]
    releases = [float(flight.itinerary.t_dep_mjd2000[0]) for flight in before]
    captures = [float(flight.itinerary.t_arr_mjd2000[-1]) + WAIT_DAYS for flight in before]
    return later_window(screen, crew.plan, number, releases, captures)
