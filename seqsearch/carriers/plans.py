"""`Plan`: which orbits a mother ship uses and when; and how plans are screened.

All asteroids whose orbits she can get to are looked at: `Screen.candidates` are plans that keep to
one of them, `Screen.continued` those that go on to a second one, `Screen.valued` runs beams for
all probes of a plan. Plans with a third orbit are in `chains`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.predictor import LegPredictor
from feasibility.constants import AU
from feasibility.orbits import Catalogue
from seqsearch.carriers.chart_files import read_chart
from seqsearch.carriers.homing import DAYS_PER_VISIT, Homecoming, Homing, HomingSettings
from seqsearch.carriers.leg_chart import STEP_DAYS, ChartMaker, ChartPart, LegChart
from seqsearch.carriers.mother import later_budget, next_orbits
from seqsearch.carriers.routes import Route, Routes, refined_route, scan_routes
from seqsearch.core.nodes import Nodes
from seqsearch.problems.rendezvous import RendezvousProblem
from seqsearch.settings import SearchSettings
from seqsearch.tours.carrier.records import CarrierRules

_Array = NDArray[np.float64]
_Index = NDArray[np.intp]

SPREAD_DAYS: Final = 900.0
"""Time within which all probes are released; the rest is for the change of orbit."""

STAY_DAYS: Final = 30.0

OVERTIME_DAYS: Final = 60.0
"""By how much predicted tours may be too long: retiming makes them shorter."""

RELEASES_DAYS: Final = 30.0
"""Step of the release epochs that are tried."""

_LAUNCH_STEP_DAYS: Final = 40.0
_TOFS_DAYS: Final = np.arange(210.0, 750.0, 60.0)
_SCAN_DELTA_V: Final = 6400.0
"""m/s of a direct arc: moving its impulses saves a twentieth and more."""

_LONGEST_DAYS: Final = 1000.0
"""Longest way to the first orbit."""

_MOST_SECONDS: Final = 60
"""Second orbits that are rated for a plan."""

_ELEMENTS: Final = (3.0, 0.25, np.radians(10.0))
_CHART_ELEMENTS: Final = (3.05, 0.3, np.radians(12.0))
"""Largest a in AU, e and i of orbits that she uses, and of bodies that probes visit."""

_WAIT_DAYS: Final = STAY_DAYS + 1.0


@final
@dataclass(frozen=True)
class Plan:
    """The orbits of a mother ship, when the probes are released, and what that promises.

    With n probes.

    Attributes
    ----------
    orbits : tuple of int
        Catalogue rows of the asteroids whose orbits she is on, one after the other, all different.
        All probes are released on the first one.
    ends : tuple of int
        (n,) The orbit on which each probe is caught, as a position in `orbits`.
    windows_mjd2000 : tuple of tuple of float
        (n, 2) Earliest and latest departure of each probe to its first asteroid.
    value : float
        Predicted visits of a probe, the asteroids of the orbits included, and the share of a visit
        for which time is left.
    """

    orbits: tuple[int, ...]
    ends: tuple[int, ...]
    windows_mjd2000: tuple[tuple[float, float], ...]
    value: float = 0.0

    @classmethod
    def together(cls, orbits: tuple[int, ...], window_mjd2000: float, count: int) -> "Plan":
        """Return a plan whose probes are all caught on the last orbit.

        Parameters
        ----------
        orbits : tuple of int
            Catalogue rows.
        window_mjd2000 : float
            Earliest departure of all probes; the latest is `SPREAD_DAYS` later.
        count : int
            How many probes.
        """
        window = (window_mjd2000, window_mjd2000 + SPREAD_DAYS)
        return cls(orbits, (len(orbits) - 1,) * count, (window,) * count)

    @property
    def first(self) -> int:
        """Row of the orbit on which all probes are released."""
        return self.orbits[0]

    @property
    def begin_mjd2000(self) -> float:
        """Earliest departure of a probe."""
        return min(begin for begin, _ in self.windows_mjd2000)

    @property
    def last_mjd2000(self) -> float:
        """Latest departure of a probe."""
        return max(end for _, end in self.windows_mjd2000)

    def end(self, number: int) -> int:
        """Return the row of the orbit on which a probe is caught."""
        return self.orbits[self.ends[number]]

    def epochs(self, number: int, offset_days: float = 0.0) -> _Array:
        """Return departures of a probe to try, the first some days after the beginning."""
        begin, end = self.windows_mjd2000[number]
        return np.arange(min(begin + offset_days, end - 1.0), end, RELEASES_DAYS)

    def with_window(self, number: int, window_mjd2000: tuple[float, float]) -> "Plan":
        """Return the plan with another window of departures of one probe."""
        windows = list(self.windows_mjd2000)
        windows[number] = window_mjd2000
        return replace(self, windows_mjd2000=tuple(windows))

    def same(self, other: "Plan") -> bool:
        """Tell whether another plan has the same orbits."""
        return self.orbits == other.orbits


@final
class Screen:
    """Rates plans of one problem.

    Parameters
    ----------
    problem : RendezvousProblem
        One probe: bodies, masses, stays.
    rules : CarrierRules
        The mother ship.
    predictor : LegPredictor
        Predicts the probes' legs.
    settings : SearchSettings
        Of the search; its reserve counts.
    chart_folder : Path
        Where the chart is, or will be, from which all legs are looked up.
    launch_mjd2000 : tuple of float, optional
        Launches that are looked at; default: all that are allowed.
    """

    def __init__(
        self,
        problem: RendezvousProblem,
        rules: CarrierRules,
        predictor: LegPredictor,
        settings: SearchSettings,
        chart_folder: Path,
        launch_mjd2000: tuple[float, float] | None = None,
    ) -> None:
        self.catalogue: Catalogue = problem.catalogue
        self.rules = rules
        self.predictor = predictor
        self.chart_folder = chart_folder
        self.launch_mjd2000 = launch_mjd2000 or rules.launch_mjd2000
        self._routes: dict[tuple[int, float, float], Route | None] = {}
        self._homing: Homing | None = None
        self._reserve = settings.margin_reserve
        self.duration_days = problem.max_duration_days
        self._longer = replace(
            problem, max_duration_days=problem.max_duration_days + OVERTIME_DAYS
        )
        self._m0 = problem.m0

    def __getstate__(self) -> dict[str, object]:
        """Leave the chart behind: it is in its folder."""
        return {**self.__dict__, "_homing": None}

    @property
    def homing(self) -> Homing:
        """Beams over the chart, which has to be there.

        Raises
        ------
        InputError
            There is no chart, or it is damaged.
        """
        if self._homing is None:
            chart = read_chart(self.chart_folder)
            maker = self._maker(chart.rows, chart.t0_mjd2000)
            self._homing = Homing(chart, maker, self._longer, self._reserve)
        return self._homing

    def chart_intervals(self) -> int:
        """Return how many intervals the chart has: from first arrivals to last captures."""
        begin, last = self._chart_begin(), self.launch_mjd2000[1] + self.rules.max_duration_days
        return int(np.ceil((last - begin) / STEP_DAYS))

    def chart_part(self, k: int) -> ChartPart:
        """Return one interval of the chart."""
        return self._maker(self._chart_rows(), self._chart_begin()).part(k)

    def chart(self, parts: list[ChartPart]) -> LegChart:
        """Return the chart of all its intervals, and one more."""
        return LegChart.of_parts(self._chart_rows(), self._chart_begin(), parts)

    def _maker(self, rows: _Index, begin: float) -> ChartMaker:
        craft = self._longer.spacecraft
        return ChartMaker(self.catalogue, rows, craft, self._m0, self.predictor, begin)

    def _chart_begin(self) -> float:
        return self.launch_mjd2000[0] + float(_TOFS_DAYS[0]) + _WAIT_DAYS

    def _chart_rows(self) -> _Index:
        return self._below(_CHART_ELEMENTS)

    def _below(self, limits: tuple[float, float, float]) -> _Index:
        a, e, i = self.catalogue.elements[:, :3].T
        return np.flatnonzero((a < limits[0] * AU) & (e < limits[1]) & (i < limits[2]))

    def candidates(self, offset: float) -> list[Plan]:
        """Return plans that keep to one orbit, for all bodies and windows, unrated.

        Parameters
        ----------
        offset : float
            By what share of half a window all windows are moved.
        """
        routes = self.routes(self._below(_ELEMENTS))
        order = np.argsort(routes.row, kind="stable")
        bodies, begins = np.unique(routes.row[order], return_index=True)
        parts = np.split(order, begins[1:])
        return [
            Plan.together((int(row),), float(window), self.rules.craft_count)
            for row, part in zip(bodies, parts, strict=True)
            for window in self.windows(routes.take(part), offset)
        ]

    def routes(self, rows: _Index) -> Routes:
        """Return direct routes to bodies, cheap enough to be moved to within the budget."""
        first, last = self.launch_mjd2000
        return scan_routes(
            self.catalogue,
            rows,
            np.arange(first, last, _LAUNCH_STEP_DAYS),
            _TOFS_DAYS,
            v_inf=self.rules.v_inf_max_m_s,
            delta_v_max=_SCAN_DELTA_V,
        )

    def windows(self, routes: Routes, offset: float) -> _Array:
        """Return the beginnings of release windows that follow on routes to one body.

        They are half a window apart, and moved by a share of that.
        """
        arrivals = routes.launch_mjd2000 + routes.tof_days + _WAIT_DAYS
        latest = routes.launch_mjd2000 + self._latest_days()
        if len(arrivals) == 0:
            return np.zeros(0)
        step = 0.5 * SPREAD_DAYS
        steps = np.arange(arrivals.min() + offset * step, latest.max(), step)
        inside = (steps[:, None] >= arrivals) & (steps[:, None] <= latest)
        return steps[inside.any(axis=1)]

    def continued(self, plan: Plan) -> list[Plan]:
        """Return plans with the second orbits that she can go on to, cheapest first, unrated."""
        route = self.route(plan)
        if route is None:
            return []
        rows, _ = next_orbits(
            self.catalogue,
            plan.first,
            (plan.last_mjd2000, plan.begin_mjd2000 + self.duration_days),
            later_budget(self.rules, route.delta_v),
        )
        return [
            Plan.together((plan.first, int(row)), plan.begin_mjd2000, self.rules.craft_count)
            for row in rows[:_MOST_SECONDS]
        ]

    def valued(self, plan: Plan, settings: HomingSettings, probes: int) -> Plan:
        """Return a plan with its value; 0 where there are too few tours.

        It is the mean of the best predicted tours of the first probes, each of which leaves its
        asteroids to none that follow; and the asteroids at which the mother ship is at rest, less
        the stays there.
        """
        avoid: list[int] = []
        total = 0.0
        for number in range(probes):
            tours = self.tours(plan, number, settings, avoid)
            if not tours:
                return replace(plan, value=0.0)
            best = max(tours, key=lambda tour: tour.value(self.duration_days))
            total += best.value(self.duration_days)
            avoid += best.itinerary.rows[1:-1].tolist()
        return replace(plan, value=total / probes + self.at_rest(plan))

    def at_rest(self, plan: Plan) -> float:
        """Return what the asteroids of all orbits are worth, in visits of a probe."""
        each = 1.0 - _WAIT_DAYS / DAYS_PER_VISIT
        return each * len(plan.orbits) / self.rules.craft_count

    def tours(
        self,
        plan: Plan,
        number: int,
        settings: HomingSettings,
        avoid: Sequence[int] = (),
        offset_days: float = 0.0,
    ) -> list[Homecoming]:
        """Return predicted tours of one probe, best first."""
        epochs = plan.epochs(number, offset_days)
        starts = Nodes.at_start(
            np.full(len(epochs), plan.first), epochs, np.full(len(epochs), self._m0)
        )
        closed = np.unique([*plan.orbits, *avoid])
        return self.homing.run(starts, plan.end(number), closed, settings)

    def route(self, plan: Plan) -> Route | None:
        """Return the cheapest way to the first orbit that is in time; None for none."""
        key = plan.first, plan.begin_mjd2000, plan.last_mjd2000
        if key not in self._routes:
            self._routes[key] = self.cheapest_route(
                plan.first,
                plan.last_mjd2000 + self.duration_days - self.rules.max_duration_days,
                plan.begin_mjd2000 - _WAIT_DAYS,
            )
        return self._routes[key]

    def cheapest_route(
        self, row: int, earliest_mjd2000: float, arrival_mjd2000: float
    ) -> Route | None:
        """Return the cheapest way to a body, by the earliest launch and the latest arrival."""
        routes = self.routes(np.array([row]))
        launch = routes.launch_mjd2000
        early = launch + routes.tof_days <= arrival_mjd2000
        routes = routes.take(np.flatnonzero(early & (launch >= earliest_mjd2000)))
        best: Route | None = None
        body = self.catalogue.select(np.array([row]))
        for k in _apart(routes):
            launched = float(routes.launch_mjd2000[k])
            latest = min(_LONGEST_DAYS, arrival_mjd2000 - launched)
            found = refined_route(
                body,
                launched,
                float(routes.tof_days[k]),
                v_inf=self.rules.v_inf_max_m_s,
                window_mjd2000=(
                    max(self.launch_mjd2000[0], earliest_mjd2000),
                    self.launch_mjd2000[1],
                ),
                latest_arrival_days=latest,
            )
            in_time = found.second_mjd2000 <= arrival_mjd2000
            if in_time and (best is None or found.delta_v < best.delta_v):
                best = found
        return best

    def _latest_days(self) -> float:
        """Return days from the launch to the latest beginning of a window."""
        return self.rules.max_duration_days - self.duration_days - SPREAD_DAYS


_WAYS: Final = 3
_APART_DAYS: Final = 200.0


def _apart(routes: Routes) -> list[int]:
    """Return positions of the cheapest routes, launched far from each other."""
    chosen: list[int] = []
    for k in np.argsort(routes.delta_v, kind="stable"):
        launches = routes.launch_mjd2000[chosen]
        if np.all(np.abs(launches - routes.launch_mjd2000[k]) > _APART_DAYS):
            chosen.append(int(k))
        if len(chosen) == _WAYS:
            break
    return chosen
