"""A mother ship and her probes polished together, in a small synthetic belt."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from feasibility import Legs, Spacecraft
from feasibility.orbits import synthetic_main_belt
from feasibility.orbits.neighbours import orbital_metric
from seqsearch.carriers.campaign import CampaignState
from seqsearch.carriers.crew import MISSION_DAYS, WAIT_DAYS, Crew, fitted, own_problem
from seqsearch.carriers.crew_schedule import schedule_of
from seqsearch.carriers.flight import captures_of, carrier_of, releases_of
from seqsearch.carriers.joint import LATE_DAYS, Wishes, _gap, joined
from seqsearch.carriers.mother import later_budget, next_orbits
from seqsearch.carriers.plans import Plan, Screen
from seqsearch.carriers.schedule import Act, Step
from seqsearch.carriers.state_files import read_state, write_state
from seqsearch.polish.itinerary import Itinerary
from seqsearch.problems.gtoc7.rules import carrier_rules
from seqsearch.problems.rendezvous import RendezvousProblem
from seqsearch.pruning.pruner_spec import parse_pruner, predictor_of
from seqsearch.settings import SearchSettings
from seqsearch.tours.carrier.path import fly_carrier

WISHES = Wishes((1.0, 1.0, 1.0), days_per_kg=0.0)
"""The tours of this belt are short of time alone."""

VISITS = 3


@pytest.fixture(scope="module")
def problem():
    return RendezvousProblem(
        name="belt",
        catalogue=synthetic_main_belt(8000, np.random.default_rng(7)),
        spacecraft=Spacecraft(m_dry=800.0, thrust=0.3, isp=3000.0),
        m0=2000.0,
        first_departure_mjd2000=(7671.0, 13514.0),
        max_duration_days=MISSION_DAYS,
        min_stay_days=30.0,
    )


@pytest.fixture(scope="module")
def screen(problem, tmp_path_factory):
    predictor = predictor_of(parse_pruner("default:0.99"))
    folder = tmp_path_factory.mktemp("joint") / "chart"
    return Screen(problem, carrier_rules(), predictor, SearchSettings(), folder)


def leg_times(problem, screen, row, goals, t, mass):
    """Return how long the shortest predicted flights to some bodies take, and what is left."""
    tof = np.arange(100.0, 600.0, 15.0)
    rows, days = np.repeat(goals, len(tof)), np.tile(tof, len(goals))
    craft = problem.spacecraft
    legs = Legs(
        rv_dep=problem.catalogue.states_at(np.full(len(rows), row), t),
        rv_arr=problem.catalogue.states_at(rows, t + days),
        tof_days=days,
        m0=mass,
        thrust=craft.thrust,
        isp=craft.isp,
        m_dry=craft.m_dry,
    )
    good = screen.predictor.margin(legs).reshape(-1, len(tof)) > 1.03
    best = np.argmax(good, axis=1)
    left = screen.predictor.final_mass(legs).reshape(-1, len(tof))
    found = good.any(axis=1)
    return np.where(found, tof[best], np.inf), left[np.arange(len(goals)), best]


def tour(problem, screen, plan, number, t, closed):
    """Return the flight of a probe that goes to the nearest body again and again, then home."""
    rows, departures, flights, mass = [plan.first], [], [], problem.m0
    for _ in range(VISITS):
        points = orbital_metric(problem.catalogue.states(t + 150.0), 180.0)
        order = np.argsort(np.linalg.norm(points - points[rows[-1]], axis=1))
        near = np.setdiff1d(order[:60], [*rows, *closed, *plan.orbits])
        days, left = leg_times(problem, screen, rows[-1], near, t, mass)
        best = int(np.argmin(days))
        if not np.isfinite(days[best]):
            return None
        rows.append(int(near[best]))
        departures.append(t)
        flights.append(float(days[best]))
        mass, t = float(left[best]), t + float(days[best]) + 30.0
    days, _ = leg_times(problem, screen, rows[-1], np.array([plan.end(number)]), t, mass)
    if not np.isfinite(days[0]):
        return None
    timetable = np.array([*departures, t]), np.array([*flights, float(days[0])])
    own = own_problem(problem, Crew(plan, ()), number)
    flight = fitted(own, Itinerary(np.array([*rows, plan.end(number)]), *timetable))
    for _ in range(5):
        flight = None if flight is None else fitted(own, flight.itinerary)
    return flight


@pytest.fixture(scope="module")
def crew(problem, screen):
    """Return three probes of which the first has time for a stay at both ends."""
    catalogue = screen.catalogue
    a, e, i = catalogue.elements[:, :3].T
    rows = np.flatnonzero((a < 4.2e11) & (e < 0.1) & (i < 0.06))[:40]
    routes = screen.routes(rows)
    order = np.argsort(routes.delta_v, kind="stable")
    for k in order[:10]:
        first, window = int(routes.row[k]), float(routes.launch_mjd2000[k] + 900.0)
        route = screen.route(Plan.together((first,), window, 3))
        if route is None:
            continue
        between = window + 250.0, window + 1200.0
        most = 0.9 * later_budget(screen.rules, route.delta_v)
        seconds, _ = next_orbits(catalogue, first, between, most)
        for second in seconds[:3]:
            plan = Plan.together((first, int(second)), window, 3)
            flights = []
            for number, late in enumerate((40.0, 120.0, 240.0)):
                closed = [row for flight in flights for row in flight.itinerary.rows]
                flight = tour(problem, screen, plan, number, window + late, closed)
                if flight is None:
                    break
                flights.append(flight)
            found = Crew(plan, tuple(flights))
            if len(flights) == 3 and carrier_of(screen, found) is not None:
                return found
    raise AssertionError("no crew in this belt")


@pytest.fixture(scope="module")
def polished(problem, screen, crew):
    for seed in range(6):
        rng = np.random.default_rng(seed)
        found = joined(screen, problem, crew, WISHES, rng=rng, stirred=0.3)
        if found is not None:
            return found
    raise AssertionError("no seed gains anything")


def days(crew):
    return np.array([flight.itinerary.duration_days for flight in crew.flights])


def test_tours_get_shorter_with_the_same_asteroids(crew, polished):
    assert days(polished).sum() < days(crew).sum() - 5.0
    assert polished.visits() == crew.visits()
    for before, after in zip(crew.flights, polished.flights, strict=True):
        assert before.itinerary.rows.tolist() == after.itinerary.rows.tolist()


def test_the_mother_ship_can_pay_for_it(screen, polished):
    carrier = carrier_of(screen, polished)
    assert carrier is not None
    assert 4 < len(carrier.impulses) <= screen.rules.max_impulses
    assert fly_carrier(carrier).propellant_left_kg >= 0.0


def test_probes_leave_where_she_is_and_end_where_she_is(problem, screen, polished):
    path = fly_carrier(carrier_of(screen, polished))
    plan = polished.plan
    for number in range(3):
        bodies = own_problem(problem, polished, number).catalogue
        release, capture = path.carrier.release(number + 1), path.carrier.capture(number + 1)
        for epoch, row in ((release.t_mjd2000, plan.first), (capture.t_mjd2000, plan.end(number))):
            # Her impulses are never at the same epoch.
            miss = path.states(epoch)[0] - bodies.states_at([row], epoch)[0]
            assert np.linalg.norm(miss[:3]) < 1e5  # m, of a tolerance of 1000 km
            assert np.linalg.norm(miss[3:]) < 0.05  # m/s, of 1 m/s


def test_every_tour_keeps_the_rules_from_its_own_orbit_to_its_own(problem, polished):
    for number, flight in enumerate(polished.flights):
        assert flight.keeps_rules(own_problem(problem, polished, number))


def test_those_that_stay_are_released_first_and_caught_at_rest(screen, polished):
    course, releases, captures = polished.course, releases_of(polished), captures_of(polished)
    first, second = course.stays
    assert (course.starts[first], course.ends[second]) == (0, course.settled[0])
    assert releases[first] == min(releases)
    itinerary = polished.flights[second].itinerary
    assert captures[second] >= itinerary.t_arr_mjd2000[-1] + WAIT_DAYS - 1e-6
    assert captures[second] - releases[second] <= MISSION_DAYS


def test_she_stays_for_a_day_after_one_that_is_caught_at_rest(polished):
    """With continuous thrust it may come hours later."""
    caught = polished.course.stay_epochs[1]
    later = [i.t_mjd2000 - caught for i in polished.course.impulses if i.t_mjd2000 > caught]
    assert min(later, default=LATE_DAYS) >= LATE_DAYS - 1e-6
    assert _gap(Step(Act.CAPTURE, 0.0, 1, stays=True), Step(Act.IMPULSE, 9.0)) == LATE_DAYS


def test_a_release_before_the_window_of_the_plan_is_one_of_the_course(problem, polished):
    """She may be on a coast, and off it, before the plan's window begins."""
    end = max(impulse.t_mjd2000 for impulse in polished.course.impulses)
    late = replace(
        polished, plan=replace(polished.plan, windows_mjd2000=((end + 500.0, end + 900.0),) * 3)
    )
    for number, flight in enumerate(late.flights):
        begin, last = own_problem(problem, late, number).first_departure_mjd2000
        assert begin <= flight.itinerary.t_dep_mjd2000[0] <= last


def test_a_schedule_is_in_order_and_begins_with_what_there_is(screen, crew):
    schedule = schedule_of(screen, crew)
    assert [step.act for step in schedule.steps].count(Act.DEPART) == 1
    flown = schedule.fly(schedule.start()[None])
    assert all(a <= b for a, b in pairwise(flown.t[0]))
    sizes = np.linalg.norm(flown.dv[0], axis=1)
    wanted = [np.linalg.norm(impulse.dv_m_s) for impulse in carrier_of(screen, crew).impulses[2:]]
    assert sizes[sizes > 0.0] == pytest.approx(wanted, rel=1e-6)


def test_a_crew_of_one_orbit_is_left_alone(problem, screen, crew):
    plan = Plan.together(crew.plan.orbits[:1], crew.plan.begin_mjd2000, 3)
    one = replace(crew, plan=plan)
    assert joined(screen, problem, one, WISHES, rng=np.random.default_rng(1)) is None


def test_a_course_whose_coast_is_over_before_a_release_serves_no_probe(screen, polished):
    course = polished.course
    late = replace(course, starts=(len(course.impulses), *course.starts[1:]))
    assert carrier_of(screen, replace(polished, course=late)) is None


def test_a_state_file_keeps_the_course(problem, polished, tmp_path):
    write_state(tmp_path / "state.json", CampaignState(crews=[polished]), problem)
    (back,) = read_state(tmp_path / "state.json", problem).crews
    assert back.course == polished.course
    assert days(back) == pytest.approx(days(polished))
    assert back.mass_kg() == pytest.approx(polished.mass_kg(), abs=1e-3)
