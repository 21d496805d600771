"""Tours that have to end at a body, where they may arrive with some speed."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from feasibility import FeasibilityClassifier, InputError
from feasibility.orbits import earth
from seqsearch import check_problem, search, verify_tour
from seqsearch.beam.endings.outlook import EndOutlook
from seqsearch.core.way_home import ways_home
from seqsearch.polish import PolishSettings, polish
from seqsearch.polish.extension import Extender, Extension
from seqsearch.polish.flight import fly
from seqsearch.polish.itinerary import Itinerary
from seqsearch.problems.ends.problem import EndsProblem
from seqsearch.problems.ends.rules import EndsRules
from seqsearch.problems.problem_file import build_problem, read_config, to_toml
from seqsearch.tours.events import FlyBy
from seqsearch.tours.tour_files import read_tour, to_json
from tests.helpers.ended_problems import BODY, MOTHER, round_trip
from tests.helpers.problem_texts import GOOD
from tests.helpers.problems import small_settings

HOME = '[[bodies]]\nname = "Earth"\nid = 0\nearth = true\n'
BACK = 'launch_from = "earth"\nlaunch_vinf_km_s = 4.0\narrival_vinf_km_s = 3.0\n'


def in_file(tmp_path, ends, mission, bodies=HOME):
    path = tmp_path / "mine.toml"
    text = GOOD.replace("[mission]", f"[mission]\n{mission}")
    path.write_text(f"{text}\n{bodies}\n[ends]\n{ends}")
    return read_config(str(path))


def ended(arrival_km_s, launch_km_s=0.0, **changes):
    rules = EndsRules(launch_vinf_km_s=launch_km_s, arrival_vinf_km_s=arrival_km_s)
    return EndsProblem(base=round_trip(BODY, **changes), rules=rules)


@pytest.fixture(scope="module")
def problem():
    return ended(1.0, launch_km_s=0.5)


@pytest.fixture(scope="module")
def searched(problem):
    return search(problem, settings=small_settings(start_epochs=12))


@pytest.fixture(scope="module")
def predictor():
    return FeasibilityClassifier.load()


def test_a_file_states_a_return_to_the_earth_with_speed_left(tmp_path):
    config = in_file(tmp_path, BACK, "end_id = 0\nmust_visit = [7]")
    there = build_problem(config)
    home = int(there.catalogue.rows_of([0])[0])
    assert there.start_ids == (0,)
    assert there.ending.row == home
    assert home in there.rows_to_avoid
    np.testing.assert_array_equal(there.catalogue.elements[home], earth().elements[0])
    start = there.start_nodes(there.start_rows(), np.array([there.first_departure_mjd2000[0]]))
    target = there.catalogue.rows_of([7, 0]).astype(np.intp)
    epochs = np.full(2, start.t_ready_mjd2000[0])
    (legs,) = there.hops(start, np.zeros(2, np.intp), target, epochs, np.full(2, 300.0)).legs
    np.testing.assert_allclose(legs.vinf_dep, 4000.0, rtol=1e-5)
    np.testing.assert_allclose(legs.vinf_arr, [0.0, 3000.0], rtol=1e-5)
    assert config == read_config_again(tmp_path, config)


def read_config_again(tmp_path, config):
    path = tmp_path / "again.toml"
    path.write_text(to_toml(config))
    return read_config(str(path))


def test_a_tour_with_an_end_keeps_the_contract(problem):
    check_problem(problem)


@pytest.mark.parametrize(
    ("ends", "mission", "said"),
    [
        ('visits = "fly-by"', "end_id = 0", 'visits = "fly-by"'),
        ('visits = "fly-by"', "must_visit = [7]", 'visits = "fly-by"'),
        ("arrival_vinf_km_s = 1.0", "must_visit = [7]", "without a body at which tours end"),
        (BACK, "sequence = [5, 7]\nend_id = 0", "a sequence and a table"),
        (BACK, "end_id = 0\nmust_visit = [0]", "body 0 is among must_visit"),
    ],
)
def test_what_does_not_go_together_is_refused_in_one_line(tmp_path, ends, mission, said):
    config = in_file(tmp_path, ends, mission)
    config = msgspec.structs.replace(
        config, mission=msgspec.structs.replace(config.mission, min_stay_days=0.0)
    )
    with pytest.raises(InputError, match=said) as error:
        build_problem(config)
    assert "\n" not in str(error.value)


def test_a_tour_comes_back_with_speed_left(problem, searched, tmp_path):
    tour = searched.tour
    assert tour.bodies[0].id == tour.bodies[-1].id == MOTHER
    assert tour.n_asteroids == len(tour.bodies) - 2 >= 1
    speeds = [float(np.linalg.norm(leg.arr_velocity_m_s)) for leg in tour.legs]
    assert not any(speeds[:-1])
    assert 1.0 < speeds[-1] <= 1000.0
    verification = verify_tour(tour, problem.catalogue, problem.tour_rules())
    assert verification.passed, verification.table()
    path = tmp_path / "sequence.json"
    path.write_text(to_json(tour))
    assert read_tour(path) == tour


def test_a_faster_arrival_than_the_rules_allow_is_found_out(problem, searched):
    rules = problem.tour_rules()
    events = tuple(
        msgspec.structs.replace(event, last_max_m_s=100.0) if isinstance(event, FlyBy) else event
        for event in rules.events
    )
    strict = msgspec.structs.replace(rules, events=events)
    failed = {c.name for c in verify_tour(searched.tour, rules=strict).checks if not c.passed}
    assert "speed at the last arrival" in failed


def test_a_required_body_is_visited_on_the_way(searched):
    required = searched.tour.visits[-1].id
    demanding = ended(1.0, launch_km_s=0.5, must_visit=(required,))
    tour = search(demanding, settings=small_settings(start_epochs=12)).tour
    assert required in [body.id for body in tour.visits]
    assert verify_tour(tour, demanding.catalogue, demanding.tour_rules()).passed


class Endless:
    """Says of every leg that it needs no thrust."""

    def margin(self, legs, /):
        return np.full(len(legs), np.inf)

    def final_mass(self, legs, /):
        return legs.m0.copy()


def test_ways_home_without_thrust_have_numbers(problem):
    ending, nodes = problem.ending, problem.start_nodes(np.arange(3), np.full(3, 7800.0))
    ways = ways_home(problem, ending, nodes, Endless())
    assert len(ways) > 0
    assert np.isfinite(ways.log_margin).all()
    assert (ways.m_final <= problem.m0).all()
    outlook = EndOutlook(problem, ending, Endless())
    late = replace(nodes, t_first_mjd2000=nodes.t_first_mjd2000 - 700.0)
    coming = outlook.homecoming(late)
    assert coming.surely.all()
    assert np.isfinite(coming.mass).all()


def test_only_whole_tours_arrive_with_speed(problem, searched, predictor):
    whole = Itinerary.from_tour(problem, searched.tour)
    assert whole.vinf_dep[0] == 500.0
    assert whole.vinf_arr[-1] == 1000.0
    part = whole.part(0, len(whole.rows) - 2)
    assert not part.with_ends_of(problem).vinf_arr.any()
    again = part.ended(problem, problem.ending, predictor, searched.tour.m_final_kg)
    assert again.vinf_arr[-1] == 1000.0


@pytest.mark.parametrize("at_start", [False, True])
def test_new_ends_keep_their_speeds(problem, searched, predictor, at_start):
    flight = fly(problem, Itinerary.from_tour(problem, searched.tour))
    last = len(flight.itinerary.rows) - 1
    extension = Extension(2, last, 1, 0) if at_start else Extension(0, last - 1, 0, 1)
    found = Extender(problem, predictor).extend(
        flight, extension, avoid=np.zeros(0, dtype=np.intp)
    )
    assert found
    for itinerary in found:
        assert itinerary.vinf_dep[0] == 500.0
        assert itinerary.vinf_arr[-1] == 1000.0
        assert not itinerary.vinf_dep[1:].any()
        assert not itinerary.vinf_arr[:-1].any()


def test_a_tour_with_speed_left_is_polished(problem, searched, predictor):
    settings = PolishSettings(rounds=2, moves_per_round=3)
    result = polish(problem, searched.tour, predictor=predictor, settings=settings)
    better = (result.tour.n_asteroids, -result.tour.duration_days)
    assert better >= (searched.tour.n_asteroids, -searched.tour.duration_days)
    verification = verify_tour(result.tour, problem.catalogue, problem.tour_rules())
    assert verification.passed, verification.table()
