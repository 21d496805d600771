"""Pacing: under a time limit, how long passes take and how wide their beams are.

A first short pass gives an answer; each of the next takes three times as long, and
the last one takes what is left. Within a pass the beam is as wide as can be afforded:
the time left is divided by the ranks that are still to come and by what a node costs.
"""

import time
from collections.abc import Sequence
from typing import Final, final

import numpy as np

from seqsearch.beam.counters import RankCounters
from seqsearch.core.nodes import Nodes
from seqsearch.core.problem import TourProblem
from seqsearch.deadline import Deadline
from seqsearch.settings import SearchSettings

_FIRST_S: Final = 40.0
_FIRST_SHARE: Final = 0.25
"""The first pass takes so many seconds, but no more than this share of the limit."""

_GROWTH: Final = 3.0
_LONGEST_SCOUTED_S: Final = 120.0
"""Passes that begin with scouting do not grow beyond this, so that little is lost by an
interruption: what was found is in the next pass's pool."""
_NODE_S: Final = 0.02
"""What a node costs, as long as nothing is known: on the safe side."""

_SCREEN_SHARE: Final = 0.05
_SCREENED_LEG_S: Final = 5e-6
"""Share of a pass that is spent on the choice of starts, and what a leg costs there."""

_AUDIT_SHARE: Final = 0.1
_AUDIT_S: Final = 2.0
"""Share of the time that the audit may take, and what one takes."""

_EPOCH_S: Final = 0.2
"""What it takes to look at all neighbourhoods at one epoch."""

_NARROWEST: Final = 60
"""Beams narrower than this spend their time on what every rank costs, however narrow."""

_RECENT: Final = 3


@final
class Pacer:
    """Chooses beam widths so that a pass ends in time.

    Parameters
    ----------
    problem : TourProblem
        For the longest duration of a tour.
    deadline : Deadline
        With a limit.
    """

    def __init__(self, problem: TourProblem, deadline: Deadline) -> None:
        self._problem = problem
        self._deadline = deadline
        self._first_s = min(_FIRST_S, _FIRST_SHARE * self._remaining_s())
        self._end = 0.0

    def begin_pass(self, pass_number: int, scouted: bool = False) -> None:
        """Set the time at which a pass, one with scouts or without, shall end."""
        remaining = self._remaining_s()
        wanted = self._first_s * _GROWTH ** min(pass_number - 1, 20)
        if scouted:
            wanted = min(wanted, _LONGEST_SCOUTED_S)
        seconds = wanted if (1.0 + _GROWTH / 2) * wanted < remaining else remaining
        self._end = time.monotonic() + seconds

    def seconds_of_pass(self) -> float:
        """Return how much of this pass's time is left."""
        return max(0.0, self._end - time.monotonic())

    def screen_legs(self) -> int:
        """Return how many legs can be screened for starts in this pass."""
        return int(_SCREEN_SHARE * self.seconds_of_pass() / _SCREENED_LEG_S)

    def start_epochs(self, settings: SearchSettings) -> int:
        """Return at how many epochs there is time to look for starts."""
        affordable = _SCREEN_SHARE * self.seconds_of_pass() / _EPOCH_S
        return int(np.clip(affordable, min(4, settings.start_epochs), settings.start_epochs))

    def width(
        self, nodes: Nodes, settings: SearchSettings, counters: Sequence[RankCounters]
    ) -> int:
        """Return the beam width that can be afforded.

        Parameters
        ----------
        nodes : Nodes
            Nodes that are expanded next.
        settings : SearchSettings
            `max_beam_width`, and what tells the number of ranks.
        counters : sequence of RankCounters
            All ranks so far.
        """
        recent = [record for record in counters if record.nodes and record.rank][-_RECENT:]
        n_nodes = sum(record.nodes for record in recent)
        seconds = sum(record.seconds - record.seconds_audit for record in recent)
        cost_s = seconds / n_nodes if n_nodes else _NODE_S
        left_s = self.seconds_of_pass()
        affordable = left_s / (max(cost_s, 1e-6) * self._ranks_left(nodes, settings))
        return int(np.clip(affordable, _NARROWEST, settings.max_beam_width))

    def audits(self, counters: Sequence[RankCounters]) -> bool:
        """Tell whether there is time for an audit at the next rank."""
        spent_s = sum(record.seconds_audit for record in counters)
        return spent_s + _AUDIT_S < _AUDIT_SHARE * sum(record.seconds for record in counters)

    def _ranks_left(self, nodes: Nodes, settings: SearchSettings) -> float:
        """Return about how many more legs there will be time for, at the pace so far."""
        clock = self._problem.max_duration_days
        if len(nodes) == 0 or nodes.depth.min() == 0:
            return clock / (2.0 * settings.tof_days_min + self._problem.min_stay_days)
        depth = float(nodes.depth.mean())
        elapsed = float((nodes.t_arr_mjd2000 - nodes.t_first_mjd2000).mean())
        return max(1.0, (clock - elapsed) / (elapsed / depth))

    def _remaining_s(self) -> float:
        remaining = self._deadline.remaining_s()
        assert remaining is not None
        return remaining


_GAIN: Final = 8.0
"""Measured on GTOC7: halving the weight leaves 8 % less of the propellant compared with time."""

_WEIGHT_RANGE: Final = (0.05, 3.0)
"""Least and largest weight of propellant, in units of that of time."""


def rebalanced(settings: SearchSettings, nodes: Nodes, problem: TourProblem) -> SearchSettings:
    """Return settings for the next pass that weigh more what ran out first.

    Parameters
    ----------
    settings : SearchSettings
        Those of the pass that ends.
    nodes : Nodes
        Its last nodes, at least one.
    problem : TourProblem
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
