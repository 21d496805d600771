"""Between passes: the ranking weighs more what ran out first."""

from typing import Final

import numpy as np

from seqsearch.core.nodes import Nodes
from seqsearch.core.problem import Problem
from seqsearch.settings import SearchSettings

_GAIN: Final = 8.0
"""Measured on GTOC7: halving the weight leaves 8 % less of the propellant compared with time."""

_WEIGHT_RANGE: Final = (0.05, 3.0)
"""Least and largest weight of propellant, in units of that of time."""


def rebalanced(settings: SearchSettings, nodes: Nodes, problem: Problem) -> SearchSettings:
    """Return settings for the next pass that weigh more what ran out first.

    Parameters
    ----------
    settings : SearchSettings
        Those of the pass that ends.
    nodes : Nodes
        Its last nodes, at least one.
    problem : Problem
        What there was to use up.
    """
    time_left = 1.0 - (nodes.t_arr_mjd2000 - nodes.t_first_mjd2000) / problem.max_duration_days
    mass_left = (nodes.mass - problem.spacecraft.m_dry) / (problem.m0 - problem.spacecraft.m_dry)
    surplus = float((mass_left - time_left).mean())
    weight = settings.propellant_weight * np.exp(-_GAIN * surplus)
    low, high = (settings.time_weight * factor for factor in _WEIGHT_RANGE)
    if settings.time_weight > 0 and settings.propellant_weight > 0:
        weight = np.clip(weight, low, high)
    return settings.with_(propellant_weight=float(weight))
