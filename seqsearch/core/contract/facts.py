"""What a problem says of itself: its members, and that its numbers are possible."""

from typing import Final

import numpy as np

from feasibility import Spacecraft
from feasibility.orbits import Catalogue
from seqsearch.core.contract.asking import Asked, ProblemContractError
from seqsearch.core.problem import Problem

MEMBERS: Final = tuple(name for name in vars(Problem) if not name.startswith("_"))
"""Names of what a problem has."""

_TYPES: Final = {"name": str, "catalogue": Catalogue, "spacecraft": Spacecraft}


def check_members(problem: Problem) -> None:
    """Raise ProblemContractError where an attribute or a method is missing."""
    missing = [name for name in MEMBERS if not hasattr(problem, name)]
    if missing:
        raise ProblemContractError(f"{type(problem).__name__}: has no {', '.join(missing)}")


def check_facts(asked: Asked) -> None:
    """Raise ProblemContractError where an attribute is of the wrong type or out of range."""
    for member, kind in _TYPES.items():
        value = asked.value(member)
        if not isinstance(value, kind):
            raise asked.breach(member, f"is {type(value).__name__}, expected {kind.__name__}")
    problem = asked.problem
    ids = problem.catalogue.ids
    if len(ids) < 2:
        raise asked.breach("catalogue", f"has {len(ids)} bodies, expected two or more")
    dry = problem.spacecraft.m_dry
    for member, least in (("m0", dry), ("max_duration_days", 0.0), ("min_stay_days", None)):
        value = asked.value(member)
        enough = value >= 0.0 if least is None else value > least
        if not (np.isfinite(value) and enough):
            expected = "0 or more" if least is None else f"more than {least:g}"
            raise asked.breach(member, f"is {value:g}, expected {expected}")
    window = asked.value("first_departure_mjd2000")
    if not (len(window) == 2 and np.isfinite(window).all() and window[0] <= window[1]):
        raise asked.breach(
            "first_departure_mjd2000", f"is {window}, expected an earliest and a latest epoch"
        )
    strangers = sorted(set(asked.value("start_ids")) - set(ids.tolist()))
    if strangers:
        raise asked.breach("start_ids", f"{strangers[0]} is not in the catalogue")
