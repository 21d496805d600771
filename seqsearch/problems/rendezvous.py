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
from seqsearch.core.ending import Ending
from seqsearch.core.hops import Hops
from seqsearch.core.mission import days_until_end, not_visited, used_up
from seqsearch.core.nodes import Nodes
from seqsearch.core.recording import tour_body
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
        Ids of the bodies that are to be visited, in this order; empty for any. It begins at the
        start body, unless that has no score, and the body at which tours end may be left out.
    end_id : int, optional
        Id of the body at which tours end, within the longest duration; default: at any. It may
        be the start body, and there is no stay.
    must_visit : tuple of int, optional
        Ids of bodies that a tour has to visit, in any order.
    unscored_ids : tuple of int, optional
        Ids of bodies that do not count, such as the Earth or the orbit of a mother ship: tours
        start and end there, and never visit them in between.
    excluded_ids : tuple of int, optional
        Ids of bodies that are not visited; they may be those of another probe.

    Raises
    ------
    InputError
        A value is not finite or out of range, the wet mass is below the dry
        mass, the catalogue is empty, or an id is not in it; the sequence has one body alone, or
        one twice; a body must be visited and must not.

    Examples
    --------
    From the Earth and back to it, with as many asteroids as possible on the way:

    >>> import numpy as np
    >>> from feasibility import Spacecraft
    >>> from feasibility.orbits import earth, synthetic_main_belt
    >>> belt = synthetic_main_belt(100, np.random.default_rng(0))
    >>> problem = RendezvousProblem(
    ...     name="return",
    ...     catalogue=belt.select(belt.ids > 0).with_bodies(earth()),
    ...     spacecraft=Spacecraft(m_dry=500.0, thrust=0.5, isp=3000.0),
    ...     m0=2000.0,
    ...     first_departure_mjd2000=(10000.0, 10400.0),
    ...     max_duration_days=3000.0,
    ...     min_stay_days=30.0,
    ...     start_ids=(0,),
    ...     end_id=0,
    ...     unscored_ids=(0,),
    ... )
    >>> problem.ending.row
    100
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
    end_id: int | None = None
    must_visit: tuple[int, ...] = ()
    unscored_ids: tuple[int, ...] = ()
    excluded_ids: tuple[int, ...] = ()

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
        self._check_ends()
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
        if self.sequence and not self._starts_apart:
            return self._sequence_rows[:1]
        if not self.start_ids:
            return np.setdiff1d(np.arange(len(self.catalogue)), self.rows_to_avoid)
        return np.asarray(self.catalogue.rows_of(np.asarray(self.start_ids)), dtype=np.intp)

    @property
    def custom_moves(self) -> CustomMoves | None:
        """None: near neighbours and a range of flight times fit."""
        return None

    @cached_property
    def rows_to_avoid(self) -> NDArray[np.intp]:
        """Rows that are not visited on the way: without a score, excluded, or the end."""
        end = () if self.end_id is None else (self.end_id,)
        ids = sorted({*self.unscored_ids, *self.excluded_ids, *end})
        return self._rows_of(tuple(ids))

    @cached_property
    def ending(self) -> Ending | None:
        """What a tour needs to be complete; None where it is after any visit."""
        if self.end_id is None and not self.must_visit:
            return None
        return Ending(
            row=None if self.end_id is None else int(self._rows_of((self.end_id,))[0]),
            required=self._rows_of(self.must_visit),
            last_start_mjd2000=self.first_departure_mjd2000[1],
            max_duration_days=self.max_duration_days,
        )

    def start_nodes(self, rows: NDArray[np.intp], t_mjd2000: NDArray[np.float64], /) -> Nodes:
        """Return the (k,) nodes at bodies and epochs, with full tanks."""
        return Nodes.at_start(rows, t_mjd2000, np.full(len(rows), self.m0))

    def may_visit(self, nodes: Nodes, target: NDArray[np.intp], /) -> NDArray[np.bool_]:
        """Return (n, t) whether targets, catalogue rows (n, t), were not visited before.

        Where there is a sequence: whether they are next in it.
        """
        if self.sequence:
            # No row follows the last body of the sequence.
            following = np.append(self._sequence_rows, -1)[nodes.depth + 1]
            allowed: NDArray[np.bool_] = target == following[:, None]
            return allowed
        fresh = not_visited(nodes, target)
        return fresh & self._open[target] if len(self.rows_to_avoid) else fresh

    def days_left(
        self, nodes: Nodes, t_dep_mjd2000: NDArray[np.float64], /
    ) -> NDArray[np.float64]:
        """Return (n, d) days until the longest duration is over; -inf outside the window."""
        # Before the flight to the end there is a stay.
        last_stay = 0.0 if self.end_id is None else self.min_stay_days
        return days_until_end(
            nodes,
            t_dep_mjd2000,
            self.first_departure_mjd2000[1],
            self.max_duration_days - last_stay,
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
        """Return no legs; a search flies those to the end itself, see `ending`."""
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
        """Return the numbers of the problem; every visited body that has a score counts one."""
        craft = self.spacecraft
        begins = self.start_ids if self._starts_apart else self.sequence[:1] or self.start_ids
        ends = [*begins, *(() if self.end_id is None else (self.end_id,))]
        unscored = [body for body in dict.fromkeys(ends) if body in self.unscored_ids]
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
            start_ids=begins,
            kernels=_kernels_of(self.catalogue),
            end_id=UNSET if self.end_id is None else self.end_id,
            must_visit=self.must_visit or UNSET,
            unscored=tuple(
                tour_body(self.catalogue, int(row)) for row in self._rows_of(tuple(unscored))
            )
            or UNSET,
        )

    @cached_property
    def _sequence_rows(self) -> NDArray[np.intp]:
        """Rows in order of visit by their depth, without the end; -1 for starts apart."""
        rows = self._rows_of(self.sequence)
        if self.sequence[-1] == self.end_id:
            rows = rows[:-1]
        return np.insert(rows, 0, -1) if self._starts_apart else rows

    @cached_property
    def _open(self) -> NDArray[np.bool_]:
        """(n,) whether each body may be visited at all."""
        open_ = np.ones(len(self.catalogue), dtype=np.bool_)
        open_[self.rows_to_avoid] = False
        return open_

    @property
    def _starts_apart(self) -> bool:
        """Whether tours start at bodies without a score, which a sequence need not name."""
        return bool(
            self.sequence
            and self.start_ids
            and set(self.start_ids) <= set(self.unscored_ids)
            and self.sequence[0] not in self.start_ids
        )

    def _rows_of(self, ids: tuple[int, ...]) -> NDArray[np.intp]:
        wanted = np.asarray(ids, dtype=np.int64)
        return np.asarray(self.catalogue.rows_of(wanted), dtype=np.intp)

    def _check_sequence(self) -> None:
        if not self.sequence:
            return
        twice = [body for body in self.sequence if self.sequence.count(body) > 1]
        if self.sequence[0] == self.end_id and twice == [self.end_id] * 2:
            twice = []
        if twice or len(self.sequence) < 2:
            found = f"{twice[0]} more than once" if twice else "one body"
            raise InputError(
                f"problem {self.name}: sequence has {found}, expected two or more different ids"
            )
        if self.start_ids and self.sequence[0] not in self.start_ids and not self._starts_apart:
            raise InputError(
                f"problem {self.name}: sequence begins at {self.sequence[0]}, "
                f"expected one of start_ids {self.start_ids}"
            )

    def _check_ends(self) -> None:
        """Check that what tours have to visit is not forbidden, and that all ids are known."""
        forbidden = set(self.rows_to_avoid.tolist())
        clash = [row for row in self._rows_of(self.must_visit).tolist() if row in forbidden]
        if clash:
            raise InputError(
                f"problem {self.name}: body {self.catalogue.ids[clash[0]]} is among must_visit, "
                "but excluded, without a score or the end; expected one of the two"
            )
        way = self._sequence_rows[1:] if self.sequence else self.rows_to_avoid[:0]
        closed = [row for row in way.tolist() if row in forbidden]
        if closed:
            raise InputError(
                f"problem {self.name}: body {self.catalogue.ids[closed[0]]} is on the way of the "
                "sequence, but excluded, without a score or the end"
            )


def _kernels_of(catalogue: Catalogue) -> tuple[KernelFile, ...] | UnsetType:
    if catalogue.ephemeris is None:
        return UNSET
    sources = catalogue.ephemeris.sources
    return tuple(KernelFile(name=source.name, sha256=source.sha256) for source in sources)
