"""`stops`: where a tour starts and arrives, numbered as the table of legs numbers them."""

from dataclasses import dataclass
from typing import final

from seqsearch.tours.records import TourBody
from seqsearch.tours.tour import Tour


@final
@dataclass(frozen=True)
class Stop:
    """The start of a tour, or the arrival of a leg.

    Attributes
    ----------
    number : int
        0 for the start, then the number of the leg that arrives.
    body : TourBody
        Where.
    t_mjd2000 : float
        Epoch of the arrival; of the start, of the first departure.
    stay_days : float or None
        How long the spacecraft stays; None at the start and at the end.
    fly_by : bool
        It passes without coming to rest.
    """

    number: int
    body: TourBody
    t_mjd2000: float
    stay_days: float | None
    fly_by: bool


def stops(tour: Tour) -> list[Stop]:
    """Return the start and all arrivals of a tour, in order; none for a tour without bodies."""
    found = [
        Stop(
            0, body, tour.legs[0].t_dep_mjd2000 if tour.legs else tour.t_start_mjd2000, None, False
        )
        for body in tour.bodies[:1]
    ]
    for number, leg in enumerate(tour.legs, 1):
        following = tour.legs[number : number + 1]
        stay = following[0].t_dep_mjd2000 - leg.t_arr_mjd2000 if following else None
        body = tour.body(leg.to_id)
        found.append(Stop(number, body, leg.t_arr_mjd2000, stay, leg.is_fly_by))
    return found
