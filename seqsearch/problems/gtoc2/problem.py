"""`Gtoc2Problem`: GTOC2 as the search sees it."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, final

import msgspec
import numpy as np
from numpy.typing import NDArray

from feasibility import InputError, Legs
from feasibility.classifier.predictor import LegPredictor
from feasibility.orbits import Catalogue
from feasibility.runtime.workers import in_threads
from seqsearch.core.custom_moves import CustomCandidates, CustomMoves
from seqsearch.core.hops import Hops
from seqsearch.core.nodes import Nodes
from seqsearch.core.recording import tour_body
from seqsearch.problems.gtoc2.group_sets import NO_GROUP, GroupSets
from seqsearch.problems.gtoc2.launches import Launches
from seqsearch.problems.gtoc2.outlook import Outlook
from seqsearch.problems.gtoc2.plans import Plans
from seqsearch.problems.gtoc2.prospects import Prospects
from seqsearch.problems.gtoc2.rules import Gtoc2Rules
from seqsearch.problems.gtoc2.transfers import Transfers
from seqsearch.problems.moves.earth_first import earth_first
from seqsearch.problems.moves.freed_launch import freed_launch
from seqsearch.problems.moves.lambert_departure import lambert_departure
from seqsearch.problems.moves.launch_epochs import launch_epochs
from seqsearch.problems.moves.questions import Questions
from seqsearch.problems.variant import RendezvousVariant
from seqsearch.settings import SearchSettings
from seqsearch.tours.events import Groups, Launch
from seqsearch.tours.scores import MassRate
from seqsearch.tours.tour import TourRules

_Array = NDArray[np.float64]
_Rows = NDArray[np.intp]

_LAUNCHES_AT_ONCE: Final = 4
_NODES_AT_ONCE: Final = 16
"""Nodes that are asked about together: predictors answer some hundred questions at a time."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Gtoc2Problem(RendezvousVariant):
    """Launch from the Earth, then one asteroid of each group.

    A tour that has visited all groups is complete; the best is the one with the largest
    quotient of final mass and flight time.

    Parameters
    ----------
    base : RendezvousProblem
        Name, spacecraft, masses, window, duration and stays; its catalogue are the
        asteroids. Its starts play no part.
    rules : Gtoc2Rules
        Launch and groups.

    Raises
    ------
    InputError
        The catalogue has a body with the id of the Earth, 0, or no column with the groups.
    """

    rules: Gtoc2Rules

    def __post_init__(self) -> None:
        asteroids, column = self.base.catalogue, self.rules.group_column
        if column not in asteroids.extra:
            raise InputError(
                f"problem {self.name}: {asteroids.source} has no column {column!r}, expected "
                "one that says to which group each asteroid belongs (further columns: "
                f"{', '.join(asteroids.extra) or 'none'})"
            )
        # Looked at once, so that an id that is the Earth's is refused.
        assert len(self.catalogue) == len(asteroids) + 1

    @property
    def start_ids(self) -> tuple[int, ...]:
        """The id of the Earth."""
        return (0,)

    @cached_property
    def catalogue(self) -> Catalogue:
        """The Earth, row 0, and the asteroids."""
        return earth_first(self.base.catalogue)

    @cached_property
    def group_ids(self) -> tuple[tuple[int, ...], ...]:
        """Ids of the asteroids of each group, in ascending order of the column's values."""
        asteroids = self.base.catalogue
        column = asteroids.extra[self.rules.group_column]
        return tuple(
            tuple(int(body) for body in asteroids.ids[column == value])
            for value in np.unique(column)
        )

    @cached_property
    def outlook(self) -> Outlook:
        """What forecasts scores."""
        column = self.base.catalogue.extra[self.rules.group_column]
        _, group = np.unique(column, return_inverse=True)
        sets = GroupSets(np.concatenate([[NO_GROUP], group]))
        return Outlook(self.catalogue, sets, self.spacecraft, self.min_stay_days)

    @property
    def custom_moves(self) -> CustomMoves:
        """The problem itself: it launches, and its targets are no near neighbours."""
        return self

    def start_rows(self) -> _Rows:
        """Return the catalogue row of the Earth."""
        return np.zeros(1, dtype=np.intp)

    def starts(self, settings: SearchSettings, rng: np.random.Generator, /) -> Nodes:
        """Return ``settings.starts`` launches all over the window."""
        n = settings.starts
        epochs = launch_epochs(self.first_departure_mjd2000, n, rng)
        return self.start_nodes(np.zeros(n, dtype=np.intp), epochs)

    def candidates(
        self, nodes: Nodes, settings: SearchSettings, predictor: LegPredictor, threads: int, /
    ) -> Iterator[CustomCandidates]:
        """Propose launches or transfers from each node, at several flight times a target."""
        open_ = np.flatnonzero(self.outlook.groups.left(nodes.visited))
        at_once = _LAUNCHES_AT_ONCE if (nodes.depth == 0).any() else _NODES_AT_ONCE
        blocks = [open_[first : first + at_once] for first in range(0, len(open_), at_once)]

        def propose(block: _Rows) -> CustomCandidates | None:
            return self._from_block(nodes, block, settings, predictor)

        for found in in_threads(propose, blocks, threads):
            if found is not None:
                yield found

    def _from_block(
        self, nodes: Nodes, block: _Rows, settings: SearchSettings, predictor: LegPredictor
    ) -> CustomCandidates | None:
        """Return the candidates from some nodes; None for none."""
        ask, prospects = Questions(predictor), Prospects(self.outlook, nodes)

        def legs(plans: Plans) -> Legs:
            return plans.legs(nodes, self.catalogue, self.spacecraft)

        if (nodes.depth == 0).any():
            speed = self.rules.launch_speed_max_m_s
            plans = Launches(prospects, legs, ask, self.catalogue, speed).plans(block)
        else:
            plans = Transfers(prospects, legs, ask, settings).plans(block)
        left = self.days_left(nodes, nodes.t_ready_mjd2000[:, None])[plans.parent, 0]
        plans = plans.take(plans.tof_days <= left)
        m_final = ask.final_mass(legs(plans))
        # No comparison holds for NaN, where the predictor knows nothing.
        enough = m_final >= self.spacecraft.m_dry
        if not enough.any():
            return None
        plans = plans.take(enough)
        hops = self._hops(nodes, plans)
        if (nodes.depth == 0).any():
            # Plans have the best of some directions. The solver finds a better one.
            hops = freed_launch(hops, self.catalogue, self.rules.launch_speed_max_m_s)
        return CustomCandidates(plans.parent, plans.target, hops, m_final[enough], ask.count)

    def _hops(self, nodes: Nodes, plans: Plans) -> Hops:
        legs = plans.legs(nodes, self.catalogue, self.spacecraft)
        return Hops((legs,), (np.zeros(len(plans)),))

    def may_visit(self, nodes: Nodes, target: NDArray[np.intp], /) -> NDArray[np.bool_]:
        """Return (n, t) whether targets, catalogue rows (n, t), are of groups not visited."""
        groups = self.outlook.groups
        return groups.contain(groups.left(nodes.visited)[:, None], target)

    def hops(
        self,
        nodes: Nodes,
        parent: _Rows,
        target: _Rows,
        t_dep_mjd2000: _Array,
        tof_days: _Array,
        /,
    ) -> Hops:
        """Return the (k,) hops, launches along Lambert's arcs; see `Problem.hops`."""
        at = nodes.take(parent)
        velocity = np.zeros((len(parent), 3))
        launch = np.flatnonzero(at.depth == 0)
        velocity[launch] = lambert_departure(
            self.catalogue,
            at.row[launch],
            t_dep_mjd2000[launch],
            target[launch],
            tof_days[launch],
            least_m_s=0.0,
            most_m_s=self.rules.launch_speed_max_m_s,
        )
        late = replace(at, t_ready_mjd2000=t_dep_mjd2000)
        return self._hops(late, Plans(np.arange(len(parent)), target, velocity, tof_days))

    def tour_cost(self, nodes: Nodes, settings: SearchSettings, /) -> _Array:  # noqa: ARG002
        """Return (n,) the score in kg/year with its sign changed; a forecast of it before."""
        elapsed = nodes.t_arr_mjd2000 - nodes.t_first_mjd2000
        left = self.outlook.groups.left(nodes.visited)
        return -self.outlook.score(nodes.row, left, elapsed, nodes.mass)

    def tour_rules(self) -> TourRules:
        """Return the numbers of the problem, with launch, groups and score."""
        planet = tour_body(self.catalogue, 0)
        return msgspec.structs.replace(
            self.base.tour_rules(),
            start_ids=self.start_ids,
            events=(
                Launch(planet=planet, speed_max_m_s=self.rules.launch_speed_max_m_s),
                Groups(ids=self.group_ids, start_counts=False),
            ),
            start_counts=False,
            score=MassRate(visits=len(self.group_ids)),
        )
