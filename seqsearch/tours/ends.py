"""Checks of tours that have to end at a body, and of bodies without a score."""

from collections.abc import Sequence

import numpy as np

from seqsearch.tours.checks import Check
from seqsearch.tours.records import TourBody
from seqsearch.tours.tour import TourRules

_ELEMENT_TOLERANCE = 1e-12


def visited_twice(rules: TourRules, ids: Sequence[int]) -> list[int]:
    """Return the ids that a tour visits twice; it may end where it began, if it has to."""
    closed = bool(rules.end_id == ids[0] == ids[-1] and len(ids) > 1)
    once = list(ids[:-1] if closed else ids)
    return sorted({body for body in once if once.count(body) > 1})


def check_ends(rules: TourRules, bodies: Sequence[TourBody]) -> list[Check]:
    """Check what rules say of the end, of bodies to visit, and of those without a score."""
    ids = [body.id for body in bodies]
    checks = []
    if isinstance(rules.end_id, int):
        there = len(ids) > 1 and ids[-1] == rules.end_id
        checks.append(Check("ends at the body asked for", there, str(ids[-1]), str(rules.end_id)))
    if rules.must_visit:
        missing = sorted(set(rules.must_visit) - set(ids))
        checks.append(
            Check(
                "bodies that have to be visited",
                not missing,
                f"missing {missing}" if missing else "all",
                str(list(rules.must_visit)),
            )
        )
    if rules.unscored:
        known = {body.id: body for body in rules.unscored}
        off = max(
            (_difference(body, known[body.id]) for body in bodies if body.id in known),
            default=0.0,
        )
        checks.append(
            Check(
                "elements of bodies without a score",
                off <= _ELEMENT_TOLERANCE,
                f"largest difference {off:.1e}",
                f"{_ELEMENT_TOLERANCE:g}",
            )
        )
    return checks


def _difference(one: TourBody, other: TourBody) -> float:
    """Return the largest difference of two sets of elements, the semi-major axis relative."""
    ours, theirs = (
        np.array(
            [
                body.a_m / other.a_m,
                body.e,
                body.i_rad,
                body.node_rad,
                body.argp_rad,
                body.mean_anomaly_rad,
                body.epoch_mjd2000,
            ]
        )
        for body in (one, other)
    )
    return float(np.abs(ours - theirs).max())
