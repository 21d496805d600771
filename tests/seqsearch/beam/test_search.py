"""The beam search: deterministic, bounded in time, honest in its counters."""

import threading
import time
from concurrent.futures import ThreadPoolExecutor

import networkx as nx
import numpy as np
import pytest

from feasibility import AllOf, InputError, KeepAll, Mima2Pruner
from feasibility.runtime.workers import worker_pool
from seqsearch import search, verify_tour
from tests.helpers.problems import small_problem, small_settings


@pytest.fixture(scope="module")
def problem():
    return small_problem()


@pytest.fixture(scope="module")
def result(problem):
    return search(problem, settings=small_settings(), rng=np.random.default_rng(4))


def test_it_finds_a_tour(result, problem):
    assert result.stopped == "complete"
    assert result.tour.n_asteroids >= 3
    assert result.tour.duration_days <= problem.max_duration_days
    assert all(leg.margin >= 1 for leg in result.tour.legs)


def test_counters_add_up(result):
    for record in result.counters:
        survivors = record.proposed - sum(record.pruned.values())
        assert 0 <= record.kept <= record.feasible <= record.optimised <= survivors
        assert record.optimised <= small_settings().solves_per_rank
    assert [record.rank for record in result.counters] == list(range(1, len(result.counters) + 1))


def test_the_tree_is_a_forest_whose_paths_are_the_tours(result, problem):
    graph = result.tree.graph
    assert isinstance(graph, nx.DiGraph)
    assert nx.is_branching(graph)
    deepest = max(nx.get_node_attributes(graph, "rank").values())
    assert deepest == len(result.tour.legs)
    for parent, child, (leg,) in graph.edges(data="legs"):
        assert graph.nodes[parent]["row"] == leg.dep_row
        assert graph.nodes[child]["row"] == leg.arr_row
        assert graph.nodes[child]["mass"] == leg.m_final <= leg.m0


def test_the_same_seed_gives_the_same_tour_in_parallel(result, problem):
    with worker_pool(2) as pool:
        parallel = search(
            problem, settings=small_settings(), rng=np.random.default_rng(4), executor=pool
        )
    assert parallel.tour == result.tour
    assert len(parallel.tree) == len(result.tree)


def test_a_search_can_have_workers_of_its_own(result, problem):
    own = search(problem, settings=small_settings(), rng=np.random.default_rng(4), workers=2)
    assert own.tour == result.tour


def test_workers_and_an_executor_are_one_too_many(problem):
    with ThreadPoolExecutor(1) as pool, pytest.raises(InputError, match="one of them"):
        search(problem, workers=1, executor=pool)
    with pytest.raises(InputError, match="workers = 0, expected one or more"):
        search(problem, workers=0)


def test_the_order_in_which_workers_finish_does_not_matter(result, problem):
    with ThreadPoolExecutor(3) as pool:
        threaded = search(
            problem, settings=small_settings(), rng=np.random.default_rng(4), executor=pool
        )
    assert threaded.tour == result.tour


def test_a_time_limit_stops_with_the_best_so_far(problem):
    begin = time.monotonic()
    limited = search(problem, settings=small_settings(), time_limit_s=0.5)
    assert time.monotonic() - begin < 10.0
    assert limited.stopped == "time limit"
    assert limited.tour.n_asteroids >= 1


def test_an_interrupt_stops_with_the_best_so_far(problem):
    def interrupt(state):
        if state.counters[-1].rank == 2:
            raise KeyboardInterrupt

    stopped = search(problem, settings=small_settings(), on_rank=interrupt)
    assert stopped.stopped == "interrupted"
    assert stopped.tour.n_asteroids == 3


def test_passes_look_at_other_starts(problem):
    settings = small_settings(passes=2, beam_width=2, starts=3)
    two = search(problem, settings=settings, rng=np.random.default_rng(1))
    assert {record.pass_number for record in two.counters} == {1, 2}
    starts = [row for row, rank in two.tree.graph.nodes(data="rank") if rank == 0]
    assert len(starts) == 6


def test_a_pruner_that_drops_everything_leaves_the_start(problem):
    class DropAll:
        def keep(self, legs, /):
            return np.zeros(len(legs), dtype=bool)

    nothing = search(problem, pruner=DropAll(), settings=small_settings())
    assert nothing.tour.n_asteroids == 1
    assert nothing.counters[0].optimised == 0
    assert nothing.counters[0].pruned == {"DropAll": nothing.counters[0].proposed}


def test_each_pruner_is_counted(problem):
    pruner = AllOf(KeepAll(), Mima2Pruner(1.0))
    settings = small_settings(solves_per_rank=20)
    counted = search(problem, pruner=pruner, beam_width=2, settings=settings)
    kept_all, mima2 = counted.counters[0].pruned.values()
    assert kept_all == 0
    assert mima2 > 0
    assert counted.counters[0].kept <= 2


def test_searches_run_side_by_side_in_threads(problem, result):
    found = []
    threads = [
        threading.Thread(
            target=lambda: found.append(
                search(problem, settings=small_settings(), rng=np.random.default_rng(4)).tour
            )
        )
        for _ in range(2)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == [result.tour, result.tour]


@pytest.fixture(scope="module")
def predicted(problem):
    settings = small_settings(pruner="default:0.99")
    return search(problem, settings=settings, rng=np.random.default_rng(4))


def test_with_a_classifier_most_of_what_is_optimised_can_be_flown(predicted, problem):
    assert predicted.tour.n_asteroids >= 3
    assert verify_tour(predicted.tour).passed
    optimised = sum(record.optimised for record in predicted.counters)
    feasible = sum(record.feasible for record in predicted.counters)
    proposed = sum(record.proposed for record in predicted.counters)
    assert feasible >= 0.8 * optimised
    assert 20 * optimised <= proposed


def test_with_a_classifier_workers_and_threads_do_not_change_the_tour(predicted, problem):
    with worker_pool(2) as pool:
        parallel = search(
            problem,
            settings=small_settings(pruner="default:0.99"),
            rng=np.random.default_rng(4),
            executor=pool,
            threads=3,
        )
    assert parallel.tour == predicted.tour
    assert [record.questions for record in parallel.counters] == [
        record.questions for record in predicted.counters
    ]
