"""Pacing: how long passes take and how wide their beams are.

Without a time limit the settings decide. Under one a first short pass gives an answer; each of
the next takes three times as long, and the last one takes what is left. Within a pass the beam is
as wide as can be afforded: the time left is divided by the ranks that are still to come and by
what a node costs.
"""

import time
from collections.abc import Sequence
from typing import Final, Protocol, final

import numpy as np

from seqsearch.beam.counters import RankCounters
from seqsearch.beam.scouting.guide import VARIANTS, Guide
from seqsearch.core.nodes import Nodes, no_nodes
from seqsearch.core.problem import Problem
from seqsearch.deadline import Deadline
from seqsearch.settings import SearchSettings

_FIRST_S: Final = 40.0
_FIRST_SHARE: Final = 0.25
"""Seconds of the first pass, and the largest share of the limit that it may take."""

_GROWTH: Final = 3.0
_LONGEST_SCOUTED_S: Final = 120.0
"""Passes that begin with scouting do not grow beyond this, so that little is lost by an
interruption: what was found is in the next pass's pool."""
_NODE_S: Final = 0.02
"""What a node costs, as long as nothing is known: on the safe side."""

_GUIDED_NODE_S: Final = 0.004
_SURELY: Final = 0.8
"""The same in a guided pass, and the share of the time left for which one is planned."""

_SCOUTED_S: Final = 15.0
_LEAST_SCOUT: Final = 0.15
"""Passes shorter than this send out scouts that are narrower than set, down to this share."""

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

_START_SHARE: Final = 0.1
"""Share of the time left that the starts of a narrow pass may take."""

_LITTLE_S: Final = 45.0
_NO_SCOUTS_S: Final = 20.0
"""With less time than this the first pass is narrow and without scouts, if that leaves half of the
time; with less than the second in any case, as scouts would use it up."""

_RECENT: Final = 3


class Pacing(Protocol):
    """Decides about the effort of passes and ranks."""

    def begin_pass(
        self,
        pass_number: int,
        settings: SearchSettings,
        counters: Sequence[RankCounters],
        *,
        scouted: bool,
    ) -> SearchSettings:
        """Return the settings of a pass that begins now, with scouts or without.

        Parameters
        ----------
        pass_number : int
            From 1.
        settings : SearchSettings
            Those of the pass before.
        counters : sequence of RankCounters
            All ranks so far.
        scouted : bool
            Whether scouts are sent out first.
        """
        ...

    def begin_narrow_pass(self, pass_number: int) -> SearchSettings | None:
        """Return the settings of a narrow pass without scouts, where one is due among others.

        A short limit must not find less than a small beam without one, and guided passes leave
        out all hops of which the predictor knows nothing. None where none is due.
        """
        ...

    def scouting_s(self, settings: SearchSettings) -> float | None:
        """Return how long to scout; None for as many generations as the settings say."""
        ...

    def width(
        self, nodes: Nodes, settings: SearchSettings, counters: Sequence[RankCounters]
    ) -> int:
        """Return the beam width for the next rank.

        Parameters
        ----------
        nodes : Nodes
            Nodes that wait to be expanded.
        settings : SearchSettings
            Those of the pass.
        counters : sequence of RankCounters
            All ranks so far.
        """
        ...

    def narrowed(self, guide: Guide, nodes: Nodes, counters: Sequence[RankCounters]) -> Nodes:
        """Return which nodes a guided pass goes on with, so that it reaches its last rank.

        Parameters
        ----------
        guide : Guide
            Keeps from now on to the best itineraries that there is time for.
        nodes : Nodes
            Nodes that are next.
        counters : sequence of RankCounters
            All ranks so far.
        """
        ...

    def audits(self, counters: Sequence[RankCounters]) -> bool:
        """Tell whether there is time for an audit at the next rank."""
        ...


@final
class FixedPacing:
    """Takes all from the settings, however long it takes; a `Pacing`."""

    def begin_pass(
        self,
        pass_number: int,  # noqa: ARG002
        settings: SearchSettings,
        counters: Sequence[RankCounters],  # noqa: ARG002
        *,
        scouted: bool,  # noqa: ARG002
    ) -> SearchSettings:
        """Return the settings as they are."""
        return settings

    def begin_narrow_pass(self, pass_number: int) -> None:
        """Return None: there is none."""

    def scouting_s(self, settings: SearchSettings) -> None:
        """Return None: the number of generations is set."""

    def width(
        self,
        nodes: Nodes,  # noqa: ARG002
        settings: SearchSettings,
        counters: Sequence[RankCounters],  # noqa: ARG002
    ) -> int:
        """Return the beam width that is set."""
        return settings.beam_width

    def narrowed(
        self,
        guide: Guide,  # noqa: ARG002
        nodes: Nodes,
        counters: Sequence[RankCounters],  # noqa: ARG002
    ) -> Nodes:
        """Return all nodes."""
        return nodes

    def audits(self, counters: Sequence[RankCounters]) -> bool:  # noqa: ARG002
        """Audit every rank."""
        return True


@final
class ClockPacing:
    """Chooses beam widths so that a pass ends in time; a `Pacing`.

    Parameters
    ----------
    problem : Problem
        For the longest duration of a tour.
    deadline : Deadline
        With a limit.
    settings : SearchSettings
        Settings of the search: the least number of starts and screened legs.
    """

    def __init__(self, problem: Problem, deadline: Deadline, settings: SearchSettings) -> None:
        self._problem = problem
        self._deadline = deadline
        self._base = settings
        self._first_s = min(_FIRST_S, _FIRST_SHARE * self._remaining_s())
        self._end = 0.0
        self._narrow = False

    def begin_pass(
        self,
        pass_number: int,
        settings: SearchSettings,
        counters: Sequence[RankCounters],
        *,
        scouted: bool,
    ) -> SearchSettings:
        """Set the time at which the pass is to end; about as many starts as the beam is wide."""
        self._narrow = False
        remaining = self._remaining_s()
        wanted = self._first_s * _GROWTH ** min(pass_number - 1, 20)
        if scouted:
            wanted = min(wanted, _LONGEST_SCOUTED_S)
        seconds = wanted if (1.0 + _GROWTH / 2) * wanted < remaining else remaining
        self._end = time.monotonic() + seconds
        if scouted:
            # A generation of scouts cannot be cut short: narrower ones leave time to fly anything.
            share = min(1.0, max(seconds / _SCOUTED_S, _LEAST_SCOUT))
            scouts = {"width": max(1, round(share * self._base.scouts.width))}
            settings = settings.with_(scouts=scouts)
        screen_s = _SCREEN_SHARE * seconds
        width = self.width(no_nodes(), settings, counters)
        return settings.with_(
            beam_width=width,
            starts=max(width, min(2 * width, self._base.starts)),
            screen_legs=max(int(screen_s / _SCREENED_LEG_S), self._base.screen_legs),
            start_epochs=self._epochs(screen_s),
        )

    def begin_narrow_pass(self, pass_number: int) -> SearchSettings | None:
        """Return the settings of a narrow pass: the second, in little time the first."""
        remaining = self._remaining_s()
        seconds = _NARROWEST * _NODE_S * self._ranks_left(no_nodes(), self._base)
        if pass_number == 1:
            due = remaining < (_LITTLE_S if seconds < 0.5 * remaining else _NO_SCOUTS_S)
        else:
            due = pass_number == 2 and not self._narrow and seconds < remaining
        if not due:
            return None
        self._narrow = True
        self._end = time.monotonic() + seconds
        return self._base.with_(
            beam_width=_NARROWEST, start_epochs=self._epochs(_START_SHARE * remaining)
        )

    def scouting_s(self, settings: SearchSettings) -> float:
        """Return the share of the pass that belongs to scouts."""
        return settings.scouts.share * self._seconds_of_pass()

    def width(
        self, nodes: Nodes, settings: SearchSettings, counters: Sequence[RankCounters]
    ) -> int:
        """Return the beam width that can be afforded, at most `max_beam_width`."""
        if self._narrow:
            return settings.beam_width
        left_s = self._seconds_of_pass()
        cost_s = _node_s(counters, _NODE_S)
        affordable = left_s / (cost_s * self._ranks_left(nodes, settings))
        return int(np.clip(affordable, _NARROWEST, settings.max_beam_width))

    def narrowed(self, guide: Guide, nodes: Nodes, counters: Sequence[RankCounters]) -> Nodes:
        """Return which nodes go on, so that the best itineraries are flown before the time is up.

        A pass that ends beyond its own time is no harm, one that the limit cuts short is.
        """
        legs_left = guide.legs_left(nodes)
        if legs_left == 0:
            return nodes
        cost_s = VARIANTS * legs_left * _node_s(counters, _GUIDED_NODE_S)
        affordable = int(_SURELY * self._remaining_s() / cost_s)
        return nodes.take(guide.narrowed(nodes, max(1, affordable)))

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

    def _epochs(self, seconds: float) -> int:
        """Return at how many epochs neighbourhoods can be looked at, at most as many as set."""
        wanted = self._base.start_epochs
        return int(np.clip(seconds / _EPOCH_S, min(4, wanted), wanted))

    def _seconds_of_pass(self) -> float:
        """Return how much of this pass's time is left."""
        return max(0.0, self._end - time.monotonic())

    def _remaining_s(self) -> float:
        remaining = self._deadline.remaining_s()
        assert remaining is not None
        return remaining


def _node_s(counters: Sequence[RankCounters], unknown_s: float) -> float:
    """Return what a node cost lately, without audits; `unknown_s` before the first."""
    recent = [record for record in counters if record.nodes and record.rank][-_RECENT:]
    n_nodes = sum(record.nodes for record in recent)
    seconds = sum(record.seconds - record.seconds_audit for record in recent)
    return max(seconds / n_nodes, 1e-6) if n_nodes else unknown_s
