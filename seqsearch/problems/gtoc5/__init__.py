"""GTOC5: near-Earth asteroids, each met twice, first at rest and then in a fast fly-by.

The statement is Grigoriev and Zapletin, "GTOC5: problem statement and notes on
solution verification", Acta Futura 8 (2014) 9-19, doi 10.2420/AF08.2014.9. A
visit is a rendezvous, at which a package is left, and later a fly-by of the
same asteroid, at which a penetrator is left. A hop is therefore two legs: the
*self-fly-by* leaves the asteroid and comes back to it with a prescribed
relative velocity; the *transfer* begins with that velocity and ends at rest at
the next asteroid.
"""

from seqsearch.core.problem import Problem
from seqsearch.problems.gtoc5.rules import Gtoc5Rules
from seqsearch.problems.rendezvous import RendezvousProblem

RULES = Gtoc5Rules


def build(base: RendezvousProblem, rules: Gtoc5Rules) -> Problem:
    """Return the problem; `base` has the asteroids, the spacecraft and the window."""
    # Imported here: reading any problem file looks at the rules of all problems.
    from seqsearch.problems.gtoc5.problem import Gtoc5Problem

    return Gtoc5Problem(base=base, rules=rules)
