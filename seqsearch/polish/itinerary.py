"""`Itinerary`: which bodies in which order, and when; nothing about how the legs are flown."""

from dataclasses import dataclass, field, replace
from typing import Self, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from feasibility import InputError, Legs
from feasibility.classifier.predictor import LegPredictor
from seqsearch.core.ending import Ending, ending_of
from seqsearch.core.problem import Problem
from seqsearch.core.way_home import SHORTEST_DAYS, ways_home
from seqsearch.tours.events.fly_by import FlyBy
from seqsearch.tours.events.launch import Launch
from seqsearch.tours.tour import Tour

_SLACK = 2e-6
"""Share of a largest speed that legs leave: solvers may exceed theirs by half of it."""


@final
@dataclass(frozen=True, eq=False)
class Itinerary:
    """A sequence of bodies and a timetable. With n the number of legs.

    Attributes
    ----------
    rows : (n + 1,) intp
        Catalogue rows of the bodies in order of visit.
    t_dep_mjd2000 : (n,) float64
        Departure epochs.
    tof_days : (n,) float64
        Flight times, positive.
    vinf_dep, vinf_arr : (n,) float64, m/s
        Largest excess velocities at departures and arrivals; 0 unless given.
    """

    rows: NDArray[np.intp]
    t_dep_mjd2000: NDArray[np.float64]
    tof_days: NDArray[np.float64]
    vinf_dep: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    vinf_arr: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        for name in ("vinf_dep", "vinf_arr"):
            if len(getattr(self, name)) == 0:
                object.__setattr__(self, name, np.zeros(len(self.tof_days)))

    def __len__(self) -> int:
        return len(self.tof_days)

    @property
    def n_asteroids(self) -> int:
        """Number of bodies, start and end included, whether they count or not."""
        return len(self.rows)

    @property
    def t_arr_mjd2000(self) -> NDArray[np.float64]:
        """(n,) arrival epochs."""
        return self.t_dep_mjd2000 + self.tof_days

    @property
    def duration_days(self) -> float:
        """Time from the first departure to the last arrival."""
        return float(self.t_arr_mjd2000[-1] - self.t_dep_mjd2000[0])

    @classmethod
    def from_tour(cls, problem: Problem, tour: Tour) -> Self:
        """Read sequence and timetable off a tour of this problem, with one leg or more.

        The first departure may be as fast as a launch of the problem, the last arrival as its
        rules allow.

        Raises
        ------
        InputError
            A body of the tour is not in the problem's catalogue, or visits are fly-bys: their
            legs cannot be flown one by one.
        """
        return cls(
            rows=problem.catalogue.rows_of([body.id for body in tour.bodies]).astype(np.intp),
            t_dep_mjd2000=np.array([leg.t_dep_mjd2000 for leg in tour.legs]),
            tof_days=np.array([leg.tof_days for leg in tour.legs]),
        ).with_ends_of(problem)

    def with_ends_of(self, problem: Problem) -> Self:
        """Return the itinerary as that of a whole tour, with the excess speeds of its ends.

        The last arrival may have some only at the body at which tours end, if there is one.

        Raises
        ------
        InputError
            Visits are fly-bys.
        """
        launch, arrival = excess_speeds(problem)
        ending = ending_of(problem)
        vinf_dep, vinf_arr = np.zeros(len(self)), np.zeros(len(self))
        vinf_dep[:1] = launch
        if ending is None or ending.row in (None, int(self.rows[-1])):
            vinf_arr[-1:] = arrival
        return replace(self, vinf_dep=vinf_dep, vinf_arr=vinf_arr)

    def legs(self, problem: Problem, m0: ArrayLike) -> Legs:
        """Return the n legs at the given initial masses in kg.

        Their dry mass is zero: a timetable under construction may use more
        propellant than there is, and whoever builds it keeps the account.
        """
        catalogue, craft = problem.catalogue, problem.spacecraft
        return Legs(
            rv_dep=catalogue.states_at(self.rows[:-1], self.t_dep_mjd2000),
            rv_arr=catalogue.states_at(self.rows[1:], self.t_arr_mjd2000),
            tof_days=self.tof_days,
            m0=m0,
            thrust=craft.thrust,
            isp=craft.isp,
            m_dry=0.0,
            vinf_dep=(1.0 - _SLACK) * self.vinf_dep,
            vinf_arr=(1.0 - _SLACK) * self.vinf_arr,
        )

    def appended(self, row: int, t_dep_mjd2000: float, tof_days: float) -> Self:
        """Return the itinerary with one more leg, to the body of a catalogue row."""
        return type(self)(
            np.append(self.rows, row),
            np.append(self.t_dep_mjd2000, t_dep_mjd2000),
            np.append(self.tof_days, tof_days),
            np.append(self.vinf_dep, 0.0),
            np.append(self.vinf_arr, 0.0),
        )

    def ended(
        self, problem: Problem, ending: Ending, predictor: LegPredictor, mass: float
    ) -> Self:
        """Return the itinerary with a leg to the end of its tours, if it is not there yet.

        The leg is the one of the predictor's that arrives first, or that is nearest to being
        flyable. `mass` in kg is what is left after the last leg.
        """
        if ending.row is None or self.rows[-1] == ending.row:
            return self
        node = replace(
            problem.start_nodes(self.rows[-1:], self.t_arr_mjd2000[-1:]),
            depth=np.ones(1, dtype=np.int64),
            visited=self.rows[None, -2:],
            t_ready_mjd2000=self.t_arr_mjd2000[-1:] + problem.min_stay_days,
            t_first_mjd2000=self.t_dep_mjd2000[:1],
            mass=np.array([mass]),
        )
        ways = ways_home(problem, ending, node, predictor)
        if len(ways) == 0:
            departure = float(node.t_ready_mjd2000[0])
            return self.appended(ending.row, departure, SHORTEST_DAYS).with_ends_of(problem)
        log = np.nan_to_num(ways.log_margin, nan=0.0)
        cost = np.where(log >= 0.0, ways.t_dep_mjd2000 + ways.tof_days, 1e9 - log)
        best = int(np.argmin(cost))
        return self.appended(
            ending.row, float(ways.t_dep_mjd2000[best]), float(ways.tof_days[best])
        ).with_ends_of(problem)

    def part(self, first: int, last: int) -> Self:
        """Return the bodies from one position to another, both included, and their legs."""
        return type(self)(
            self.rows[first : last + 1],
            self.t_dep_mjd2000[first:last],
            self.tof_days[first:last],
            self.vinf_dep[first:last],
            self.vinf_arr[first:last],
        )


def excess_speeds(problem: Problem) -> tuple[float, float]:
    """Return m/s, the largest excess speeds of the first departure and of the last arrival.

    Raises
    ------
    InputError
        Visits are fly-bys: their legs cannot be flown one by one.
    """
    launch = arrival = 0.0
    rules = problem.tour_rules()
    for event in rules.events:
        if isinstance(event, Launch):
            launch = event.speed_max_m_s
        if isinstance(event, FlyBy):
            if event.visit_bound(last=False) > 0.0:
                raise InputError(f"problem {rules.name}: its visits are fly-bys, expected rest")
            arrival = event.visit_bound(last=True)
    return launch, arrival
