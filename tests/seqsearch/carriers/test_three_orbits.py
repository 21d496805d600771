"""A mother ship that goes on to a third orbit: her schedule, her course, when probes leave."""

from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest

from feasibility import Spacecraft
from feasibility.orbits import Catalogue, synthetic_main_belt
from seqsearch.carriers.chains import chained_plans, later_window, left_kg
from seqsearch.carriers.crew_schedule import _capture_steps, _release_steps
from seqsearch.carriers.homing import HomingSettings
from seqsearch.carriers.mother import change_costs, change_orbit, later_budget, next_orbits
from seqsearch.carriers.plans import Plan, Screen
from seqsearch.carriers.schedule import Act, Schedule
from seqsearch.carriers.state_files import CampaignState, read_state, write_state
from seqsearch.carriers.varying import varied
from seqsearch.problems.gtoc7.rules import carrier_rules
from seqsearch.problems.rendezvous import RendezvousProblem
from seqsearch.settings import SearchSettings

COMPANIONS = (0.003, 0.01, 0.004, 0.05), (-0.003, 0.006, -0.006, -0.04)
"""What two orbits near the first one differ by: a as a share, e, and i and the mean anomaly in
radians."""

BELT = 3000
WINDOW = 9000.0


@pytest.fixture(scope="module")
def problem():
    """Return a belt in which the orbits of 40 bodies have others nearby."""
    belt = synthetic_main_belt(BELT, np.random.default_rng(7))
    a, e, i = belt.elements[:, :3].T
    rows = np.flatnonzero((a < 4.2e11) & (e < 0.1) & (i < 0.06))[:40]
    catalogue = belt
    for number, (a_share, *more) in enumerate(COMPANIONS, 1):
        elements = belt.elements[rows].copy()
        elements[:, 0] *= 1.0 + a_share
        elements[:, [1, 2, 5]] += more
        ids = 100_000 * number + belt.ids[rows]
        names = [f"companion {body}" for body in ids]
        near = Catalogue(ids, names, belt.epoch_mjd2000[rows], elements, "companions")
        catalogue = catalogue.with_bodies(near)
    return RendezvousProblem(
        name="belt",
        catalogue=catalogue,
        spacecraft=Spacecraft(m_dry=800.0, thrust=0.3, isp=3000.0),
        m0=2000.0,
        first_departure_mjd2000=(7671.0, 13514.0),
        max_duration_days=2191.5,
        min_stay_days=30.0,
    )


@pytest.fixture(scope="module")
def screen(problem, tmp_path_factory):
    folder = tmp_path_factory.mktemp("three") / "chart"
    return Screen(problem, carrier_rules(), None, SearchSettings(), folder)


@pytest.fixture(scope="module")
def plan(screen):
    """Return a plan with cheap changes of orbit."""
    catalogue = screen.catalogue
    routes = screen.routes(np.arange(BELT))
    for k in np.argsort(routes.delta_v, kind="stable"):
        first = int(routes.row[k])
        begin = float(routes.launch_mjd2000[k] + 900.0)
        windows = (begin, begin + 250.0), (begin + 700.0, begin + 1000.0)
        seconds, _ = next_orbits(catalogue, first, (begin + 1000.0, begin + 2160.0), 900.0)
        for second in seconds:
            later = begin + 2200.0, begin + 3000.0
            thirds, _ = next_orbits(catalogue, int(second), later, 900.0)
            others = [int(row) for row in thirds if row != first]
            found = Plan((first, int(second), *others[:1]), (1, 2, 2), (*windows, windows[1]))
            if others and screen.route(found) is not None:
                return found
    raise AssertionError("no third orbit in this belt")


@pytest.fixture(scope="module")
def schedule(screen, plan):
    """Return what she does for probes of which the first and the second stay at an asteroid."""
    begin = plan.begin_mjd2000
    releases = [(begin + 40.0, 0), (begin + 800.0, 1), (begin + 900.0, 2)]
    captures = [[(begin + 2170.0, 0)], [(begin + 2960.0, 1), (begin + 3080.0, 2)]]
    steps = _release_steps(releases, 0)
    between = (begin + 910.0, begin + 2160.0), (begin + 2180.0, begin + 2950.0)
    for orbit, caught in enumerate(captures, 1):
        change = change_orbit(
            screen.catalogue, *plan.orbits[orbit - 1 : orbit + 1], between[orbit - 1]
        )
        steps += _capture_steps(caught, orbit - 1, change)
    route = screen.route(plan)
    stays = (0, 0, 1)
    return Schedule(steps, screen.catalogue, plan.orbits, screen.rules, route, stays, (850.0,) * 3)


def test_a_schedule_has_a_way_to_each_orbit_and_is_in_order(schedule):
    acts = [step.act for step in schedule.steps]
    assert acts.count(Act.DEPART) == acts.count(Act.ARRIVE) == 2
    flown = schedule.fly(schedule.start()[None])
    assert all(a <= b for a, b in pairwise(flown.t[0]))


def test_she_rests_on_an_orbit_if_captures_there_are_near_each_other(screen, plan):
    begin = plan.begin_mjd2000
    between = begin + 1000.0, begin + 1900.0
    change = change_orbit(screen.catalogue, plan.first, plan.orbits[1], between)
    near = _capture_steps([(begin + 2000.0, 1), (begin + 2100.0, 0)], 0, change)
    assert [step.act for step in near] == [Act.DEPART, Act.ARRIVE, Act.CAPTURE, Act.CAPTURE]
    assert [(step.probe, step.stays) for step in near[2:]] == [(1, False), (0, True)]
    far = _capture_steps([(begin + 2000.0, 1), (begin + 2400.0, 0)], 0, change)
    assert [step.act for step in far] == [
        *(Act.IMPULSE, Act.IMPULSE, Act.CAPTURE),
        *(Act.DEPART, Act.ARRIVE, Act.CAPTURE),
    ]


def test_she_is_at_rest_at_each_asteroid_when_she_arrives(schedule, screen, plan):
    x = schedule.start()
    x[0] += 0.7  # days of ten: an impulse before a release, and all that follows, is moved
    outing = schedule.fly(x[None])
    arrivals = [k for k, step in enumerate(schedule.steps) if step.act is Act.ARRIVE]
    for k, row in zip(arrivals, plan.orbits[1:], strict=True):
        there = screen.catalogue.states_at([row], outing.t[0, k])[0]
        assert np.linalg.norm(outing.states[0, k] - there) == pytest.approx(0.0, abs=1e-6)


def test_propellant_is_that_of_the_rocket_equation_with_each_probe_aboard_or_not(schedule):
    outing = schedule.fly(schedule.start()[None])
    rules = carrier_rules()
    exhaust = rules.isp_s * rules.g0_m_s2
    mass = schedule._mass_kg
    for step, dv in zip(schedule.steps, outing.dv[0], strict=True):
        if step.act is Act.RELEASE:
            mass -= 2000.0
        elif step.act is Act.CAPTURE:
            mass += 850.0
        else:
            # The smallest impulse counts as 0.3 m/s.
            mass *= np.exp(-np.hypot(np.linalg.norm(dv), 0.3) / exhaust)
    assert outing.left_kg[0] == pytest.approx(mass - 3 * 850.0 - rules.m_dry_kg, abs=1e-6)


def test_a_course_knows_where_probes_leave_and_end(schedule, screen, plan):
    course = schedule.course(schedule.start())
    assert course.stays == (0, 0, 1)
    assert [course.coast_at(orbit) for orbit in range(3)] == [0, *course.settled]
    assert (course.starts[0], course.ends[0], course.ends[1]) == (0, *course.settled)
    epochs, states = course.states(screen.catalogue, plan)
    for coast, row in zip(course.settled, plan.orbits[1:], strict=True):
        there = screen.catalogue.states_at([row], epochs[coast - 1])[0]
        assert states[coast - 1] == pytest.approx(there)
    # Probe 1 ends on the second orbit itself, probe 3 on a coast after the third one.
    moved = course.catalogue_for(screen.catalogue, plan, 0)
    assert moved.elements == pytest.approx(screen.catalogue.elements)
    moved = course.catalogue_for(screen.catalogue, plan, 2)
    changed = np.flatnonzero((moved.elements != screen.catalogue.elements).any(axis=1))
    assert set(changed.tolist()) <= {plan.first, plan.orbits[2]}
    assert moved.states_at([plan.orbits[2]], epochs[-1])[0] == pytest.approx(states[-1], rel=1e-9)


def test_later_probes_leave_when_there_is_time_for_both_changes(screen, plan):
    begin = plan.begin_mjd2000
    window = later_window(screen, plan, 2, [begin + 40.0], [begin + 2170.0])
    assert window[0] < window[1] <= begin + 2170.0
    # One that is caught later on the second orbit makes the rest leave later.
    later = later_window(screen, plan, 2, [begin + 40.0], [begin + 2500.0])
    assert later[0] >= window[0]
    # Where nothing fits, the plan's own window stays.
    assert later_window(screen, plan, 2, [begin], [begin + 10.0]) == plan.windows_mjd2000[2]


def test_chained_plans_have_three_orbits_within_her_means(screen, plan, monkeypatch):
    """Beams are replaced: each orbit is worth its row."""

    def tours(plan, number, settings, avoid=(), offset_days=0.0):
        value = 9.0 + plan.end(number) / 1e6
        rows = SimpleNamespace(rows=np.array([plan.first, plan.end(number)]))
        return [SimpleNamespace(value=lambda days: value, itinerary=rows)]

    monkeypatch.setattr(screen, "tours", tours)
    first = Plan.together(plan.orbits[:1], plan.begin_mjd2000, 3)
    found = chained_plans(screen, first, HomingSettings())
    assert found
    assert [one.value for one in found] == sorted((one.value for one in found), reverse=True)
    for one in found:
        assert len(set(one.orbits)) == 3
        assert one.orbits[0] == plan.first
        assert one.ends in ((1, 1, 2), (1, 2, 2))
        budget = later_budget(screen.rules, screen.route(one).delta_v)
        begin = one.begin_mjd2000
        second = next_orbits(screen.catalogue, plan.first, (begin, begin + 2200.0), 1.1 * budget)[
            0
        ]
        assert one.orbits[1] in second


def test_a_state_file_keeps_plans_with_three_orbits(problem, plan, tmp_path):
    write_state(tmp_path / "state.json", CampaignState(chained=[plan]), problem)
    assert read_state(tmp_path / "state.json", problem).chained == [plan]


def _rated_by_its_orbits(screen, plan, settings, probes):
    return replace(plan, value=float(sum(plan.orbits) + probes))


def test_variations_of_a_plan_are_other_plans_that_she_may_fly(screen, plan, monkeypatch):
    monkeypatch.setattr(Screen, "valued", _rated_by_its_orbits)
    tried = [varied(screen, plan, seed, HomingSettings()) for seed in range(60)]
    found = [one for variations in tried for one in variations]
    assert 10 < len(found) <= 60
    for other in found:
        assert other.value == sum(other.orbits) + 3
        changed = [
            sum(a != b for a, b in zip(other.orbits, plan.orbits, strict=True)),
            int(other.windows_mjd2000 != plan.windows_mjd2000),
            int(other.ends != plan.ends),
        ]
        assert changed[0] <= 1
        assert sum(changed) >= 1
        assert len(set(other.orbits)) == 3
        assert set(other.ends) == set(plan.ends)
        assert list(other.ends) == sorted(other.ends)
        assert screen.route(other) is not None
        lengths = {
            end: np.diff(w)[0] for w, end in zip(plan.windows_mjd2000, plan.ends, strict=True)
        }
        for window, end in zip(other.windows_mjd2000, other.ends, strict=True):
            assert np.diff(window)[0] == pytest.approx(lengths[end])
    names = ("orbits", "windows_mjd2000", "ends")
    kinds = np.array([[getattr(o, n) != getattr(plan, n) for n in names] for o in found])
    assert kinds.any(axis=0).all()
    again = [varied(screen, plan, seed, HomingSettings()) for seed in range(5)]
    assert again == tried[:5]


def test_a_plan_with_one_orbit_is_varied_too(screen, plan, monkeypatch):
    monkeypatch.setattr(Screen, "valued", _rated_by_its_orbits)
    alone = Plan.together(plan.orbits[:1], plan.begin_mjd2000, 3)
    found = [one for seed in range(20) for one in varied(screen, alone, seed, HomingSettings())]
    assert {len(other.orbits) for other in found} == {1}
    assert {other.orbits for other in found} > {alone.orbits}


def test_no_variation_without_the_propellant_for_it(screen, plan, problem, tmp_path, monkeypatch):
    monkeypatch.setattr(Screen, "valued", _rated_by_its_orbits)
    heavy = msgspec.structs.replace(carrier_rules(), m_dry_kg=11_500.0)
    poor = Screen(problem, heavy, None, SearchSettings(), tmp_path / "chart")
    assert not any(varied(poor, plan, seed, HomingSettings()) for seed in range(10))


def test_what_is_left_is_what_the_changes_leave(screen, plan):
    rules, route = screen.rules, screen.route(plan)
    begin = plan.begin_mjd2000
    changes = (begin + 1000.0, begin + 2160.0), (begin + 2200.0, begin + 3000.0)
    exhaust = rules.isp_s * rules.g0_m_s2
    mass = rules.m0_kg * np.exp(-route.delta_v / exhaust) - 3 * 2000.0
    for orbit, (aboard, between) in enumerate(zip((0.0, 850.0), changes, strict=True)):
        goal = np.array([plan.orbits[orbit + 1]])
        cost = change_costs(screen.catalogue, plan.orbits[orbit], goal, between)[0]
        mass = (mass + aboard) * np.exp(-cost / exhaust) - aboard
    left = left_kg(screen, plan, route, changes)
    assert left == pytest.approx(mass - rules.m_dry_kg, abs=1e-6)
    assert left_kg(screen, plan, route, changes, 1.04) > left
    assert left_kg(screen, plan, route, (changes[0][::-1], changes[1])) == -np.inf
