"""`EndsProblem`: a tour whose legs have free ends, as the search sees it."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import final

import msgspec
import numpy as np
from msgspec import UNSET, UnsetType
from numpy.typing import NDArray

from feasibility import InputError
from feasibility.orbits.earth import earth
from seqsearch.core.custom_moves import CustomMoves
from seqsearch.core.hops import Hops
from seqsearch.core.nodes import Nodes
from seqsearch.core.recording import tour_body
from seqsearch.problems.ends.fly_bys import FlyBys
from seqsearch.problems.ends.rules import EndsRules
from seqsearch.problems.moves.earth_first import earth_first
from seqsearch.problems.moves.freed_launch import VINF_SLACK
from seqsearch.problems.moves.legs_between import legs_between
from seqsearch.problems.rendezvous import RendezvousProblem
from seqsearch.problems.variant import RendezvousVariant
from seqsearch.tours.events import FlyBy, Launch, TourEvent
from seqsearch.tours.tour import TourRules

_Array = NDArray[np.float64]
_Rows = NDArray[np.intp]


def with_launch_body(base: RendezvousProblem, rules: EndsRules) -> RendezvousProblem:
    """Return the problem with the body from which its tours are launched among the others.

    Raises
    ------
    InputError
        There are other start bodies, or another body has the Earth's id.
    """
    if rules.launch_from is None:
        return base
    home = int(earth().ids[0])
    if set(base.start_ids) - {home}:
        raise InputError(
            f"problem {base.name}: start_ids {base.start_ids} and launch_from = "
            f"{rules.launch_from!r}, expected one of the two"
        )
    there = home in base.catalogue.ids
    catalogue = base.catalogue if there else earth_first(base.catalogue)
    return replace(base, catalogue=catalogue, start_ids=(home,))


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class EndsProblem(RendezvousVariant):
    """A tour of rendezvous or of fly-bys, with a launch or an arrival that may have some speed.

    Parameters
    ----------
    base : RendezvousProblem
        Bodies, spacecraft, masses, window and all other rules; among its bodies is the one of
        the launch, see `with_launch_body`.
    rules : EndsRules
        The ends.

    Raises
    ------
    InputError
        A stay at bodies that are passed, an end of tours of fly-bys or bodies that these must
        visit, or a speed at the end of tours that have none.
    """

    rules: EndsRules

    def __post_init__(self) -> None:
        if self.passes and self.min_stay_days > 0.0:
            raise InputError(
                f"problem {self.name}: min_stay_days = {self.min_stay_days:g} and visits = "
                '"fly-by", expected 0: what is passed cannot be stayed at'
            )
        if self.passes and self.ending is not None:
            raise InputError(
                f'problem {self.name}: an end_id or must_visit and visits = "fly-by", expected '
                "them in tours of rendezvous alone"
            )
        if self.rules.arrival_vinf_km_s > 0.0 and self._end_row is None:
            raise InputError(
                f"problem {self.name}: arrival_vinf_km_s without a body at which tours end"
            )

    @property
    def passes(self) -> bool:
        """Whether visits are fly-bys."""
        return self.rules.visits == "fly-by"

    @property
    def rows_to_avoid(self) -> NDArray[np.intp]:
        """Rows that are not visited on the way; the planet of the launch is one."""
        avoided = self.base.rows_to_avoid
        if self.rules.launch_from is None:
            return avoided
        return np.union1d(avoided, self.start_rows())

    @property
    def launch_m_s(self) -> float:
        """Largest excess speed of the first departure."""
        return 1e3 * self.rules.launch_vinf_km_s

    @property
    def visit_m_s(self) -> float:
        """Largest speed of visits: zero for rendezvous, inf for any."""
        if not self.passes:
            return 0.0
        bound = self.rules.visit_vinf_km_s
        return np.inf if bound is None else 1e3 * bound

    @property
    def custom_moves(self) -> CustomMoves | None:
        """What finds fly-bys, whose targets are near where the spacecraft goes anyway."""
        return self._fly_bys if self.passes else self.base.custom_moves

    def hops(
        self,
        nodes: Nodes,
        parent: _Rows,
        target: _Rows,
        t_dep_mjd2000: _Array,
        tof_days: _Array,
        /,
    ) -> Hops:
        """Return the (k,) hops, each a single leg; see `Problem.hops`."""
        launched = np.where(nodes.depth[parent] == 0, self.launch_m_s, 0.0)
        arrival = np.full(len(parent), self.visit_m_s)
        if self._end_row is not None:
            arrival[target == self._end_row] = 1e3 * self.rules.arrival_vinf_km_s
        legs = legs_between(
            self.catalogue,
            self.spacecraft,
            nodes.row[parent],
            target,
            t_dep_mjd2000,
            tof_days,
            nodes.mass[parent],
            least_mass=self.spacecraft.m_dry,
            departure_velocity=nodes.velocity[parent],
            vinf_dep=(1.0 - VINF_SLACK) * launched,
            vinf_arr=(1.0 - VINF_SLACK) * arrival,
        )
        return Hops((legs,), (np.zeros(len(legs)),))

    def tour_rules(self) -> TourRules:
        """Return the numbers of the problem, with what free ends are allowed."""
        rules = self.base.tour_rules()
        events: list[TourEvent] = [*rules.events]
        apart = self.rules.launch_from is not None
        if apart or self.launch_m_s > 0.0:
            planet = tour_body(self.catalogue, int(self.start_rows()[0])) if apart else None
            events.append(Launch(planet=planet, speed_max_m_s=self.launch_m_s))
        if self.passes or self.rules.arrival_vinf_km_s > 0.0:
            events.append(
                FlyBy(
                    speed_min_m_s=0.0,
                    times=0,
                    visit_max_m_s=_stated(self.visit_m_s) if self.passes else UNSET,
                    last_max_m_s=UNSET
                    if self._end_row is None
                    else _stated(1e3 * self.rules.arrival_vinf_km_s),
                )
            )
        counts = rules.start_counts and not apart
        return msgspec.structs.replace(rules, events=tuple(events), start_counts=counts)

    @cached_property
    def _fly_bys(self) -> FlyBys:
        return FlyBys(self)

    @property
    def _end_row(self) -> int | None:
        """Row of the body at which tours end; None for any."""
        return None if self.ending is None else self.ending.row


def _stated(bound_m_s: float) -> float | UnsetType | None:
    """Return a largest speed as tour files state it, where no number is infinite."""
    return None if np.isinf(bound_m_s) else bound_m_s
