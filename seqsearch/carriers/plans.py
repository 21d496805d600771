"""`Plan`: which two orbits a mother ship uses and when; and how plans are screened.

All asteroids with near neighbours whose orbits she can get to are looked at: `Screen.rate` runs
narrow beams from each and back to it, `Screen.seconds` looks for the best second orbit.
"""

from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from feasibility.classifier.predictor import LegPredictor
from feasibility.constants import AU, YEAR_DAYS
from feasibility.orbits import Catalogue
from feasibility.orbits.neighbours import orbital_metric
from seqsearch.carriers.homing import Homecoming, Homing, HomingSettings
from seqsearch.carriers.mother import later_budget, next_orbits
from seqsearch.carriers.routes import Route, Routes, refined_route, scan_routes
from seqsearch.core.nodes import Nodes
from seqsearch.problems.rendezvous import RendezvousProblem
from seqsearch.settings import SearchSettings
from seqsearch.tours.carrier.records import CarrierRules

_Array = NDArray[np.float64]
_Index = NDArray[np.intp]

SPREAD_DAYS: Final = 700.0
"""Time within which all probes are released; the rest is for the change of orbit."""

STAY_DAYS: Final = 30.0

OVERTIME_DAYS: Final = 80.0
"""By how much predicted tours may be too long: retiming shortens them."""

_RELEASES_DAYS: Final = 60.0
"""Step of the release epochs that are tried."""

_LAUNCH_STEP_DAYS: Final = 40.0
_TOFS_DAYS: Final = np.arange(210.0, 750.0, 60.0)
_SCAN_DELTA_V: Final = 6400.0
"""m/s of a direct arc: moving its impulses saves a twentieth and more."""

_LONGEST_DAYS: Final = 1000.0
"""Longest way to the first orbit."""

_CROWD_DAYS: Final = 150.0
_CROWD_SPEED: Final = 2500.0
_CROWD_STEP_DAYS: Final = 240.0
"""Metric, distance in m/s and step of the epochs at which neighbours are counted."""

_MOST_SECONDS: Final = 30
"""Second orbits that are rated for a plan."""

_SPARE_BODIES: Final = 3
"""Bodies for which routes are looked for, for each that is wanted."""

_ELEMENTS: Final = (3.0, 0.25, np.radians(10.0))
"""Largest a in AU, e and i of orbits that are looked at."""

_WAIT_DAYS: Final = STAY_DAYS + 1.0


@final
@dataclass(frozen=True)
class Plan:
    """Two orbits, when the probes are released, and what that promises.

    Attributes
    ----------
    first, second : int
        Catalogue rows of the asteroids whose orbits they are; they may be equal.
    window_mjd2000 : float
        Earliest departure of a probe to its first asteroid; the latest is `SPREAD_DAYS` later.
    value : float
        Predicted visits of one probe, and the share of a visit for which time is left.
    """

    first: int
    second: int
    window_mjd2000: float
    value: float

    def epochs(self, offset_days: float = 0.0) -> _Array:
        """Return the departures that are tried, the first some days after the beginning."""
        end = self.window_mjd2000 + SPREAD_DAYS
        return np.arange(self.window_mjd2000 + offset_days, end, _RELEASES_DAYS)

    def same(self, other: "Plan") -> bool:
        """Tell whether another plan has the same orbits."""
        return (self.first, self.second) == (other.first, other.second)


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
        Of the beams.
    """

    def __init__(
        self,
        problem: RendezvousProblem,
        rules: CarrierRules,
        predictor: LegPredictor,
        settings: SearchSettings,
    ) -> None:
        self.catalogue: Catalogue = problem.catalogue
        self.rules = rules
        self.predictor = predictor
        self._routes: dict[tuple[int, float], Route | None] = {}
        self.duration_days = problem.max_duration_days
        longer = replace(problem, max_duration_days=problem.max_duration_days + OVERTIME_DAYS)
        self.homing = Homing(longer, predictor, settings)
        self._m0 = problem.m0

    def crowded(self, count: int) -> _Index:
        """Return rows of bodies that she can get to, most neighbours first."""
        a, e, i = self.catalogue.elements[:, :3].T
        limits = np.array(_ELEMENTS) * (AU, 1.0, 1.0)
        rows = np.flatnonzero((a < limits[0]) & (e < limits[1]) & (i < limits[2]))
        first, last = self.rules.launch_mjd2000
        epochs = np.arange(first + YEAR_DAYS, last + 11 * YEAR_DAYS, _CROWD_STEP_DAYS)
        counts = np.zeros(len(rows))
        for epoch in epochs:
            points = orbital_metric(self.catalogue.states(float(epoch)), _CROWD_DAYS)
            near = cKDTree(points).query_ball_point(points[rows], _CROWD_SPEED, return_length=True)
            counts += np.asarray(near, dtype=np.float64)
        rows = rows[np.argsort(-counts, kind="stable")[: _SPARE_BODIES * count]]
        within = np.isin(rows, self.routes(rows).row)
        return rows[within][:count]

    def routes(self, rows: _Index) -> Routes:
        """Return direct routes to bodies, cheap enough to be moved to within the budget."""
        first, last = self.rules.launch_mjd2000
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

    def rate(self, row: int, width: int, offset: float = 0.0) -> list[Plan]:
        """Return plans that keep to one orbit, one a window."""
        windows = self.windows(self.routes(np.array([row])), offset)
        plans = [self.valued(Plan(row, row, float(window), 0.0), width) for window in windows]
        return [plan for plan in plans if plan.value > 0.0]

    def continued(self, plan: Plan) -> list[Plan]:
        """Return plans with the second orbits that she can go on to, cheapest first, unrated."""
        route = self.route(plan)
        if route is None:
            return []
        rows, _ = next_orbits(
            self.catalogue,
            plan.first,
            (plan.window_mjd2000 + SPREAD_DAYS, plan.window_mjd2000 + self.duration_days),
            later_budget(self.rules, route.delta_v),
        )
        return [replace(plan, second=int(row), value=0.0) for row in rows[:_MOST_SECONDS]]

    def valued(self, plan: Plan, width: int) -> Plan:
        """Return a plan with its value: that of its best predicted tour; 0 for none."""
        tours = self.tours(plan, HomingSettings(width=width, results=1))
        values = [tour.value(self.duration_days) for tour in tours]
        return replace(plan, value=max(values, default=0.0))

    def tours(
        self,
        plan: Plan,
        settings: HomingSettings,
        avoid: tuple[int, ...] = (),
        offset_days: float = 0.0,
    ) -> list[Homecoming]:
        """Return predicted tours of one probe, best first."""
        epochs = plan.epochs(offset_days)
        starts = Nodes.at_start(
            np.full(len(epochs), plan.first), epochs, np.full(len(epochs), self._m0)
        )
        closed = np.unique([plan.first, plan.second, *avoid])
        return self.homing.run(starts, plan.second, closed, settings)

    def route(self, plan: Plan) -> Route | None:
        """Return the cheapest way to the first orbit that is in time; None for none."""
        key = plan.first, plan.window_mjd2000
        if key not in self._routes:
            self._routes[key] = self._cheapest(plan)
        return self._routes[key]

    def _cheapest(self, plan: Plan) -> Route | None:
        routes = self.routes(np.array([plan.first]))
        launch = routes.launch_mjd2000
        early = launch + routes.tof_days + _WAIT_DAYS <= plan.window_mjd2000
        late = launch + self._latest_days() >= plan.window_mjd2000
        routes = routes.take(np.flatnonzero(early & late))
        best: Route | None = None
        body = self.catalogue.select(np.array([plan.first]))
        for k in _apart(routes):
            launched = float(routes.launch_mjd2000[k])
            latest = min(_LONGEST_DAYS, plan.window_mjd2000 - _WAIT_DAYS - launched)
            found = refined_route(
                body,
                launched,
                float(routes.tof_days[k]),
                v_inf=self.rules.v_inf_max_m_s,
                window_mjd2000=(
                    max(self.rules.launch_mjd2000[0], plan.window_mjd2000 - self._latest_days()),
                    self.rules.launch_mjd2000[1],
                ),
                latest_arrival_days=latest,
            )
            in_time = found.second_mjd2000 + _WAIT_DAYS <= plan.window_mjd2000
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
