"""Scouting: beams of predicted legs, the pool of what they found, and passes that keep to it."""

import itertools
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from feasibility.orbits import OrbitalNeighbours
from seqsearch import search
from seqsearch.beam.counters import RankCounters
from seqsearch.beam.endings.free import FreeEnds
from seqsearch.beam.forecast import Forecast
from seqsearch.beam.rankings.time_propellant import TimePropellantRanking
from seqsearch.beam.scouting.guide import ItineraryGuide, starts_of
from seqsearch.beam.scouting.pool import Pool
from seqsearch.beam.scouting.regions import starts_near, window_part
from seqsearch.beam.scouting.scout import scout
from seqsearch.beam.scouting.scouts import Scouts
from seqsearch.beam.starts import dense_starts
from seqsearch.core.nodes import Nodes
from seqsearch.tours.verify import verify_tour
from tests.helpers.predictors import Toy
from tests.helpers.problems import small_problem, small_settings

RANKING = TimePropellantRanking()


@pytest.fixture(scope="module")
def problem():
    return small_problem()


@pytest.fixture(scope="module")
def neighbours(problem):
    return OrbitalNeighbours(problem.catalogue)


def _ends(*tours, elapsed_days=500.0, mass=1500.0):
    """Return ends of tours, given as bodies in order of visit."""
    width = max(map(len, tours))
    visited = np.array([list(tour) + [-1] * (width - len(tour)) for tour in tours])
    n = len(tours)
    elapsed = np.broadcast_to(elapsed_days, n)
    return Nodes(
        row=np.array([tour[-1] for tour in tours]),
        depth=np.array([len(tour) - 1 for tour in tours]),
        t_ready_mjd2000=8000.0 + elapsed + 30.0,
        t_arr_mjd2000=8000.0 + elapsed,
        t_first_mjd2000=np.full(n, 8000.0),
        mass=np.array(np.broadcast_to(mass, n), dtype=float),
        visited=visited,
        tree_id=np.full(n, -1),
        parent_id=np.full(n, -1),
    )


def _visits(nodes):
    return [
        tuple(v[: d + 1])
        for v, d in zip(nodes.visited.tolist(), nodes.depth.tolist(), strict=True)
    ]


def test_itineraries_obey_the_rules_of_the_problem(problem, neighbours):
    settings = small_settings(beam_width=20, starts=40, tof_days_max=240.0)
    starts = problem.start_nodes(
        *dense_starts(problem, neighbours, settings, np.random.default_rng(1))
    )
    scouted = scout(
        problem, Forecast(problem, Toy(), neighbours), FreeEnds(problem), starts, settings
    )
    leaves = scouted.leaves
    assert leaves.depth.max() >= 2
    assert set(np.unique(leaves.depth)) <= {leaves.depth.max(), leaves.depth.max() - 1}
    assert (leaves.t_arr_mjd2000 - leaves.t_first_mjd2000 <= problem.max_duration_days).all()
    assert (leaves.mass >= problem.spacecraft.m_dry).all()
    sets = [frozenset(visits) for visits in _visits(leaves)]
    assert [len(bodies) for bodies in sets] == (leaves.depth + 1).tolist()
    for depth in np.unique(leaves.depth):
        of_depth = [bodies for bodies in sets if len(bodies) == depth + 1]
        assert len(set(of_depth)) == len(of_depth)
    assert scouted.questions > scouted.nodes > 0


def test_predicted_itineraries_are_what_the_guided_pass_flies(problem, neighbours):
    settings = small_settings(
        pruner="default:0.99", scouts={"generations": 1, "width": 10}, tof_days_max=240.0
    )
    result = search(problem, settings=settings, rng=np.random.default_rng(2))
    scouts = result.counters[0]
    assert (scouts.rank, scouts.optimised) == (0, 0)
    assert scouts.kept > 0
    flown = sum(record.optimised for record in result.counters)
    assert 0 < flown < scouts.proposed / 10
    assert sum(record.feasible for record in result.counters) > 0.9 * flown
    assert result.tour.n_asteroids > 2
    assert verify_tour(result.tour).passed


def test_a_guided_pass_visits_nothing_but_its_itineraries(problem):
    settings = small_settings(
        pruner="default:0.99", scouts={"generations": 1, "width": 10}, tof_days_max=240.0
    )
    guides = []
    result = search(
        problem,
        settings=settings,
        rng=np.random.default_rng(2),
        on_rank=lambda state: guides.append(state.guide),
    )
    itineraries = _visits(guides[0])
    prefixes = {visits[: k + 1] for visits in itineraries for k in range(len(visits))}
    reached = 0
    for node in result.tree.graph:
        legs = result.tree.legs_to(node)
        visits = (
            *(leg.dep_row for leg in legs),
            result.tree.node(node)["row"],
        )
        assert visits in prefixes
        reached = max(reached, len(legs))
    assert reached == result.tour.n_asteroids - 1 > 0


def test_under_a_time_limit_passes_begin_with_scouts_in_little_time_all_but_the_first(problem):
    settings = small_settings(pruner="default:0.99", scouts={"width": 10}, tof_days_max=240.0)
    result = search(problem, settings=settings, rng=np.random.default_rng(2), time_limit_s=6.0)
    assert result.stopped == "time limit"
    firsts = {}
    for record in result.counters:
        firsts.setdefault(record.pass_number, record.rank)
    assert [firsts[1], firsts[2]] == [1, 0]
    assert result.tour.n_asteroids > 2
    assert verify_tour(result.tour).passed
    settings = settings.with_(scouts={"share": 0.0})
    result = search(problem, settings=settings, rng=np.random.default_rng(2), time_limit_s=2.0)
    assert all(record.rank > 0 for record in result.counters)


def test_scouts_in_other_processes_find_the_same(problem):
    def generation(executor):
        scouts = Scouts(problem, Toy(), small_settings(), executor)
        counters = RankCounters(pass_number=1, rank=0)
        settings = small_settings(scouts={"width": 8})
        pool, rng = Pool.empty(), np.random.default_rng(5)
        for _ in range(2):
            pool = scouts.generation(pool, settings, 2, rng, counters)
        return pool, counters

    here = generation(None)
    with ProcessPoolExecutor(2) as executor:
        there = generation(executor)
    assert len(here[0]) > 0
    np.testing.assert_array_equal(here[0].nodes.visited, there[0].nodes.visited)
    np.testing.assert_array_equal(here[0].nodes.mass, there[0].nodes.mass)
    assert here[1] == there[1]


def test_a_predictor_that_cannot_be_sent_works_here(problem):
    class Local(Toy):
        pass

    with ProcessPoolExecutor(1) as executor:
        scouts = Scouts(problem, Local(), small_settings(), executor)
        counters = RankCounters(pass_number=1, rank=0)
        settings = small_settings(scouts={"width": 5})
        pool = scouts.generation(Pool.empty(), settings, 1, np.random.default_rng(0), counters)
    assert counters.nodes > 0
    assert len(pool) > 0


tours = st.lists(
    st.lists(st.integers(0, 6), min_size=2, max_size=6, unique=True), min_size=1, max_size=8
)


@given(tours)
def test_a_guide_allows_the_hops_of_its_itineraries_and_no_other(visits):
    guide = ItineraryGuide(_ends(*visits))
    hops = {(tuple(v[: k + 1]), v[k + 1]) for v in visits for k in range(len(v) - 1)}
    nodes = _ends(*(prefix for prefix, _ in hops))
    parent, target = (a.ravel() for a in np.meshgrid(np.arange(len(nodes)), np.arange(8)))
    allowed = guide.allows(nodes, parent, target)
    prefixes = _visits(nodes)
    for p, t, answer in zip(parent.tolist(), target.tolist(), allowed.tolist(), strict=True):
        assert answer == ((prefixes[p], t) in hops)


@given(tours, st.integers(0, 2**32 - 1))
def test_a_pool_holds_each_set_of_bodies_once_at_its_best(visits, seed):
    rng = np.random.default_rng(seed)
    problem = _Clock()
    ends = _ends(*visits, elapsed_days=rng.uniform(100, 700, len(visits)))
    half = rng.integers(0, len(visits) + 1)
    pool = Pool.empty()
    for rows in (np.arange(half), np.arange(half, len(visits))):
        pool = pool.merged([(ends.take(rows), 1)], RANKING, problem)
    best = {}
    for bodies, score in zip(map(frozenset, visits), RANKING.score(ends, problem), strict=True):
        best[bodies] = min(score, best.get(bodies, np.inf))
    held = [frozenset(v) for v in _visits(pool.nodes)]
    assert sorted(held, key=sorted) == sorted(best, key=sorted)
    np.testing.assert_allclose(
        RANKING.score(pool.nodes, problem), [best[bodies] for bodies in held]
    )


@dataclass(frozen=True)
class _Clock:
    """As much of a problem as a ranking needs."""

    max_duration_days: float = 730.0
    m0: float = 2000.0

    @property
    def spacecraft(self):
        return small_problem().spacecraft


def test_what_was_flown_is_not_flown_again():
    problem = _Clock()
    ends = _ends([1, 2, 3], [4, 5, 6], [7, 8, 9], elapsed_days=[300.0, 200.0, 400.0])
    pool = Pool.empty().merged([(ends, 0)], RANKING, problem)
    pool, first = pool.unflown(2)
    assert _visits(first) == [(4, 5, 6), (1, 2, 3)]
    # The same bodies found again, at better epochs.
    pool = pool.merged([(_ends([5, 4, 6], elapsed_days=150.0), 0)], RANKING, problem)
    pool, second = pool.unflown(2)
    assert _visits(second) == [(7, 8, 9)]
    assert len(pool.unflown(2)[1]) == 0


def test_niches_are_looked_at_in_turn():
    problem = _Clock()
    # Two niches; in the first, two itineraries with the same middle.
    ends = _ends(
        [1, 2, 3, 4, 5], [1, 2, 3, 4, 6], [7, 8, 9, 10, 11], elapsed_days=[200.0, 201.0, 205.0]
    )
    pool = Pool.empty().merged([(ends, 0)], RANKING, problem)
    assert len(np.unique(pool.niches())) == 2
    pool, rows = pool.choose(4, RANKING, problem)
    picked = [_visits(pool.nodes)[row] for row in rows]
    assert picked[0] == (1, 2, 3, 4, 5)
    assert (7, 8, 9, 10, 11) in picked
    assert (1, 2, 3, 4, 6) not in picked
    assert pool.times_picked.sum() == 4


def test_a_longer_itinerary_is_worth_more_than_a_cheap_short_one():
    ends = _ends([1, 2, 3, 4], [5, 6, 7], [8, 9, 10], elapsed_days=[600.0, 390.0, 500.0])
    pool = Pool.empty().merged([(ends, 0)], RANKING, _Clock(m0=1500.0))
    # 600 days for three legs are 200 a leg: two legs in 390 are better, in 500 are worse.
    assert _visits(pool.nodes) == [(5, 6, 7), (1, 2, 3, 4), (8, 9, 10)]


def test_starts_lie_near_the_itinerary_within_the_window(problem, neighbours):
    first, last = problem.first_departure_mjd2000
    end = replace(_ends([10, 20, 30, 40, 50]), t_first_mjd2000=np.array([first + 20.0]))
    rows, epochs = starts_near(problem, neighbours, end, 200, np.random.default_rng(1))
    assert (epochs >= first).all()
    assert (epochs <= last).all()
    assert np.abs(epochs - first - 20.0).max() <= 250.0
    known = np.array([10, 20, 30, 40])
    for row, epoch in zip(rows[:40], epochs[:40], strict=True):
        near = neighbours.query(known, np.full(4, epoch), 16)
        assert row in known or row in near
    only = replace(problem, start_ids=(int(problem.catalogue.ids[10]),))
    rows, _ = starts_near(only, neighbours, end, 50, np.random.default_rng(1))
    assert (rows == 10).all()


def test_parts_of_the_window_cover_it(problem):
    parts = [window_part(problem, k, 7) for k in range(7)]
    assert parts[0][0] == problem.first_departure_mjd2000[0]
    assert parts[-1][1] == pytest.approx(problem.first_departure_mjd2000[1])
    for before, after in itertools.pairwise(parts):
        assert before[1] == pytest.approx(after[0])


def test_starts_of_itineraries_are_named_once():
    ends = _ends([3, 2, 1], [3, 4, 5], [1, 2, 3])
    rows, epochs = starts_of(ends)
    assert rows.tolist() == [1, 3]
    assert epochs.tolist() == [8000.0, 8000.0]
