"""Beams over a chart without an end: tours that keep the rules, and that can be flown."""

import numpy as np
import pytest

from seqsearch.chart.roaming import Roaming, RoamingOrder
from seqsearch.polish.retiming import retime
from tests.helpers.curve_charts import roamed


@pytest.fixture(scope="module")
def world():
    return roamed()


@pytest.fixture(scope="module")
def tours(world):
    problem = world.problem
    order = RoamingOrder(problem.first_departure_mjd2000[0], days=80.0, epochs=4, width=300)
    return Roaming(world.chart, problem).run(order)


def test_tours_obey_the_rules_of_the_problem(world, tours):
    problem = world.problem
    assert tours
    first, last = problem.first_departure_mjd2000
    for tour in tours:
        one = tour.itinerary
        assert len(tour.bodies) == one.n_asteroids
        assert first <= one.t_dep_mjd2000[0] <= last
        stays = one.t_dep_mjd2000[1:] - one.t_arr_mjd2000[:-1]
        assert stays == pytest.approx(problem.min_stay_days)
        # Predicted timetables are not the best yet.
        assert one.duration_days < 1.03 * problem.max_duration_days
        assert tour.mass > 0.97 * problem.spacecraft.m_dry


def test_the_longest_tours_come_first_and_the_shortest_of_them(tours):
    visits = [len(tour.itinerary) for tour in tours]
    assert visits == sorted(visits, reverse=True)
    assert set(visits) == {max(visits), max(visits) - 1}
    best = [tour.itinerary.duration_days for tour in tours if len(tour.itinerary) == max(visits)]
    assert best == sorted(best)
    kinds = [tour.bodies for tour in tours if len(tour.itinerary) == max(visits)]
    assert len(set(kinds)) == len(kinds)


def test_predicted_tours_are_nearly_what_can_be_flown(world, tours):
    found = [retime(world.problem, tour.itinerary, max_iterations=12) for tour in tours[:3]]
    for tour, retimed in zip(tours, found, strict=False):
        assert retimed is not None
        assert retimed.merit_days == pytest.approx(tour.itinerary.duration_days, rel=0.06)


def test_the_same_order_gives_the_same_tours(world, tours):
    problem = world.problem
    order = RoamingOrder(problem.first_departure_mjd2000[0], days=80.0, epochs=4, width=300)
    again = Roaming(world.chart, problem).run(order)
    assert len(again) == len(tours)
    for one, other in zip(tours, again, strict=True):
        assert np.array_equal(one.itinerary.rows, other.itinerary.rows)
