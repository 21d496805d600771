"""The last leg of tours that have to end at a body: which departures and flight times to try."""

from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.arrays import StructOfArrays
from feasibility.classifier.predictor import LegPredictor, bounded_final_mass
from seqsearch.core.ending import Ending
from seqsearch.core.hop_margins import log_margin
from seqsearch.core.hops import Hops
from seqsearch.core.nodes import Nodes
from seqsearch.core.problem import Problem

_Array = NDArray[np.float64]
_Index = NDArray[np.intp]

_DELAYS_DAYS: Final = (0.0, 12.0, 28.0, 50.0, 80.0, 120.0, 180.0)
"""Waits before the last departure, beyond the shortest stay."""

SHORTEST_DAYS: Final = 40.0
LONGEST_DAYS: Final = 500.0

_MOST: Final = float(np.log(1e6))
"""Largest log(m*/m0) that is told: a leg that needs no thrust has none."""

_FLIGHTS: Final = 16
"""Flight times that are tried: far-off ends are reached by slow flights alone."""


@final
@dataclass(frozen=True, eq=False)
class WaysHome(StructOfArrays):
    """Last legs that might be flown, one row a leg. With n their number.

    Attributes
    ----------
    parent : (n,) intp
        Position of the node that is left.
    t_dep_mjd2000, tof_days : (n,) float64
        Departure and time of flight; the arrival is in time.
    log_margin : (n,) float64
        Predicted log(m*/m0); NaN for unknown.
    m_final : (n,) float64, kg
        Predicted mass at arrival.
    """

    parent: _Index
    t_dep_mjd2000: _Array
    tof_days: _Array
    log_margin: _Array
    m_final: _Array


def ways_home(problem: Problem, ending: Ending, nodes: Nodes, predictor: LegPredictor) -> WaysHome:
    """Return the last legs from nodes at several departures and flight times.

    Parameters
    ----------
    problem : Problem
        Gives the legs.
    ending : Ending
        With a body at which tours end.
    nodes : Nodes
        The nodes that are left.
    predictor : LegPredictor
        Predicts margins; their final masses follow from them.
    """
    assert ending.row is not None
    departure = nodes.t_ready_mjd2000[:, None] + np.asarray(_DELAYS_DAYS)
    left = ending.days_left(nodes, departure)
    longest = np.minimum(left, LONGEST_DAYS)
    parent, wait = np.nonzero(longest >= SHORTEST_DAYS)
    span = np.log(longest[parent, wait] / SHORTEST_DAYS)
    tof = SHORTEST_DAYS * np.exp(span[:, None] * np.linspace(0.0, 1.0, _FLIGHTS))
    parent, wait = np.repeat(parent, _FLIGHTS), np.repeat(wait, _FLIGHTS)
    t_dep, tof_days = departure[parent, wait], tof.ravel()
    hops = hops_home(problem, ending, nodes, parent, t_dep, tof_days)
    log = np.minimum(log_margin(predictor.margin, hops), _MOST)
    m_final = bounded_final_mass(hops.legs[-1], np.exp(np.nan_to_num(log, nan=0.0)))
    return WaysHome(parent, t_dep, tof_days, log, m_final)


def hops_home(
    problem: Problem,
    ending: Ending,
    nodes: Nodes,
    parent: _Index,
    t_dep_mjd2000: _Array,
    tof_days: _Array,
) -> Hops:
    """Return the (k,) hops from nodes, given by their positions, to the end."""
    assert ending.row is not None
    target = np.full(len(parent), ending.row, dtype=np.intp)
    return problem.hops(nodes, parent, target, t_dep_mjd2000, tof_days)
