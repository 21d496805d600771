"""Tours that have to end at a body: what the search makes of them."""

import copy

import numpy as np
import pytest

from seqsearch import check_problem, search, verify_tour
from seqsearch.beam.endings.outlook import EndOutlook
from seqsearch.core.ending import Ending, ending_of
from seqsearch.core.way_home import ways_home
from seqsearch.pruning.mima_predictor import MimaPredictor
from tests.helpers.ended_problems import BODY, MOTHER, round_trip
from tests.helpers.problems import small_problem, small_settings

SETTINGS = small_settings(start_epochs=12)


@pytest.fixture(scope="module")
def problem():
    return round_trip(BODY)


@pytest.fixture(scope="module")
def states(problem):
    """All states of a search, and its tour."""
    seen = []
    result = search(problem, settings=SETTINGS, on_rank=lambda s: seen.append(copy.deepcopy(s)))
    return seen, result.tour


def test_a_problem_with_an_end_keeps_the_contract(problem):
    check_problem(problem)


def test_a_tour_goes_out_and_comes_back(states):
    tour = states[1]
    ids = [body.id for body in tour.bodies]
    assert ids[0] == ids[-1] == MOTHER
    assert MOTHER not in ids[1:-1]
    assert BODY not in ids
    assert tour.score == tour.n_asteroids == len(ids) - 2 >= 2
    assert tour.duration_days <= 1000.0
    assert verify_tour(tour).passed


def test_a_resumed_search_comes_back_with_the_same_tour(problem, states):
    seen, tour = states
    resumed = search(problem, settings=SETTINGS, resume=copy.deepcopy(seen[1]))
    assert resumed.tour == tour


def test_without_time_for_the_way_home_there_is_no_tour():
    result = search(round_trip(BODY, max_duration_days=130.0), settings=SETTINGS)
    assert result.tour.bodies == ()


def test_the_end_may_be_another_body_of_the_table(states):
    tour = states[1]
    end = tour.visits[-1].id
    result = search(round_trip(BODY, end_id=end), settings=SETTINGS)
    ids = [body.id for body in result.tour.bodies]
    assert ids[-1] == end
    assert ids.count(end) == 1
    assert result.tour.n_asteroids == len(ids) - 1
    assert verify_tour(result.tour).passed


def test_bodies_that_have_to_be_visited_are(states):
    wanted = states[1].visits[-1].id
    without_end = small_problem(must_visit=(wanted,), max_duration_days=500.0)
    start = states[1].visits[-2].id
    result = search(
        small_problem(must_visit=(wanted,), start_ids=(start,), max_duration_days=500.0),
        settings=SETTINGS,
    )
    assert wanted in [body.id for body in result.tour.bodies]
    assert verify_tour(result.tour).passed
    assert without_end.ending.row is None


def test_who_has_no_time_left_is_given_up(problem):
    ending = ending_of(problem)
    assert isinstance(ending, Ending)
    outlook = EndOutlook(problem, ending, MimaPredictor())
    rows = np.array([problem.catalogue.rows_of([MOTHER])[0]] * 3, dtype=np.intp)
    first = np.full(3, 9000.0)
    nodes = problem.start_nodes(rows, first + np.array([100.0, 850.0, 980.0]))
    nodes = type(nodes)(**(vars(nodes) | {"t_first_mjd2000": first, "depth": np.ones(3, int)}))
    home = outlook.homecoming(nodes)
    # From the orbit itself any flight leads back to it.
    assert home.possible.tolist() == [True, True, False]
    assert home.surely[1]
    assert 9850.0 < home.t_arr_mjd2000[1] <= 10000.0
    assert np.isfinite(home.t_arr_mjd2000).all()
    assert (home.mass <= nodes.mass).all()


def test_ways_home_arrive_in_time(problem):
    ending = ending_of(problem)
    rows = np.arange(4, dtype=np.intp)
    nodes = problem.start_nodes(rows, np.full(4, 9700.0))
    fields = {"t_first_mjd2000": np.full(4, 9000.0), "depth": np.ones(4, int)}
    nodes = type(nodes)(**(vars(nodes) | fields))
    ways = ways_home(problem, ending, nodes, MimaPredictor())
    assert (ways.t_dep_mjd2000 >= 9700.0).all()
    assert (ways.t_dep_mjd2000 + ways.tof_days <= 10000.0 + 1e-6).all()
    assert set(ways.parent) == set(range(4))
