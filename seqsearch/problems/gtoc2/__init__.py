"""GTOC2: one asteroid of each of four groups, and as much mass in as little time as possible.

The statement is Petropoulos, "Problem description for the 2nd Global Trajectory
Optimisation Competition" (JPL, 2006). The spacecraft is launched from the Earth, whose
asteroids are in no group, and comes to rest at one asteroid of each group, in any order.
"""

from seqsearch.core.problem import Problem
from seqsearch.problems.gtoc2.rules import Gtoc2Rules
from seqsearch.problems.rendezvous import RendezvousProblem

RULES = Gtoc2Rules


def build(base: RendezvousProblem, rules: Gtoc2Rules) -> Problem:
    """Return the problem; `base` has the asteroids, the spacecraft, the window and the stays."""
    # Imported here: reading any problem file looks at the rules of all problems.
    from seqsearch.problems.gtoc2.problem import Gtoc2Problem

    return Gtoc2Problem(base=base, rules=rules)
