"""GTOC2: groups, orbits and forecasts, launches and transfers, and a tour found and verified."""

from itertools import permutations

import msgspec
import numpy as np
import pytest

from feasibility import FeasibilityClassifier, InputError, Spacecraft
from feasibility.constants import AU, EARTH_VELOCITY, mjd_to_mjd2000
from feasibility.orbits import Catalogue
from seqsearch import RendezvousProblem, SearchSettings, search, verify_tour
from seqsearch.commands.cli import main
from seqsearch.core.check_problem import check_problem
from seqsearch.core.hops import Hops
from seqsearch.core.nodes import Nodes
from seqsearch.core.optimisation import solve_hops
from seqsearch.core.problem import Problem
from seqsearch.problems.gtoc2 import RULES, build
from seqsearch.problems.gtoc2 import problem as gtoc2_problem
from seqsearch.problems.gtoc2.delta_v import delta_v_to_go, transfer_delta_v
from seqsearch.problems.gtoc2.group_sets import GroupSets
from seqsearch.problems.gtoc2.plans import LEVELS
from seqsearch.problems.gtoc2.problem import Gtoc2Problem
from seqsearch.problems.gtoc2.prospects import Prospects
from seqsearch.problems.gtoc2.rules import Gtoc2Rules
from seqsearch.problems.moves.directions import even_directions, ring_around
from seqsearch.problems.problem_file import build_problem, read_config, to_toml, with_catalogue
from seqsearch.settings import AuditSettings
from seqsearch.tours.events import Groups, Launch
from seqsearch.tours.tour_files import read_tour, to_json

GTOC2_TABLE = "gtoc/official/GTOC2-DATA.txt"

SETTINGS = SearchSettings(
    beam_width=6,
    starts=6,
    neighbours=20,
    tof_days_min=60.0,
    tof_days_max=900.0,
    pruner="default:0.99",
    audit=AuditSettings(per_rank=0),
)


def bodies_in_groups(n=48, groups=(7.0, 3.0, 5.0)):
    """Return bodies on orbits a little larger than the Earth's, each in one of some groups."""
    rng = np.random.default_rng(5)
    elements = np.column_stack(
        [
            AU * rng.uniform(1.0, 1.15, n),
            rng.uniform(0.0, 0.06, n),
            np.radians(rng.uniform(0.0, 1.5, n)),
            rng.uniform(0.0, 2 * np.pi, (n, 3)),
        ]
    )
    return Catalogue(
        ids=np.arange(1, n + 1),
        names=[f"body {k}" for k in range(1, n + 1)],
        epoch_mjd2000=8000.0,
        elements=elements,
        source="three groups",
        extra={"group": np.resize(groups, n)},
    )


def toy_problem(**changes):
    values = {
        "name": "toy",
        "catalogue": bodies_in_groups(),
        "spacecraft": Spacecraft(m_dry=500.0, thrust=0.1, isp=4000.0),
        "m0": 900.0,
        "first_departure_mjd2000": (mjd_to_mjd2000(59000.0), mjd_to_mjd2000(60000.0)),
        "max_duration_days": 3000.0,
        "min_stay_days": 90.0,
    }
    return Gtoc2Problem(base=RendezvousProblem(**(values | changes)), rules=Gtoc2Rules())


def nodes_at(problem, rows, mass=800.0, elapsed=200.0):
    """Return nodes of depth 1 at bodies; the launch was some days ago."""
    rows = np.asarray(rows)
    n = len(rows)
    start = problem.start_nodes(np.zeros(n, dtype=np.intp), np.full(n, 8000.0))
    columns = {name: getattr(start, name) for name in Nodes.__dataclass_fields__}
    columns |= {
        "row": rows,
        "depth": np.ones(n, dtype=np.int64),
        "t_arr_mjd2000": np.full(n, 8000.0 + elapsed),
        "t_ready_mjd2000": np.full(n, 8090.0 + elapsed),
        "mass": np.full(n, mass),
        "visited": np.column_stack([np.zeros(n, dtype=np.intp), rows]),
    }
    return Nodes(**columns)


@pytest.fixture(scope="module")
def classifier():
    return FeasibilityClassifier.load()


@pytest.fixture(scope="module")
def tour():
    result = search(toy_problem(), settings=SETTINGS, rng=np.random.default_rng(2))
    assert result.stopped == "complete"
    return result.tour


# Groups and forecasts


def test_sets_of_groups_lose_the_groups_of_visited_bodies():
    groups = GroupSets(np.array([-1, 0, 1, 2, 1]))
    visited = np.array([[0, -1, -1], [0, 2, -1], [0, 3, 1], [3, 1, 4]])
    left = groups.left(visited)
    assert groups.count == 3
    assert left.tolist() == [0b111, 0b101, 0b010, 0]
    assert groups.sizes[left].tolist() == [3, 2, 1, 0]
    assert groups.contain(left[1], np.arange(5)).tolist() == [False, True, False, True, False]
    assert groups.without(left[:2], np.array([3, 1])).tolist() == [0b011, 0b100]


def test_delta_v_is_that_of_textbook_transfers():
    base = [AU, 0.0, 0.0, 0.3, 0.4, 0.0]
    other = np.array([base] * 4)
    other[1, 0] *= 1.02
    other[2, 2] = np.radians(1.0)
    other[3, 5] = 2.0
    delta_v = transfer_delta_v(Catalogue([1, 2, 3, 4], list("abcd"), 0.0, other, "here"))
    assert np.array_equal(delta_v, delta_v.T)
    # Edelbaum: circular to circular, difference of the speeds; pi / 2 for a change of plane.
    assert delta_v[0, 1] == pytest.approx(EARTH_VELOCITY * (1 - 1.02**-0.5), rel=0.15)
    assert delta_v[0, 2] == pytest.approx(EARTH_VELOCITY * np.radians(1.0) * np.pi / 2, rel=0.06)
    assert delta_v[0, 3] == pytest.approx(0.0, abs=1e-3)


def test_delta_v_to_go_is_the_least_over_all_orders_and_bodies():
    rng = np.random.default_rng(1)
    # One body a group: no nearest is so rare that another counts.
    groups = GroupSets(np.array([-1, 0, 1, 2]))
    delta_v = rng.uniform(1.0, 2.0, (4, 4))
    ways = [
        sum(delta_v[a, b] for a, b in zip((0, *order), order, strict=False))
        for order in permutations((1, 2, 3))
    ]
    to_go = delta_v_to_go(delta_v, groups)
    assert to_go[0b111, 0] == pytest.approx(min(ways))
    assert to_go[0b010, 1] == delta_v[1, 2]
    assert (to_go[0] == 0.0).all()


def test_the_forecast_of_a_complete_tour_is_its_score():
    outlook = toy_problem().outlook
    row, years, mass = np.array([1, 2]), np.array([4.0, 5.0]), np.array([700.0, 800.0])
    score = outlook.score(row, np.zeros(2, dtype=np.intp), years * 365.25, mass)
    assert score == pytest.approx(mass / years)
    before = outlook.score(row, np.array([0b100, 0b011]), years * 365.25, mass)
    assert (before < score).all()


def test_the_best_targets_of_each_node_come_first():
    problem = toy_problem()
    nodes = nodes_at(problem, [1, 2, 3])
    prospects = Prospects(problem.outlook, nodes)
    pairs = prospects.pairs(np.array([0, 2]), 0.0, 7)
    assert pairs.parent.tolist() == [0] * 7 + [2] * 7
    assert problem.may_visit(nodes, pairs.target.reshape(2, 7)[[0, 1, 1]])[[0, 2]].all()
    tof = np.where(np.arange(14) == 3, np.nan, 300.0)
    tof[9] = 100.0
    best = prospects.best(pairs, tof, 4)
    assert 3 not in best
    assert pairs.parent[best].tolist() == [0] * 4 + [2] * 4
    assert best[4] == 9


def test_rings_lie_around_their_directions():
    directions = even_directions(5)
    ring = ring_around(directions, 0.3, 6)
    assert np.allclose(np.linalg.norm(ring, axis=2), 1.0)
    assert np.allclose((ring * directions[:, None]).sum(axis=2), np.cos(0.3))
    assert np.allclose(ring.mean(axis=1), np.cos(0.3) * directions)


# Moves


def test_the_problem_honours_the_contract(classifier):
    problem = toy_problem()
    assert isinstance(problem, Problem)
    check_problem(problem, predictor=classifier)
    assert problem.catalogue.ids[problem.start_rows()].tolist() == [0]
    assert [len(group) for group in problem.group_ids] == [16, 16, 16]
    assert problem.group_ids[0] == tuple(range(2, 48, 3))  # value 3 of 7, 3, 5


def test_a_body_of_a_group_that_was_visited_may_not_be_visited():
    problem = toy_problem()
    nodes = nodes_at(problem, [4])
    target = np.array([[0, 1, 4, 7, 2, 3]])
    assert problem.may_visit(nodes, target).tolist() == [[False, False, False, False, True, True]]


def test_launches_keep_to_the_speed_and_beat_those_along_lambert_arcs(classifier, monkeypatch):
    # The directions as planned: the solver is free to find others.
    monkeypatch.setattr(gtoc2_problem, "freed_launch", lambda hops, *_: hops)
    problem = toy_problem()
    nodes = problem.starts(SETTINGS.with_(starts=3), np.random.default_rng(4))
    parts = list(problem.candidates(nodes, SETTINGS, classifier, 1))
    parent, target = (np.concatenate([getattr(p, c) for p in parts]) for c in ("parent", "target"))
    legs = [part.hops.legs[0] for part in parts]
    tof = np.concatenate([leg.tof_days for leg in legs])
    speed = np.concatenate(
        [np.linalg.norm((leg.rv_dep - _earth(problem, leg))[:, 3:], axis=1) for leg in legs]
    )
    assert (np.diff(parent) >= 0).all()
    assert set(parent) == {0, 1, 2}
    assert 0 not in target
    assert (speed <= 3500.0 + 1e-6).all()
    along = problem.hops(nodes, parent, target, nodes.t_ready_mjd2000[parent], tof).legs[0]
    ours = np.concatenate([classifier.margin(leg) for leg in legs])
    assert (ours >= 0.98 * classifier.margin(along)).mean() > 0.9
    assert np.nanmedian(ours / classifier.margin(along)) > 1.05


def test_the_solver_launches_at_least_as_well_as_planned(classifier, monkeypatch):
    problem = toy_problem()
    nodes = problem.starts(SETTINGS.with_(starts=3), np.random.default_rng(4))

    def launches():
        parts = problem.candidates(nodes, SETTINGS, classifier, 1)
        return Hops.concatenate([part.hops for part in parts]).take(np.arange(12))

    free = launches()
    monkeypatch.setattr(gtoc2_problem, "freed_launch", lambda hops, *_: hops)
    planned = launches()
    assert (free.legs[0].vinf_dep < 3500.0).all()
    assert (free.legs[0].vinf_dep > 3499.0).all()
    assert not planned.legs[0].vinf_dep.any()
    one, other = (solve_hops(hops, "fast") for hops in (free, planned))
    assert (one.m_star[0] > 0.998 * other.m_star[0]).all()
    assert np.median(one.m_star[0] / other.m_star[0]) > 1.0


def _earth(problem, legs):
    return problem.catalogue.states_at(np.zeros(len(legs), dtype=np.intp), legs.t_dep_mjd2000)


def test_proposed_transfers_are_flyable_at_the_margins_that_were_wanted(classifier):
    problem = toy_problem()
    nodes = nodes_at(problem, [1, 5, 9, 12])
    (part,) = problem.candidates(nodes, SETTINGS, classifier, 2)
    assert (np.diff(part.parent) >= 0).all()
    assert set(part.parent) == {0, 1, 2, 3}
    assert problem.may_visit(nodes.take(part.parent), part.target[:, None]).all()
    legs = part.hops.legs[0]
    assert (legs.t_dep_mjd2000 == nodes.t_ready_mjd2000[part.parent]).all()
    level = np.log(classifier.margin(legs))
    assert np.abs(level[:, None] - np.array(LEVELS)).min(axis=1).max() < 0.1
    some = np.linspace(0, len(part.target) - 1, 20).astype(int)
    solved = solve_hops(part.hops.take(some), "fast")
    assert solved.flyable.mean() > 0.9
    found = solved.solutions[-1].m_final[solved.flyable]
    assert np.median(np.abs(part.m_final[some][solved.flyable] / found - 1.0)) < 0.02


def test_candidates_do_not_depend_on_threads_or_on_the_nodes_beside(classifier):
    problem = toy_problem()
    nodes = nodes_at(problem, np.arange(1, 22))
    one, two = (list(problem.candidates(nodes, SETTINGS, classifier, k)) for k in (1, 2))
    assert [part.questions for part in one] == [part.questions for part in two]
    assert all(np.array_equal(a.m_final, b.m_final) for a, b in zip(one, two, strict=True))
    (alone,) = problem.candidates(nodes.take(np.array([3])), SETTINGS, classifier, 1)
    beside = one[0].parent == 3
    assert np.array_equal(one[0].target[beside], alone.target)
    assert np.array_equal(one[0].m_final[beside], alone.m_final)


def test_a_complete_tour_goes_nowhere_and_neither_does_one_without_time(classifier):
    problem = toy_problem()
    nodes = nodes_at(problem, [1])
    visited = np.array([[0, 1, 2, 3]])
    columns = {name: getattr(nodes, name) for name in Nodes.__dataclass_fields__}
    complete = Nodes(**(columns | {"visited": visited, "depth": np.array([3])}))
    assert list(problem.candidates(complete, SETTINGS, classifier, 1)) == []
    late = nodes_at(toy_problem(), [1], elapsed=2900.0)
    assert list(problem.candidates(late, SETTINGS, classifier, 1)) == []
    light = nodes_at(toy_problem(), [1], mass=501.0)
    assert all(
        (part.m_final >= 500.0).all()
        for part in problem.candidates(light, SETTINGS, classifier, 1)
    )


def test_costs_order_complete_tours_by_score():
    problem = toy_problem()
    nodes = nodes_at(problem, [3, 3], elapsed=np.array([1461.0, 1826.25]), mass=600.0)
    columns = {name: getattr(nodes, name) for name in Nodes.__dataclass_fields__}
    complete = Nodes(**(columns | {"visited": np.array([[0, 1, 2, 3]] * 2)}))
    assert problem.tour_cost(complete, SETTINGS).tolist() == [-150.0, -120.0]


def test_launch_epochs_cover_the_window_and_follow_the_seed():
    problem = toy_problem()
    settings = SETTINGS.with_(starts=10)
    first, again, other = (
        problem.starts(settings, np.random.default_rng(seed)).t_arr_mjd2000 for seed in (1, 1, 2)
    )
    edges = np.linspace(*problem.first_departure_mjd2000, 11)
    assert ((edges[:-1] <= first) & (first <= edges[1:])).all()
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


# Tours


def _failed(tour, catalogue=None):
    return {check.name for check in verify_tour(tour, catalogue).checks if not check.passed}


def _with_events(tour, *events):
    rules = msgspec.structs.replace(tour.rules, events=events)
    return msgspec.structs.replace(tour, rules=rules)


def test_a_found_tour_visits_each_group_passes_and_scores(tour):
    assert _failed(tour, bodies_in_groups()) == set()
    groups = toy_problem().group_ids
    visited = [body.id for body in tour.visits]
    assert sorted(k for body in visited for k in range(3) if body in groups[k]) == [0, 1, 2]
    assert tour.score == pytest.approx(tour.m_final_kg / tour.duration_days * 365.25)
    assert tour.score > 100.0
    for before, after in zip(tour.legs[:-1], tour.legs[1:], strict=True):
        assert after.t_dep_mjd2000 >= before.t_arr_mjd2000 + 90.0 - 1e-9
    assert "J " in tour.summary()
    assert "kg/year" in tour.summary()


def test_the_same_seed_finds_the_same_tour(tour):
    assert search(toy_problem(), settings=SETTINGS, rng=np.random.default_rng(2)).tour == tour


def test_a_tour_survives_a_round_trip(tour, tmp_path):
    path = tmp_path / "sequence.json"
    path.write_text(to_json(tour))
    assert read_tour(path) == tour


def test_a_tour_that_breaks_the_rules_is_found_out(tour):
    launch, groups = tour.rules.events
    assert isinstance(launch, Launch)
    assert isinstance(groups, Groups)
    slow = msgspec.structs.replace(launch, speed_max_m_s=1.0)
    assert _failed(_with_events(tour, slow, groups)) == {"launch speed"}
    merged = msgspec.structs.replace(groups, ids=(groups.ids[0] + groups.ids[1], groups.ids[2]))
    assert "one body of each group" in _failed(_with_events(tour, launch, merged))


# Problem file


def test_the_built_in_problem_has_the_figures_of_the_statement(shared):
    problem = build_problem(with_catalogue(read_config("gtoc2"), str(shared / GTOC2_TABLE)))
    assert isinstance(problem, Gtoc2Problem)
    assert problem.rules == Gtoc2Rules()
    assert [len(group) for group in problem.group_ids] == [96, 176, 300, 338]
    assert problem.first_departure_mjd2000 == (mjd_to_mjd2000(57023.5), mjd_to_mjd2000(64693.5))
    assert problem.max_duration_days == 20 * 365.25
    assert problem.min_stay_days == 90.0
    assert (problem.m0, problem.spacecraft) == (1500.0, Spacecraft(500.0, 0.1, 4000.0))


def test_near_earth_asteroids_come_first_on_the_official_table(shared):
    problem = build_problem(with_catalogue(read_config("gtoc2"), str(shared / GTOC2_TABLE)))
    nodes = problem.start_nodes(np.array([0]), np.array([8000.0]))
    pairs = Prospects(problem.outlook, nodes).pairs(np.array([0]), 3500.0, 30)
    assert set(problem.catalogue.ids[pairs.target]) < set(problem.group_ids[3])
    # The first asteroids of the five best tours of the competition's winners.
    winners = {3258076, 3070801, 3329255, 3250293}
    assert winners < set(problem.catalogue.ids[pairs.target])


def test_the_table_survives_being_written(tmp_path):
    config = read_config("gtoc2")
    path = tmp_path / "config.toml"
    path.write_text(to_toml(config))
    assert read_config(str(path)) == config


def test_the_plug_in_builds_the_problem():
    base = toy_problem().base
    problem = build(base, RULES(launch_speed_max_m_s=1000.0))
    assert isinstance(problem, Gtoc2Problem)
    assert problem.tour_rules().events[0].speed_max_m_s == 1000.0


def test_catalogues_that_do_not_fit_are_refused():
    bodies = bodies_in_groups(3)
    arguments = (bodies.names, 8000.0, bodies.elements)
    with pytest.raises(InputError, match="clash has a body with id 0"):
        toy_problem(catalogue=Catalogue([0, 1, 2], *arguments, "clash", extra=bodies.extra))
    with pytest.raises(InputError, match=r"no column 'group'.*further columns: none"):
        toy_problem(catalogue=Catalogue([1, 2, 3], *arguments, "plain"))


TOY = """
[problem]
name = "toy"
[spacecraft]
wet_mass_kg = 900
dry_mass_kg = 500
thrust_n = 0.1
isp_s = 4000
[mission]
first_departure_mjd = [59000, 60000]
max_duration_days = 3000
min_stay_days = 90
[gtoc2]
[catalogue]
file = "bodies.txt"
[search]
pruner = "default:0.99"
beam_width = 3
starts = 3
neighbours = 20
tof_days_max = 900
[search.audit]
per_rank = 4
"""


def _write_table(catalogue, path):
    """Write bodies in the layout of GTOC2's table."""
    lines = ["spkid a(AU) e i(deg) LAN(deg) argperi(deg) M(deg) epoch(MJD) group"]
    rows = zip(catalogue.ids, catalogue.elements, catalogue.extra["group"], strict=True)
    for body, (a, e, *angles), group in rows:
        i, node, argp, anomaly = np.degrees(angles)
        numbers = (a / AU, e, i, node, argp, anomaly, 59544.0)
        lines.append(
            f"{body} " + " ".join(f"{number:.15g}" for number in numbers) + f" {group:.0f}"
        )
    path.write_text("\n".join(lines) + "\n")


def test_a_run_on_the_command_line_verifies_and_resumes_to_the_same_tour(tmp_path, capsys):
    _write_table(bodies_in_groups(groups=(1.0, 2.0, 3.0)), tmp_path / "bodies.txt")
    problem, out = tmp_path / "toy.toml", tmp_path / "run"
    problem.write_text(TOY)
    arguments = ["run", str(problem), "--out", str(out), "--workers", "1"]
    assert main(arguments) == 0
    assert "kg/year" in capsys.readouterr().out
    whole = (out / "sequence.json").read_bytes()
    assert main(["verify", str(out), "--catalogue", str(tmp_path / "bodies.txt")]) == 0
    assert "one body of each group" in capsys.readouterr().out
    assert main(["resume", str(out), "--from-rank", "1:2", "--workers", "1"]) == 0
    assert (out / "sequence.json").read_bytes() == whole
