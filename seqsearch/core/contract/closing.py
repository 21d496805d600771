"""Legs that complete a tour after its last visit."""

from typing import Any, Final

import numpy as np

from seqsearch.core.contract.asking import Asked
from seqsearch.core.nodes import Nodes
from seqsearch.core.tree import FlownLeg

_MEMBER: Final = "closing"
_SLACK_DAYS: Final = 1e-6
_SLACK_KG: Final = 0.01
_THROTTLE: Final = 1.0 + 1e-6


def check_closing(asked: Asked, nodes: Nodes) -> None:
    """Raise ProblemContractError where the tour that the first node ends cannot be closed."""
    row, t, mass = int(nodes.row[0]), float(nodes.t_arr_mjd2000[0]), float(nodes.mass[0])
    legs = asked.ask(_MEMBER, row, t, mass)
    if not isinstance(legs, tuple):
        raise asked.breach(_MEMBER, f"returned {type(legs).__name__}, expected a tuple")
    for number, leg in enumerate(legs):
        if not isinstance(leg, FlownLeg):
            raise asked.breach(_MEMBER, f"leg {number} is {type(leg).__name__}, expected FlownLeg")
        _check_leg(asked, number, leg, row, t, mass)
        row, t, mass = leg.arr_row, leg.t_arr_mjd2000, leg.m_final - leg.dropped
    if legs and mass < asked.problem.spacecraft.m_dry - _SLACK_KG:
        raise asked.breach(_MEMBER, f"ends with {mass:g} kg, which is below the dry mass")


def _check_leg(
    asked: Asked, number: int, leg: FlownLeg, row: int, t_mjd2000: float, mass: float
) -> None:
    """Check a leg that has to begin at a body, an epoch and with a mass."""
    throttles: Any = np.asarray(leg.throttles)
    wrong = {
        f"leaves row {leg.dep_row}, expected {row}": leg.dep_row != row,
        f"departs at {leg.t_dep_mjd2000:g} MJD2000, expected {t_mjd2000:g}": (
            abs(leg.t_dep_mjd2000 - t_mjd2000) > _SLACK_DAYS
        ),
        f"departs with {leg.m0:g} kg, expected {mass:g}": abs(leg.m0 - mass) > _SLACK_KG,
        f"ends with {leg.m_final:g} kg, more than its {leg.m0:g}": leg.m_final > leg.m0,
        "takes no time": leg.tof_days <= 0.0,
        f"throttles of shape {throttles.shape}, expected (segments, 3)": (
            throttles.ndim != 2 or throttles.shape[1] != 3
        ),
    }
    for how, is_so in wrong.items():
        if is_so:
            raise asked.breach(_MEMBER, f"leg {number} {how}")
    strongest = float(np.linalg.norm(throttles, axis=1).max(initial=0.0))
    if strongest > _THROTTLE:
        raise asked.breach(_MEMBER, f"leg {number} has a throttle of {strongest:g}")
