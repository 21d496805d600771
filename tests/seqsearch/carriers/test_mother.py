"""A mother ship's ways: to an orbit, from one to another, and what she can afford."""

import numpy as np
import pytest

from feasibility.orbits import synthetic_main_belt
from seqsearch.carriers.mother import change_orbit, later_budget, mother_flight, next_orbits
from seqsearch.carriers.routes import refined_route, scan_routes
from seqsearch.problems.gtoc7.rules import carrier_rules
from seqsearch.tours.carrier.path import fly_carrier

RULES = carrier_rules()


@pytest.fixture(scope="module")
def belt():
    return synthetic_main_belt(3000, np.random.default_rng(1))


@pytest.fixture(scope="module")
def routes(belt):
    a, e, i = belt.elements[:, :3].T
    rows = np.flatnonzero((a < 4.3e11) & (e < 0.12) & (i < 0.06))[:40]
    launches = np.arange(RULES.launch_mjd2000[0], RULES.launch_mjd2000[0] + 900.0, 40.0)
    tofs = np.arange(210.0, 750.0, 60.0)
    return scan_routes(belt, rows, launches, tofs, v_inf=6000.0, delta_v_max=6400.0)


@pytest.fixture(scope="module")
def route(belt, routes):
    best = int(np.argmin(routes.delta_v))
    return int(routes.row[best]), refined_route(
        belt.select(routes.row[best : best + 1]),
        float(routes.launch_mjd2000[best]),
        float(routes.tof_days[best]),
        v_inf=6000.0,
        window_mjd2000=RULES.launch_mjd2000,
        latest_arrival_days=1000.0,
    )


def test_a_refined_route_is_cheaper_than_the_direct_arc_it_came_from(routes, route):
    assert len(routes) > 0
    assert route[1].delta_v < float(routes.delta_v.min())
    assert np.linalg.norm(route[1].v_inf_m_s) <= 6000.0 * (1 + 1e-12)


def test_a_mother_ship_meets_both_orbits_bodies(belt, route):
    first, way = route
    begin = way.second_mjd2000 + 800.0
    rows, costs = next_orbits(belt, first, (begin, begin + 1400.0), 3000.0)
    assert len(rows) > 0
    change = change_orbit(belt, first, int(rows[0]), (begin, begin + 1400.0))
    assert change.delta_v <= costs[0] + 1e-6
    end = begin + 1500.0
    carrier = mother_flight(RULES, way, change.impulses, [begin - 100.0], [(end, 900.0)])
    path = fly_carrier(carrier)
    for epoch, row in ((begin - 100.0, first), (end, int(rows[0]))):
        miss = path.states(epoch)[0] - belt.states_at([row], epoch)[0]
        assert np.linalg.norm(miss[:3]) < 1e5  # m, of a tolerance of 1000 km
        assert np.linalg.norm(miss[3:]) < 0.05  # m/s, of 1 m/s


def test_what_is_left_follows_from_the_rocket_equation():
    left = later_budget(RULES, 5500.0)
    exhaust = RULES.isp_s * RULES.g0_m_s2
    alone = 24000.0 * np.exp(-5500.0 / exhaust) - 6000.0
    assert alone * np.exp(-left / exhaust) == pytest.approx(6000.0)
    assert later_budget(RULES, 6200.0) < 0.0
