"""Missions whose legs have free ends: a launch, fly-bys as visits, an arrival with speed left.

A problem file with a table ``[ends]`` states them; the rest of it is that of a tour of rendezvous.
"""

from seqsearch.core.problem import Problem
from seqsearch.problems.ends.rules import EndsRules
from seqsearch.problems.rendezvous import RendezvousProblem

RULES = EndsRules
MISSION_KEYS = ("end_id", "must_visit", "bodies")


def build(base: RendezvousProblem, rules: EndsRules) -> Problem:
    """Return the problem; `base` has bodies, spacecraft, window and all other rules."""
    # Imported here: reading any problem file looks at the rules of all problems.
    from seqsearch.problems.ends.problem import EndsProblem, with_launch_body

    return EndsProblem(base=with_launch_body(base, rules), rules=rules)
