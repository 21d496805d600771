"""Tours of version 0.1, whose rules had a table ``gtoc5``, as the present format has them."""

from typing import Any

import msgspec

from seqsearch.problems.gtoc5.rules import Gtoc5Rules
from seqsearch.tours.records import TourBody, TourLeg


def upgrade(tour: dict[str, Any], table: dict[str, Any]) -> dict[str, Any]:
    """Return a tour with events and score.

    Parameters
    ----------
    tour : dict
        The tour file, with the rules that all problems share.
    table : dict
        Its table ``gtoc5``.

    Raises
    ------
    msgspec.ValidationError
        A number of the table, a body or a leg does not fit.
    """
    rules = msgspec.convert(table, type=Gtoc5Rules)
    planet, *visits = msgspec.convert(tour["bodies"], type=tuple[TourBody, ...])
    legs = msgspec.convert(tour["legs"], type=tuple[TourLeg, ...])
    points = rules.points()
    own = {
        "events": msgspec.to_builtins(rules.events(planet)),
        "start_counts": False,
        "score": msgspec.to_builtins(points),
    }
    return tour | {
        "rules": tour["rules"] | own,
        "score": points.score(tuple(visits), legs),
    }
