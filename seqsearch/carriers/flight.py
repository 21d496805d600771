"""From a crew to the flight of its mother ship."""

from feasibility.errors import InputError
from seqsearch.carriers.course import Course
from seqsearch.carriers.crew import TOUCH_DAYS, WAIT_DAYS, Crew
from seqsearch.carriers.mother import change_orbit, mother_flight
from seqsearch.carriers.plans import Screen
from seqsearch.carriers.routes import Route
from seqsearch.tours.carrier.path import fly_carrier
from seqsearch.tours.carrier.records import Carrier, CarrierImpulse


def releases_of(crew: Crew) -> list[float]:
    """Return when each probe leaves the mother ship: one that stays there at first, earlier."""
    epochs = [float(flight.itinerary.t_dep_mjd2000[0]) for flight in crew.flights]
    first, _ = crew.waits()
    if first is not None:
        early = epochs[first] - WAIT_DAYS
        epochs[first] = early if crew.course is None else crew.course.stay_epochs[0]
    return epochs


def captures_of(crew: Crew) -> list[float]:
    """Return when each probe is caught: one that stays there at last, later."""
    epochs = [float(flight.itinerary.t_arr_mjd2000[-1]) for flight in crew.flights]
    _, second = crew.waits()
    if second is not None:
        late = epochs[second] + WAIT_DAYS
        epochs[second] = late if crew.course is None else crew.course.stay_epochs[1]
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
    last, first = max(releases), min(captures)
    if min(releases) < route.second_mjd2000 or first <= last:
        return None
    impulses: tuple[CarrierImpulse, ...] = ()
    if crew.course is not None:
        if not _serves(crew.course, releases, captures):
            return None
        impulses = crew.course.impulses
    elif crew.plan.first != crew.plan.second:
        between = last + TOUCH_DAYS, first - TOUCH_DAYS
        impulses = change_orbit(
            screen.catalogue, crew.plan.first, crew.plan.second, between
        ).impulses
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


def _serves(course: Course, releases: list[float], captures: list[float]) -> bool:
    """Tell whether she is on the right coast at each release and capture."""
    coasts = [*course.starts, *course.ends]
    windows = [course.window(coast) for coast in coasts]
    epochs = [*releases, *captures]
    return all(a < epoch < b for epoch, (a, b) in zip(epochs, windows, strict=True))
