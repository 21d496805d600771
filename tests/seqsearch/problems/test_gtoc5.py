"""GTOC5: the self-fly-by against its closed form, the moves, and a tour found and verified."""

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from feasibility import FeasibilityClassifier, InputError
from feasibility.constants import AU, DAY_S, EARTH_VELOCITY, mjd_to_mjd2000
from feasibility.orbits import Catalogue
from feasibility.orbits.lambert import lambert
from feasibility.sims_flanagan import solve_max_initial_mass
from seqsearch import SearchSettings, search, verify_tour
from seqsearch.commands.cli import main
from seqsearch.core.custom_moves import CustomMoves
from seqsearch.core.nodes import Nodes
from seqsearch.core.optimisation import solve_hops
from seqsearch.core.problem import Problem
from seqsearch.problems.gtoc5.element_distance import phase_free_points
from seqsearch.problems.gtoc5.forecast import FLY_BY_STRETCH, Gtoc5Forecast
from seqsearch.problems.gtoc5.problem import Gtoc5Problem
from seqsearch.problems.gtoc5.rules import Gtoc5Rules
from seqsearch.problems.gtoc5.self_fly_by import self_fly_by_delta_v, shortest_self_fly_by_days
from seqsearch.problems.moves.directions import even_directions
from seqsearch.problems.moves.lambert_departure import lambert_departure
from seqsearch.problems.problem_file import build_problem, read_config, to_toml, with_catalogue
from seqsearch.settings import SearchSettings as Settings
from seqsearch.tours.tour_files import read_tour, to_csv, to_json
from tests.helpers.gtoc5 import near_earth_bodies, toy_problem

GTOC5_TABLE = "gtoc/official/GTOC5-DATA.txt"


@pytest.fixture(scope="module")
def classifier():
    return FeasibilityClassifier.load()


@pytest.fixture(scope="module")
def result():
    settings = SearchSettings().with_(
        beam_width=4,
        start_epochs=3,
        neighbours=40,
        tof_days_max=400.0,
        pruner="default:0.99",
        audit={"per_rank": 0},
    )
    return search(toy_problem(), settings=settings, rng=np.random.default_rng(2))


@pytest.fixture(scope="module")
def tour(result):
    assert result.tour.score >= 3.0
    return result.tour


# The closed form


@given(st.floats(1.0, 4.0), st.floats(50.0, 1000.0))
def test_thrust_back_coast_and_thrust_on_closes_the_path(stretch, speed):
    # In units of u / a: thrust backwards for t1, coast, thrust on for t1 + 1.
    first = (self_fly_by_delta_v(stretch, speed) / speed - 1.0) / 2.0
    coast = stretch * (1.0 + np.sqrt(2.0)) - 2.0 * first - 1.0
    assert coast >= -1e-9
    position = -(first**2) / 2.0 - first * coast
    last = first + 1.0
    position += -first * last + last**2 / 2.0
    assert abs(position) < 1e-9


def test_the_shortest_self_fly_by_burns_all_the_time():
    mass, speed, thrust = 2000.0, 400.0, 0.3
    days = float(shortest_self_fly_by_days(mass, speed, thrust))
    assert days * DAY_S * thrust / mass == pytest.approx(float(self_fly_by_delta_v(1.0, speed)))
    # GTOC5 teams published 966 m/s for 0.4 km/s.
    assert float(self_fly_by_delta_v(1.0, 400.0)) == pytest.approx(965.685, abs=1e-3)
    assert self_fly_by_delta_v(0.5, speed) == self_fly_by_delta_v(1.0, speed)
    longer = self_fly_by_delta_v(np.array([1.0, 1.15, 2.0, 50.0]), speed)
    assert (np.diff(longer) < 0).all()
    assert longer[-1] == pytest.approx(speed, rel=0.02)


def test_the_solver_flies_a_light_self_fly_by_as_the_closed_form_says():
    maker = toy_problem().maker
    velocity = maker.fly_by_speed_m_s * even_directions(4)
    n = len(velocity)
    tof = np.full(n, float(shortest_self_fly_by_days(600.0, maker.fly_by_speed_m_s, 0.3)))
    legs = maker.self_fly_bys(
        np.arange(1, n + 1), np.full(n, 8000.0), velocity, tof, np.full(n, 600.0)
    )
    solved = solve_max_initial_mass(legs)
    assert solved.converged.all()
    # Three weeks are a short arc of an orbit; thrust changes the mass by 3 %.
    assert np.abs(solved.m0 / 600.0 - 1.0).max() < 0.07


# Geometry


def test_directions_are_even_unit_vectors_with_their_negatives():
    directions = even_directions(30)
    assert np.allclose(np.linalg.norm(directions, axis=1), 1.0)
    assert np.array_equal(directions[30:], -directions[:30])
    cosines = directions @ directions.T - 2.0 * np.eye(60)
    assert np.degrees(np.arccos(cosines.max(axis=1))).min() > 10.0


def test_phase_free_distance_is_that_of_textbook_transfers():
    base = [AU, 0.0, 0.0, 0.3, 0.4, 0.0]
    other = np.array([base] * 4)
    other[1, 0] *= 1.02
    other[2, 2] = np.radians(1.0)
    other[3, 5] = 2.0
    points = phase_free_points(Catalogue([1, 2, 3, 4], list("abcd"), 0.0, other, "here"))
    distance = np.linalg.norm(points - points[0], axis=1)
    # Edelbaum: circular to circular, difference of the speeds.
    assert distance[1] == pytest.approx(EARTH_VELOCITY * (1 - 1.02**-0.5), rel=0.01)
    assert distance[2] == pytest.approx(EARTH_VELOCITY * np.sin(np.radians(1.0)), rel=1e-6)
    assert distance[3] == 0.0


def test_lambert_departures_keep_to_the_range_of_speeds_along_an_arc():
    catalogue = near_earth_bodies()
    row, target = np.array([0, 1, 2, 3]), np.array([10, 11, 12, 13])
    t, tof = np.full(4, 8000.0), np.full(4, 200.0)
    free = lambert_departure(catalogue, row, t, target, tof, least_m_s=0.0, most_m_s=1e5)
    left, reached = catalogue.states_at(row, t), catalogue.states_at(target, t + tof)
    arcs, _ = lambert(left[:, :3], reached[:, :3], tof * DAY_S, max_revs=1)
    arcs = arcs - left[:, None, 3:]
    nearest = np.nanmin(np.linalg.norm(arcs - free[:, None], axis=2), axis=1)
    assert nearest.max() < 1e-6
    fixed = lambert_departure(catalogue, row, t, target, tof, least_m_s=401.0, most_m_s=401.0)
    assert np.allclose(np.linalg.norm(fixed, axis=1), 401.0)
    limited = lambert_departure(catalogue, row, t, target, tof, least_m_s=0.0, most_m_s=50.0)
    assert (np.linalg.norm(limited, axis=1) <= 50.0 + 1e-9).all()


# Moves


def test_the_problem_has_moves_of_its_own():
    problem = toy_problem()
    assert isinstance(problem, Problem)
    assert isinstance(problem.custom_moves, CustomMoves)
    assert problem.catalogue.ids[problem.start_rows()].tolist() == [0]


def _node_at(problem, row, mass):
    start = problem.start_nodes(np.array([0]), np.array([8000.0]))
    columns = {name: getattr(start, name) for name in Nodes.__dataclass_fields__}
    columns |= {
        "row": np.array([row]),
        "depth": np.array([1]),
        "mass": np.array([mass]),
        "visited": np.array([[0, row]]),
    }
    return Nodes(**columns)


def test_proposed_hops_are_chains_that_the_solver_flies(classifier):
    problem = toy_problem()
    settings = Settings(neighbours=30, tof_days_max=400.0)
    nodes = _node_at(problem, 5, 900.0)
    (found,) = problem.candidates(nodes, settings, classifier, 2)
    hops = found.hops
    fly_by, transfer = hops.legs
    assert found.questions > len(hops)
    assert 5 not in found.target
    assert 0 not in found.target
    assert np.allclose(transfer.rv_dep, fly_by.rv_arr, rtol=0, atol=1e-3)
    assert np.allclose(transfer.t_dep_mjd2000, fly_by.t_dep_mjd2000 + fly_by.tof_days)
    body = problem.catalogue.states_at(np.full(len(hops), 5), transfer.t_dep_mjd2000)
    assert np.allclose(np.linalg.norm(transfer.rv_dep - body, axis=1), 401.0)
    assert [float(mass[0]) for mass in hops.dropped_kg] == [1.0, 40.0]
    some = np.linspace(0, len(hops) - 1, 15).astype(int)
    solved = solve_hops(hops.take(some), "fast")
    assert solved.flyable.mean() > 0.9
    predicted = found.m_final[some][solved.flyable]
    true = solved.solutions[-1].m_final[solved.flyable]
    assert np.median(np.abs(predicted / true - 1.0)) < 0.05


def test_fly_bys_take_the_time_that_the_stretch_asks_for(classifier):
    problem = toy_problem()
    forecast = Gtoc5Forecast(
        problem.maker, phase_free_points(problem.catalogue), classifier, Settings()
    )
    days = forecast.fly_by_days(7, 8000.0, 700.0)
    assert np.array_equal(days[: len(days) // 2], days[len(days) // 2 :])
    closed = float(shortest_self_fly_by_days(700.0, problem.maker.fly_by_speed_m_s, 0.3))
    assert np.abs(days / (FLY_BY_STRETCH * closed) - 1.0).max() < 0.2


def test_a_node_without_time_or_mass_for_a_last_fly_by_proposes_nothing(classifier):
    settings = Settings(neighbours=30, tof_days_max=400.0)
    short = toy_problem(max_duration_days=60.0)
    assert list(short.candidates(_node_at(short, 5, 900.0), settings, classifier, 1)) == []
    problem = toy_problem()
    assert list(problem.candidates(_node_at(problem, 5, 560.0), settings, classifier, 1)) == []


def test_plain_hops_have_lambert_fly_bys_and_launches():
    problem = toy_problem()
    target, t, tof = np.array([8, 9]), np.full(2, 8000.0), np.full(2, 250.0)
    parent = np.zeros(2, dtype=np.intp)
    hops = problem.hops(_node_at(problem, 5, 900.0), parent, target, t, tof)
    assert len(hops.legs) == 2
    assert np.allclose(hops.tof_days, tof)
    launch = problem.hops(problem.start_nodes(np.array([0]), t[:1]), parent, target, t, tof)
    assert len(launch.legs) == 1
    assert launch.dropped_kg[0].tolist() == [40.0, 40.0]
    excess = launch.legs[0].rv_dep - problem.catalogue.states_at(parent, t)
    assert (np.linalg.norm(excess, axis=1) <= 5000.0 + 1e-6).all()


def test_launch_epochs_cover_the_window_and_follow_the_seed():
    problem = toy_problem()
    first, again, other = (
        problem.starts(Settings(start_epochs=10), np.random.default_rng(seed)).t_arr_mjd2000
        for seed in (1, 1, 2)
    )
    edges = np.linspace(*problem.first_departure_mjd2000, 11)
    assert ((edges[:-1] <= first) & (first <= edges[1:])).all()
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


# Tours


def _failed(tour, catalogue=None):
    return {check.name for check in verify_tour(tour, catalogue).checks if not check.passed}


def _change_leg(tour, k, **changes):
    legs = list(tour.legs)
    legs[k] = msgspec.structs.replace(legs[k], **changes)
    return msgspec.structs.replace(tour, legs=tuple(legs))


def _change_rules(tour, **changes):
    """Return the tour with other rules of GTOC5, scored by them."""
    own = Gtoc5Rules(**changes)
    rules = msgspec.structs.replace(
        tour.rules, events=own.events(tour.bodies[0]), score=own.points()
    )
    return _scored(msgspec.structs.replace(tour, rules=rules))


def _scored(tour):
    return msgspec.structs.replace(tour, score=tour.rules.score.score(tour.visits, tour.legs))


def test_a_found_tour_passes_and_scores_in_full(tour):
    assert _failed(tour, near_earth_bodies()) == set()
    assert tour.score == pytest.approx(tour.n_asteroids)
    assert len(tour.legs) == 2 * tour.n_asteroids
    assert [leg.is_fly_by for leg in tour.legs] == [False, True] * tour.n_asteroids
    assert tour.m_final_kg >= 500.0
    assert f"score {tour.score:.1f}" in tour.summary()


def test_a_gtoc5_tour_survives_a_round_trip(tour, tmp_path):
    path = tmp_path / "sequence.json"
    path.write_text(to_json(tour))
    assert read_tour(path) == tour
    rows = to_csv(tour).strip().split("\n")
    assert len(rows) == 1 + len(tour.legs)
    assert {row.count(",") for row in rows} == {rows[0].count(",")}


def test_the_same_seed_finds_the_same_tour(tour):
    settings = SearchSettings().with_(
        beam_width=4,
        start_epochs=3,
        neighbours=40,
        tof_days_max=400.0,
        pruner="default:0.99",
        audit={"per_rank": 0},
    )
    assert search(toy_problem(), settings=settings, rng=np.random.default_rng(2)).tour == tour


def test_fly_bys_score_only_after_a_rendezvous_and_once(tour):
    without = _scored(msgspec.structs.replace(tour, legs=tour.legs[:-1]))
    assert without.score == pytest.approx(tour.score - 0.8)
    assert _failed(without) == set()
    twice = _scored(msgspec.structs.replace(tour, legs=(*tour.legs, tour.legs[-1])))
    assert twice.score == pytest.approx(tour.score)
    assert "fly-bys of bodies met before, once each" in _failed(twice)
    bonus = _change_rules(tour, bonus_ids=(tour.bodies[1].id,))
    assert bonus.score == pytest.approx(tour.score + 0.5)
    stranger = _change_leg(tour, 1, to_id=tour.bodies[2].id)
    assert "fly-bys of bodies met before, once each" in _failed(stranger)


def test_a_launch_that_is_too_fast_is_found(tour):
    assert _failed(_change_rules(tour, launch_speed_max_m_s=1.0)) == {"launch speed"}
    faster = np.multiply(tour.legs[0].dep_velocity_m_s, 1.1)
    failed = _failed(_change_leg(tour, 0, dep_velocity_m_s=tuple(faster)))
    assert "position at each arrival" in failed


def test_a_fly_by_that_is_too_slow_is_found(tour):
    assert _failed(_change_rules(tour, fly_by_speed_min_m_s=402.0)) == {"speed of fly-bys"}


def test_a_velocity_that_comes_from_nowhere_is_found(tour):
    other = tuple(np.add(tour.legs[2].dep_velocity_m_s, [0.0, 3.0, 0.0]))
    failed = _failed(_change_leg(tour, 2, dep_velocity_m_s=other))
    assert "velocity continuous along the tour" in failed
    assert "position at each arrival" in failed


def test_a_stay_after_a_fly_by_is_found(tour):
    late = _change_leg(tour, 2, t_dep_mjd2000=tour.legs[2].t_dep_mjd2000 + 2.0)
    assert "no stay after a fly-by" in _failed(late)


def test_a_missing_package_or_penetrator_is_found(tour):
    for k in (0, 1):
        assert {"masses left behind", "mass continuous along the tour"} <= _failed(
            _change_leg(tour, k, dropped_kg=0.0)
        )
    assert _failed(_change_rules(tour, package_kg=41.0)) == {"masses left behind"}


def test_the_last_drop_counts_for_the_final_mass(tour):
    rules = msgspec.structs.replace(tour.rules, m_dry_kg=tour.legs[-1].m_final_kg - 0.5)
    assert _failed(msgspec.structs.replace(tour, rules=rules)) == {"final mass"}


def test_another_earth_is_found(tour):
    moved = msgspec.structs.replace(tour.bodies[0], mean_anomaly_rad=4.4959)
    failed = _failed(
        msgspec.structs.replace(tour, bodies=(moved, *tour.bodies[1:])), near_earth_bodies()
    )
    assert "launch from the planet of the problem statement" in failed


def test_fly_bys_do_not_belong_to_plain_problems(tour):
    rules = msgspec.structs.replace(tour.rules, events=())
    failed = _failed(msgspec.structs.replace(tour, rules=rules))
    assert {
        "fly-bys of bodies met before, once each",
        "launch speed",
        "masses left behind",
    } <= failed


# Problem file


def test_the_built_in_problem_has_the_figures_of_the_statement(shared):
    config = with_catalogue(read_config("gtoc5"), str(shared / GTOC5_TABLE))
    problem = build_problem(config)
    assert isinstance(problem, Gtoc5Problem)
    assert problem.rules == Gtoc5Rules()
    assert len(problem.catalogue) == 7076
    assert problem.catalogue.names[problem.catalogue.rows_of([1])[0]] == "14790 Beletskij"
    assert problem.max_duration_days == 15 * 365.25
    assert problem.first_departure_mjd2000 == (mjd_to_mjd2000(57023), mjd_to_mjd2000(61041))


def test_the_table_survives_being_written(tmp_path):
    config = read_config("gtoc5")
    path = tmp_path / "config.toml"
    path.write_text(to_toml(config))
    assert read_config(str(path)) == config


def test_a_search_without_a_model_says_what_is_missing():
    with pytest.raises(InputError, match="toy: its moves need a trained model"):
        search(toy_problem(), settings=SearchSettings(pruner="none"))


def test_problems_that_cannot_score_are_refused():
    with pytest.raises(InputError, match="of a single visit"):
        toy_problem(m0=550.0)
    bodies = near_earth_bodies(3)
    clash = Catalogue([0, 1, 2], bodies.names, 8000.0, bodies.elements, "clash")
    with pytest.raises(InputError, match="clash has a body with id 0"):
        toy_problem(catalogue=clash)


TOY = """
[problem]
name = "toy"
[spacecraft]
wet_mass_kg = 1200
dry_mass_kg = 500
thrust_n = 0.3
isp_s = 3000
[mission]
first_departure_mjd = [59000, 60000]
max_duration_days = 900
[gtoc5]
[catalogue]
file = "bodies.txt"
[search]
pruner = "default:0.99"
beam_width = 3
start_epochs = 2
neighbours = 30
tof_days_max = 400
[search.audit]
per_rank = 4
"""


def _write_table(catalogue, path):
    """Write bodies in the layout of GTOC5's table: argument of perihelion before node."""
    lines = ["#Epoch a e i w Node M Object", "#(TDB) (AU) (deg) (deg) (deg) (deg) (deg)"]
    for name, (a, e, *angles) in zip(catalogue.names, catalogue.elements, strict=True):
        i, node, argp, anomaly = np.degrees(angles)
        numbers = (59544.0, a / AU, e, i, argp, node, anomaly)
        lines.append(" ".join(f"{number:.15g}" for number in numbers) + f" {name}")
    path.write_text("\n".join(lines) + "\n")


def test_a_run_on_the_command_line_verifies_and_resumes_to_the_same_tour(tmp_path, capsys):
    _write_table(near_earth_bodies(), tmp_path / "bodies.txt")
    problem, out = tmp_path / "toy.toml", tmp_path / "run"
    problem.write_text(TOY)
    arguments = ["run", str(problem), "--out", str(out), "--workers", "1"]
    assert main(arguments) == 0
    assert "score 4.0, 4 asteroids" in capsys.readouterr().out
    whole = (out / "sequence.json").read_bytes()
    assert main(["verify", str(out), "--catalogue", str(tmp_path / "bodies.txt")]) == 0
    assert "speed of fly-bys" in capsys.readouterr().out
    assert main(["plot", str(out), "--out", str(tmp_path / "tour.svg")]) == 0
    assert main(["resume", str(out), "--from-rank", "1:1", "--workers", "1"]) == 0
    assert (out / "sequence.json").read_bytes() == whole
