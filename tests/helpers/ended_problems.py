"""Small problems whose tours have to end somewhere."""

from typing import Any

from feasibility.orbits import Catalogue
from seqsearch import RendezvousProblem
from tests.helpers.problems import small_problem

BODY = 831
"""A body of the belt with near neighbours."""

MOTHER = -1
"""Id of the orbit at which tours start and end."""


def round_trip(body: int, **changes: Any) -> RendezvousProblem:
    """Return a problem of tours from and to an orbit like that of a body, which is left out."""
    belt = small_problem().catalogue
    rows = belt.rows_of([body])
    mother = Catalogue(
        [MOTHER], ["mother"], belt.epoch_mjd2000[rows], belt.elements[rows], "an orbit"
    )
    given: dict[str, Any] = {
        "catalogue": belt.with_bodies(mother),
        "start_ids": (MOTHER,),
        "end_id": MOTHER,
        "unscored_ids": (MOTHER,),
        "excluded_ids": (body,),
        "max_duration_days": 1000.0,
    }
    return small_problem(**(given | changes))
