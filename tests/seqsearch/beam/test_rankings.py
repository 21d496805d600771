"""Rankings and the frontier by time slices, against brute force."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from feasibility import InputError, Legs
from feasibility.orbits import OrbitalNeighbours
from seqsearch import search
from seqsearch.beam.frontiers.time_slices import TimeSliceFrontier
from seqsearch.beam.rankings import BalancedRanking, ParetoRanking, PotentialRanking, make_ranking
from seqsearch.beam.rankings.pareto import pareto_fronts
from seqsearch.beam.rankings.time_propellant import TimePropellantRanking
from seqsearch.core.nodes import Nodes
from seqsearch.settings import SearchSettings
from tests.helpers.problems import small_problem

_points = st.lists(st.tuples(st.integers(0, 6), st.integers(0, 6)), min_size=1, max_size=40)


class _ByThrust:
    """A predictor with a rule that can be checked by hand: flyable within `days`."""

    def __init__(self, days: float) -> None:
        self.days = days

    def margin(self, legs: Legs, /):
        return legs.tof_days / self.days

    def final_mass(self, legs: Legs, /):
        return 0.95 * legs.m0


def _nodes(problem, rows, depth, elapsed, mass) -> Nodes:
    n = len(rows)
    width = int(np.max(depth)) + 1
    visited = np.full((n, width), -1, dtype=np.intp)
    for i in range(n):
        visited[i, : depth[i]] = 100 + i
        visited[i, depth[i]] = rows[i]
    epoch = problem.first_departure_mjd2000[0] + np.asarray(elapsed, dtype=float)
    return Nodes(
        row=np.asarray(rows, dtype=np.intp),
        depth=np.asarray(depth, dtype=np.int64),
        t_ready_mjd2000=epoch + 30.0,
        t_arr_mjd2000=epoch,
        t_first_mjd2000=np.full(n, problem.first_departure_mjd2000[0]),
        mass=np.asarray(mass, dtype=float),
        visited=visited,
        tree_id=np.arange(n),
        parent_id=1000 + np.arange(n),
    )


def _brute_fronts(points):
    left = dict(enumerate(points))
    fronts = {}
    while left:
        beaten = {
            i
            for i, p in left.items()
            if any(q[0] <= p[0] and q[1] <= p[1] and q != p for q in left.values())
        }
        k = max(fronts.values(), default=-1) + 1
        for i in [i for i in left if i not in beaten]:
            fronts[i] = k
            del left[i]
    return [fronts[i] for i in range(len(points))]


@given(_points)
def test_pareto_fronts_are_those_of_peeling_off_the_undominated(points):
    x, y = np.asarray(points, dtype=float).T
    assert pareto_fronts(x, y).tolist() == _brute_fronts(points)


@given(_points)
def test_pareto_ranking_puts_no_node_before_one_that_is_earlier_and_heavier(points):
    problem = small_problem()
    elapsed, used = np.asarray(points, dtype=float).T
    nodes = _nodes(problem, range(len(points)), [2] * len(points), elapsed, 1900 - used)
    score = ParetoRanking(TimePropellantRanking()).score(nodes, problem)
    for i, j in itertools.permutations(range(len(points)), 2):
        if points[i] != points[j] and (
            elapsed[i] <= elapsed[j] and nodes.mass[i] >= nodes.mass[j]
        ):
            assert score[i] < score[j]


@given(_points)
def test_balanced_ranking_is_the_sum_where_both_are_equally_scarce(points):
    problem = small_problem()
    elapsed, used = np.asarray(points, dtype=float).T
    sums, balanced = TimePropellantRanking(1.0, 0.4), BalancedRanking(1.0, 0.4)
    nodes = _nodes(problem, range(len(points)), [2] * len(points), elapsed, 1900 - used)
    assert (balanced.score(nodes, problem) >= sums.score(nodes, problem) - 1e-12).all()
    share = elapsed / problem.max_duration_days
    even = _nodes(
        problem, range(len(points)), [2] * len(points), elapsed, problem.m0 - 1200.0 * share
    )
    assert balanced.score(even, problem) == pytest.approx(sums.score(even, problem))


def test_balanced_ranking_prefers_what_can_still_fly():
    problem = small_problem()
    left = problem.max_duration_days
    nodes = _nodes(problem, [0, 1], [2, 2], [0.7 * left, 0.8 * left], [801.0, 1040.0])
    assert np.argmin(TimePropellantRanking(1.0, 0.35).score(nodes, problem)) == 0
    assert np.argmin(BalancedRanking(1.0, 0.35).score(nodes, problem)) == 1
    empty = _nodes(problem, [0, 1], [2, 2], [left, 0.5 * left], [800.0, 800.0])
    assert np.isfinite(BalancedRanking(1.0, 0.35).score(empty, problem)).all()


@pytest.mark.parametrize(
    ("days", "share"), [(80.0, 1.0), (110.0, 2 / 3), (150.0, 1 / 3), (161.0, 0)]
)
def test_potential_counts_the_soonest_flyable_time_of_each_near_body(days, share):
    problem = small_problem()
    neighbours = OrbitalNeighbours(problem.catalogue)
    base = TimePropellantRanking()
    ranking = PotentialRanking(base, _ByThrust(days), neighbours, weight=0.2, n_near=5)
    nodes = _nodes(problem, [0, 3], [1, 1], [200.0, 300.0], [1800.0, 1500.0])
    assert ranking.potential(nodes, problem) == pytest.approx(share)
    expected = base.score(nodes, problem) + 0.2 * (1 - share)
    assert ranking.score(nodes, problem) == pytest.approx(expected)


def test_potential_does_not_depend_on_what_was_asked_before():
    problem = small_problem()
    neighbours = OrbitalNeighbours(problem.catalogue)

    def fresh():
        return PotentialRanking(TimePropellantRanking(), _Odd(), neighbours, n_near=5)

    nodes = _nodes(problem, [0, 3, 0, 5], [1] * 4, [200.0, 300.0, 205.0, 10.0], [1800.0] * 4)
    together = fresh().score(nodes, problem)
    ranking = fresh()
    one_by_one = [ranking.score(nodes.take(np.array([i])), problem)[0] for i in (3, 1, 2, 0)]
    assert together[[3, 1, 2, 0]].tolist() == one_by_one


class _Odd:
    def margin(self, legs: Legs, /):
        assert legs.arr_id is not None
        return np.where(legs.arr_id % 2 == 1, 1.5, 0.5)

    def final_mass(self, legs: Legs, /):
        return legs.m0


def test_ranking_by_potential_without_a_classifier_is_an_error_that_says_so():
    problem = small_problem()
    settings = SearchSettings(ranking="potential")
    with pytest.raises(InputError, match=r"potential.*classifier"):
        make_ranking(settings, None, OrbitalNeighbours(problem.catalogue))


_race = st.lists(
    st.tuples(st.integers(1, 3), st.integers(0, 199), st.integers(900, 1900)),
    min_size=1,
    max_size=25,
)


@given(_race, st.integers(1, 4))
def test_time_slices_give_out_the_best_of_each_slice_earliest_first(race, beam_width):
    problem = small_problem()
    settings = SearchSettings().with_(
        frontier={"kind": "time", "slice_days": 50.0, "max_per_cell": 1000}
    )
    ranking = TimePropellantRanking(settings.time_weight, settings.propellant_weight)
    depth, elapsed, mass = (np.asarray(column) for column in zip(*race, strict=True))
    # Every node at a body of its own, so that no cap but the beam width acts.
    nodes = _nodes(problem, range(len(race)), depth, elapsed, mass)
    score = ranking.score(nodes, problem) - 1.6 * depth / settings.frontier.nominal_visits
    frontier = TimeSliceFrontier(settings, problem, ranking)
    admitted = frontier.admit(nodes, beam_width)
    for number in range(5):
        inside = np.flatnonzero(elapsed // 50.0 == number)
        best = inside[np.argsort(score[inside], kind="stable")][:beam_width]
        assert sorted(set(admitted) & set(inside)) == sorted(best)
    frontier.push(nodes)
    given_out = []
    while len(out := frontier.pop(beam_width)):
        given_out.append(out.tree_id.tolist())
    slices = [set(elapsed[ids] // 50.0) for ids in given_out]
    assert all(len(s) == 1 for s in slices)
    assert [min(s) for s in slices] == sorted({e // 50.0 for e in elapsed})
    assert sorted(i for ids in given_out for i in ids) == sorted(admitted)


@given(_race)
def test_a_frontier_made_anew_from_what_waits_goes_on_as_the_old_one(race):
    problem = small_problem()
    settings = SearchSettings().with_(frontier={"kind": "time", "slice_days": 50.0})
    ranking = TimePropellantRanking()
    depth, elapsed, mass = (np.asarray(column) for column in zip(*race, strict=True))
    nodes = _nodes(problem, range(len(race)), depth, elapsed, mass)
    old = TimeSliceFrontier(settings, problem, ranking)
    old.push(nodes)
    old.pop(2)
    waiting = old.waiting()
    new = TimeSliceFrontier(settings, problem, ranking)
    new.push(waiting)
    while len(a := old.pop(2)):
        assert new.pop(2).tree_id.tolist() == a.tree_id.tolist()
    assert len(new.pop(2)) == 0


@pytest.mark.parametrize("changes", [{"frontier": {"kind": "time"}}, {"ranking": "pareto"}])
def test_a_search_with_another_order_finds_a_tour(changes):
    problem = small_problem()
    settings = SearchSettings().with_(
        pruner="lambert:1.3,mima2:0.97",
        beam_width=8,
        starts=10,
        start_epochs=3,
        neighbours=12,
        solves_per_rank=60,
        **changes,
    )
    result = search(problem, settings=settings)
    depths = [node["rank"] for _, node in result.tree.graph.nodes(data=True)]
    assert result.tour.n_asteroids - 1 == max(depths) >= 2
