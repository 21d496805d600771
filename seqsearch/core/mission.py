"""The rules that most missions share: no body twice, a window, a clock, and what is used up."""

import numpy as np
from numpy.typing import NDArray

from seqsearch.core.nodes import Nodes


def not_visited(nodes: Nodes, target: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Return (n, t) whether each node's targets, catalogue rows (n, t), are new to it."""
    fresh: NDArray[np.bool_] = ~(target[:, :, None] == nodes.visited[:, None, :]).any(axis=2)
    return fresh


def days_until_end(
    nodes: Nodes,
    t_dep_mjd2000: NDArray[np.float64],
    last_start_mjd2000: float,
    max_duration_days: float,
) -> NDArray[np.float64]:
    """Return (n, d) days from departures to the end of each node's mission.

    The clock runs from the first departure; -inf for starts after the window.

    Parameters
    ----------
    nodes : Nodes
        n nodes.
    t_dep_mjd2000 : (n, d) float64
        Departure epochs.
    last_start_mjd2000 : float
        Latest epoch of a first departure.
    max_duration_days : float
        Longest duration of the mission.
    """
    at_start = nodes.depth[:, None] == 0
    clock = np.where(at_start, t_dep_mjd2000, nodes.t_first_mjd2000[:, None])
    left = max_duration_days - (t_dep_mjd2000 - clock)
    return np.where(at_start & (t_dep_mjd2000 > last_start_mjd2000), -np.inf, left)


def used_up(
    nodes: Nodes,
    *,
    max_duration_days: float,
    m0: float,
    m_dry: float,
    time_weight: float,
    propellant_weight: float,
) -> NDArray[np.float64]:
    """Return (n,) the weighted sum of the shares of time and propellant that are used up.

    Parameters
    ----------
    nodes : Nodes
        n nodes.
    max_duration_days : float
        All the time that there is.
    m0, m_dry : float
        Masses in kg with all and without propellant.
    time_weight, propellant_weight : float
        Weights of the shares.
    """
    elapsed = (nodes.t_arr_mjd2000 - nodes.t_first_mjd2000) / max_duration_days
    used = (m0 - nodes.mass) / (m0 - m_dry)
    return time_weight * elapsed + propellant_weight * used
