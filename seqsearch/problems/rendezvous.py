"""`RendezvousProblem`: everything that defines a tour of rendezvous, not how to find one."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Final, final

import numpy as np
from msgspec import UNSET, UnsetType
from numpy.typing import NDArray

from feasibility import InputError, Legs, Spacecraft
from feasibility.constants import MJD2000_MJD
from feasibility.orbits import Catalogue
from seqsearch.core.custom_moves import CustomMoves
from seqsearch.core.hops import Hops
from seqsearch.core.mission import days_until_end, not_visited, used_up
from seqsearch.core.nodes import Nodes
from seqsearch.core.tree import FlownLeg
from seqsearch.settings import SearchSettings
from seqsearch.tours.records import KernelFile
from seqsearch.tours.tour import TourRules

_MAX_ACCELERATION: Final = 0.01
"""m/s2; electric engines give 1e-5 to 1e-3."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class RendezvousProblem:
    """A multi-rendezvous problem: one spacecraft, many bodies, as many visits as possible.

    With n the number of bodies of the catalogue. The clock runs from the first
    departure to the last arrival.

    Parameters
    ----------
    name : str
        Name, for reports.
    catalogue : Catalogue
        The n bodies that may be visited.
    spacecraft : Spacecraft
        Dry mass, thrust and specific impulse.
    m0 : float
        Initial (wet) mass in kg at the first departure.
    first_departure_mjd2000 : tuple of float
        Earliest and latest epoch of the first departure.
    max_duration_days : float
        Longest time from the first departure to the last arrival.
    min_stay_days : float
        Shortest time between an arrival and the next departure.
    start_ids : tuple of int, optional
        Ids of the bodies at which a tour may start; empty for any.
    sequence : tuple of int, optional
        Ids of the bodies that are to be visited, in this order; empty for any.

    Raises
    ------
    InputError
        A value is not finite or out of range, the wet mass is below the dry
        mass, the catalogue is empty, or a start id or an id of the sequence is not in it; the
        sequence has one body alone, or one twice.
    """

    name: str
    catalogue: Catalogue
    spacecraft: Spacecraft
    m0: float
    first_departure_mjd2000: tuple[float, float]
    max_duration_days: float
    min_stay_days: float
    start_ids: tuple[int, ...] = ()
    sequence: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        numbers = {
            "wet mass": self.m0,
            "first departure (earliest)": self.first_departure_mjd2000[0],
            "first departure (latest)": self.first_departure_mjd2000[1],
            "max_duration_days": self.max_duration_days,
            "min_stay_days": self.min_stay_days,
        }
        for label, value in numbers.items():
            if not np.isfinite(value):
                raise InputError(f"problem {self.name}: {label} is {value}, expected a number")
        if self.m0 <= 0:
            raise InputError(
                f"problem {self.name}: wet mass {self.m0:g} kg, expected more than zero"
            )
        if self.m0 <= self.spacecraft.m_dry:
            raise InputError(
                f"problem {self.name}: dry mass {self.spacecraft.m_dry:g} kg is not below the "
                f"wet mass {self.m0:g} kg"
            )
        acceleration = self.spacecraft.thrust / self.m0
        if acceleration > _MAX_ACCELERATION:
            raise InputError(
                f"problem {self.name}: thrust {self.spacecraft.thrust:g} N on {self.m0:g} kg is "
                f"{acceleration:.2g} m/s2; is it in mN?"
            )
        earliest, latest = self.first_departure_mjd2000
        if latest < earliest:
            raise InputError(
                f"problem {self.name}: first departure window ends ({latest + MJD2000_MJD:g} MJD) "
                f"before it begins ({earliest + MJD2000_MJD:g} MJD)"
            )
        if self.max_duration_days <= 0:
            raise InputError(
                f"problem {self.name}: max_duration_days = {self.max_duration_days:g}, "
                "expected more than zero"
            )
        if self.min_stay_days < 0:
            raise InputError(
                f"problem {self.name}: min_stay_days = {self.min_stay_days:g}, "
                "expected zero or more"
            )
        self._check_sequence()
        if len(self.catalogue) < 2:
            raise InputError(
                f"problem {self.name}: the catalogue {self.catalogue.source} holds "
                f"{len(self.catalogue)} bodies, expected at least two"
            )
        self.start_rows()

    def start_rows(self) -> NDArray[np.intp]:
        """Return the catalogue rows of the bodies at which a tour may start.

        Raises
        ------
        InputError
            A start id is not in the catalogue.
        """
        if self.sequence:
            return self._sequence_rows[:1]
        if not self.start_ids:
            return np.arange(len(self.catalogue))
        return np.asarray(self.catalogue.rows_of(np.asarray(self.start_ids)), dtype=np.intp)

    @property
    def custom_moves(self) -> CustomMoves | None:
        """None: near neighbours and a range of flight times fit."""
        return None

    def start_nodes(self, rows: NDArray[np.intp], t_mjd2000: NDArray[np.float64], /) -> Nodes:
        """Return the (k,) nodes at bodies and epochs, with full tanks."""
        return Nodes.at_start(rows, t_mjd2000, np.full(len(rows), self.m0))

    def may_visit(self, nodes: Nodes, target: NDArray[np.intp], /) -> NDArray[np.bool_]:
        """Return (n, t) whether targets, catalogue rows (n, t), were not visited before.

        Where there is a sequence: whether they are next in it.
        """
        if not self.sequence:
            return not_visited(nodes, target)
        # No row follows the last body of the sequence.
        following = np.append(self._sequence_rows, -1)[nodes.depth + 1]
        allowed: NDArray[np.bool_] = target == following[:, None]
        return allowed

    def days_left(
        self, nodes: Nodes, t_dep_mjd2000: NDArray[np.float64], /
    ) -> NDArray[np.float64]:
        """Return (n, d) days until the longest duration is over; -inf outside the window."""
        return days_until_end(
            nodes, t_dep_mjd2000, self.first_departure_mjd2000[1], self.max_duration_days
        )

    def hops(
        self,
        nodes: Nodes,
        parent: NDArray[np.intp],
        target: NDArray[np.intp],
        t_dep_mjd2000: NDArray[np.float64],
        tof_days: NDArray[np.float64],
        /,
    ) -> Hops:
        """Return the (k,) hops, each a single leg; see `Problem.hops`."""
        catalogue, craft = self.catalogue, self.spacecraft
        row = nodes.row[parent]
        legs = Legs(
            rv_dep=catalogue.states_at(row, t_dep_mjd2000),
            rv_arr=catalogue.states_at(target, t_dep_mjd2000 + tof_days),
            tof_days=tof_days,
            m0=nodes.mass[parent],
            thrust=craft.thrust,
            isp=craft.isp,
            m_dry=craft.m_dry,
            t_dep_mjd2000=t_dep_mjd2000,
            dep_id=catalogue.ids[row],
            arr_id=catalogue.ids[target],
        )
        return Hops((legs,), (np.zeros(len(legs)),))

    def closing(self, row: int, t_mjd2000: float, mass: float, /) -> tuple[FlownLeg, ...]:  # noqa: ARG002
        """Return no legs: a tour is complete after any visit."""
        return ()

    def tour_cost(self, nodes: Nodes, settings: SearchSettings, /) -> NDArray[np.float64]:
        """Return (n,) the weighted shares of time and propellant that are used up."""
        return used_up(
            nodes,
            max_duration_days=self.max_duration_days,
            m0=self.m0,
            m_dry=self.spacecraft.m_dry,
            time_weight=settings.time_weight,
            propellant_weight=settings.propellant_weight,
        )

    def tour_rules(self) -> TourRules:
        """Return the numbers of the problem; every visited body counts one."""
        craft = self.spacecraft
        return TourRules(
            name=self.name,
            catalogue=Path(self.catalogue.source).name,
            m0_kg=self.m0,
            m_dry_kg=craft.m_dry,
            thrust_n=craft.thrust,
            isp_s=craft.isp,
            first_departure_mjd2000=self.first_departure_mjd2000,
            max_duration_days=self.max_duration_days,
            min_stay_days=self.min_stay_days,
            start_ids=self.sequence[:1] or self.start_ids,
            kernels=_kernels_of(self.catalogue),
        )

    @cached_property
    def _sequence_rows(self) -> NDArray[np.intp]:
        return np.asarray(self.catalogue.rows_of(np.asarray(self.sequence)), dtype=np.intp)

    def _check_sequence(self) -> None:
        if not self.sequence:
            return
        twice = [body for body in self.sequence if self.sequence.count(body) > 1]
        if twice or len(self.sequence) < 2:
            found = f"{twice[0]} more than once" if twice else "one body"
            raise InputError(
                f"problem {self.name}: sequence has {found}, expected two or more different ids"
            )
        if self.start_ids and self.sequence[0] not in self.start_ids:
            raise InputError(
                f"problem {self.name}: sequence begins at {self.sequence[0]}, "
                f"expected one of start_ids {self.start_ids}"
            )


def _kernels_of(catalogue: Catalogue) -> tuple[KernelFile, ...] | UnsetType:
    if catalogue.ephemeris is None:
        return UNSET
    sources = catalogue.ephemeris.sources
    return tuple(KernelFile(name=source.name, sha256=source.sha256) for source in sources)
