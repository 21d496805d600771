"""What files to hand in call the bodies of a tour."""

from seqsearch.tours.events.launch import Launch
from seqsearch.tours.records import TourBody
from seqsearch.tours.tour import Tour, TourRules


def launch_planet(rules: TourRules) -> TourBody | None:
    """Return the planet at which tours start; None where they start at a body of the table."""
    for event in rules.events:
        if isinstance(event, Launch) and event.planet is not None:
            return event.planet
    return None


def body_label(tour: Tour, body_id: int) -> str:
    """Return the id of a body as text, or a name such as ``EARTH`` for one without a score."""
    for name, body in named_bodies(tour.rules).items():
        if body.id == body_id:
            return name
    return str(body_id)


def named_bodies(rules: TourRules) -> dict[str, TourBody]:
    """Return the bodies that rows call by their names: the launch planet, and those unscored."""
    planet = launch_planet(rules)
    bodies = (*(() if planet is None else (planet,)), *(rules.unscored or ()))
    return {planet_label(body): body for body in bodies}


def planet_label(planet: TourBody) -> str:
    """Return the name of a planet as rows have it, such as ``EARTH``."""
    return planet.name.upper().replace(" ", "_")
