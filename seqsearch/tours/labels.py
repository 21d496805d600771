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
    """Return the id of a body as text, or a name such as ``EARTH`` for a launch planet."""
    planet = launch_planet(tour.rules)
    if planet is not None and planet.id == body_id:
        return planet_label(planet)
    return str(body_id)


def planet_label(planet: TourBody) -> str:
    """Return the name of a planet as rows have it, such as ``EARTH``."""
    return planet.name.upper().replace(" ", "_")
