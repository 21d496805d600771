"""From a crew to the flight of its mother ship."""

from feasibility.errors import InputError
from seqsearch.carriers.course import Course
from seqsearch.carriers.crew import TOUCH_DAYS, WAIT_DAYS, Crew
from seqsearch.carriers.mother import Change, change_orbit, mother_flight
from seqsearch.carriers.plans import Screen
from seqsearch.carriers.routes import Route
from seqsearch.tours.carrier.path import fly_carrier
from seqsearch.tours.carrier.records import Carrier


def releases_of(crew: Crew) -> list[float]:
    """Return when each probe leaves the mother ship: one that stays there at first, earlier."""
    epochs = [float(flight.itinerary.t_dep_mjd2000[0]) for flight in crew.flights]
    first = crew.waits()[0]
    if first is not None:
        early = epochs[first] - WAIT_DAYS
        epochs[first] = early if crew.course is None else crew.course.stay_epochs[0]
    return epochs


def captures_of(crew: Crew) -> list[float]:
    """Return when each probe is caught: those that stay there at last, later."""
    epochs = [float(flight.itinerary.t_arr_mjd2000[-1]) for flight in crew.flights]
    for orbit, probe in enumerate(crew.waits()):
        if orbit > 0 and probe is not None:
            late = epochs[probe] + WAIT_DAYS
            epochs[probe] = late if crew.course is None else crew.course.stay_epochs[orbit]
    return epochs


def route_of(screen: Screen, crew: Crew) -> Route | None:
    """Return the mother ship's way to her first orbit; None for none."""
    if crew.course is not None and crew.course.route is not None:
        return crew.course.route
    return screen.route(crew.plan)


def carrier_of(screen: Screen, crew: Crew) -> Carrier | None:
    """Return the mother ship's flight; None where she has not the propellant or the time."""
    route = route_of(screen, crew)
    if route is None:
        return None
    releases, captures = releases_of(crew), captures_of(crew)
    if min(releases) < route.second_mjd2000:
        return None
    if crew.course is None:
        changes = changes_of(screen, crew)
        if changes is None:
            return None
        impulses = tuple(impulse for change in changes for impulse in change.impulses)
    else:
        if not _serves(crew.course, releases, captures):
            return None
        impulses = crew.course.impulses
    masses = [float(flight.mass[-1]) for flight in crew.flights]
    try:
        carrier = mother_flight(
            screen.rules, route, impulses, releases, list(zip(captures, masses, strict=True))
        )
    except InputError:
        return None
    path = fly_carrier(carrier)
    long = max(captures) - route.launch_mjd2000 > screen.rules.max_duration_days
    many = len(carrier.impulses) > screen.rules.max_impulses
    return None if long or many or path.propellant_left_kg < 0.0 else carrier


def changes_of(screen: Screen, crew: Crew) -> list[Change] | None:
    """Return the cheapest changes from each orbit to the next; None where there is no time.

    For a crew without a course. She may not have the propellant for them.
    """
    plan, changes = crew.plan, []
    releases, captures = releases_of(crew), captures_of(crew)
    caught = list(zip(plan.ends, captures, strict=True))
    for orbit in range(1, len(plan.orbits)):
        begin = max(*releases, *[epoch for end, epoch in caught if end < orbit]) + TOUCH_DAYS
        end = min(epoch for end, epoch in caught if end >= orbit) - TOUCH_DAYS
        if end <= begin:
            return None
        one, other = plan.orbits[orbit - 1 : orbit + 1]
        changes.append(change_orbit(screen.catalogue, one, other, (begin, end)))
    return changes


def _serves(course: Course, releases: list[float], captures: list[float]) -> bool:
    """Tell whether she is on the right coast at each release and capture."""
    coasts = [*course.starts, *course.ends]
    windows = [course.window(coast) for coast in coasts]
    epochs = [*releases, *captures]
    return all(a < epoch < b for epoch, (a, b) in zip(epochs, windows, strict=True))
