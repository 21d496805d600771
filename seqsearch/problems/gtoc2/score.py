"""The score of GTOC2: final mass over flight time."""

from collections.abc import Collection, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

_YEAR_DAYS: Final = 365.25


def kg_per_year(
    mass_kg: NDArray[np.float64] | float, days: NDArray[np.float64] | float
) -> NDArray[np.float64]:
    """Return J in kg/year, for masses at the last arrival and times since the launch."""
    ratio: NDArray[np.float64] = np.asarray(mass_kg) / np.asarray(days) * _YEAR_DAYS
    return ratio


def tour_score(
    visited_ids: Collection[int],
    group_ids: Sequence[Collection[int]],
    *,
    t_launch_mjd2000: float,
    t_last_arrival_mjd2000: float,
    m_final_kg: float,
) -> float:
    """Return J of a tour in kg/year, or 0 where a group is not visited.

    Parameters
    ----------
    visited_ids : collection of int
        Bodies at which the tour comes to rest.
    group_ids : sequence of collections of int
        Ids of the bodies of each group.
    t_launch_mjd2000, t_last_arrival_mjd2000 : float
        Between them is the flight time.
    m_final_kg : float
        Mass at the last arrival.
    """
    visited = set(visited_ids)
    days = t_last_arrival_mjd2000 - t_launch_mjd2000
    if days <= 0 or any(visited.isdisjoint(group) for group in group_ids):
        return 0.0
    return float(kg_per_year(m_final_kg, days))
