"""Expansion and starts: what is proposed, and what must not be."""

import numpy as np
import pytest

from feasibility import AllOf, ClassifierPruner, FeasibilityClassifier, Legs
from feasibility.orbits import OrbitalNeighbours, orbital_metric
from seqsearch.beam.starts import dense_starts
from seqsearch.core.candidates import grid_candidates, reached
from seqsearch.core.hops import Hops
from seqsearch.core.nodes import Nodes
from seqsearch.pruning.hop_pruning import keep_hops
from tests.helpers.labelled import labelled_dataset
from tests.helpers.problems import small_problem, small_settings


def _nodes(problem, visited, t_ready, t_first):
    visited = np.asarray(visited, dtype=np.intp)
    n = len(visited)
    t_ready = np.asarray(t_ready, dtype=float)
    return Nodes(
        row=visited[:, -1],
        depth=np.full(n, visited.shape[1] - 1),
        t_ready_mjd2000=t_ready,
        t_arr_mjd2000=t_ready - (problem.min_stay_days if visited.shape[1] > 1 else 0.0),
        t_first_mjd2000=np.asarray(t_first, dtype=float),
        mass=np.linspace(2000.0, 1500.0, n),
        visited=visited,
        tree_id=np.arange(n),
        parent_id=np.full(n, -1),
    )


@pytest.fixture(scope="module")
def problem():
    return small_problem()


@pytest.fixture(scope="module")
def neighbours(problem):
    return OrbitalNeighbours(problem.catalogue)


def test_candidates_are_neighbours_times_delays_times_flight_times(problem, neighbours):
    t0 = problem.first_departure_mjd2000[0]
    nodes = _nodes(problem, [[5], [9]], [t0, t0 + 50], [t0, t0 + 50])
    settings = small_settings(departure_delays_days=(0.0, 20.0))
    blocks = list(grid_candidates(problem, nodes, neighbours, settings))
    assert sum(map(len, blocks)) == 2 * settings.neighbours * 2 * len(settings.tof_days())
    for block in blocks:
        (legs,) = block.hops.legs
        delay = legs.t_dep_mjd2000 - nodes.t_ready_mjd2000[block.parent]
        assert set(delay) == {0.0, 20.0}
        assert np.array_equal(legs.m0, nodes.mass[block.parent])
        assert np.array_equal(legs.arr_id, problem.catalogue.ids[block.target])
        states = problem.catalogue.states_at(block.target, legs.t_dep_mjd2000 + legs.tof_days)
        assert np.array_equal(legs.rv_arr, states)
        for parent in (0, 1):
            near = neighbours.query([nodes.row[parent]], [nodes.t_ready_mjd2000[parent]], 25)
            assert set(block.target[block.parent == parent]) <= set(near[0])


def test_visited_bodies_are_not_proposed_again(problem, neighbours):
    t = problem.first_departure_mjd2000[0]
    near = neighbours.query([5], [t], 3)[0]
    nodes = _nodes(problem, [[near[0], near[1], 5]], [t], [t - 200.0])
    (block,) = grid_candidates(problem, nodes, neighbours, small_settings())
    assert not set(near[:2]) & set(block.target)
    assert 5 not in block.target
    assert near[2] in block.target


def test_no_arrival_beyond_the_duration_and_no_late_first_departure(problem, neighbours):
    earliest, latest = problem.first_departure_mjd2000
    nodes = _nodes(problem, [[7, 5]], [earliest + 600.0], [earliest])
    (block,) = grid_candidates(problem, nodes, neighbours, small_settings())
    arrival = block.hops.t_arr_mjd2000
    assert (arrival - earliest).max() <= problem.max_duration_days
    late = _nodes(problem, [[5]], [latest], [latest])
    (block,) = grid_candidates(
        problem, late, neighbours, small_settings(departure_delays_days=(0.0, 9.0))
    )
    assert block.hops.t_dep_mjd2000.max() <= latest


def test_nothing_is_proposed_when_time_is_up(problem, neighbours):
    earliest = problem.first_departure_mjd2000[0]
    nodes = _nodes(problem, [[7, 5]], [earliest + 720.0], [earliest])
    assert list(grid_candidates(problem, nodes, neighbours, small_settings())) == []


def test_reached_nodes_carry_the_clock_of_the_tour(problem, neighbours):
    t = problem.first_departure_mjd2000[0]
    nodes = _nodes(problem, [[5]], [t], [t])
    settings = small_settings(departure_delays_days=(10.0,))
    (block,) = grid_candidates(problem, nodes, neighbours, settings)
    child = reached(problem, nodes, block, block.hops.legs[0].m0 - 50.0)
    assert np.all(child.depth == 1)
    assert np.all(child.t_first_mjd2000 == t + 10.0)
    assert np.allclose(child.t_ready_mjd2000 - child.t_arr_mjd2000, problem.min_stay_days)
    assert np.array_equal(child.visited[:, 1], block.target)


def test_starts_are_the_densest_of_their_epochs(problem, neighbours):
    settings = small_settings(starts=10)
    rows, epochs = dense_starts(problem, neighbours, settings, np.random.default_rng(2))
    assert len(rows) == len(set(rows)) == 10
    earliest, latest = problem.first_departure_mjd2000
    assert np.all((epochs >= earliest) & (epochs <= latest))
    for row, epoch in zip(rows, epochs, strict=True):
        bucket = np.rint(epoch / 30.0) * 30.0
        points = orbital_metric(problem.catalogue.states(bucket), 180.0)
        eighth = np.sort(np.linalg.norm(points - points[row], axis=1))[8]
        everyone = np.sort(np.linalg.norm(points[:, None, :200] - points[None], axis=2), axis=1)
        assert eighth <= np.quantile(everyone[:, 8], 0.1)


def test_starts_are_limited_to_the_given_ids():
    ids = small_problem().catalogue.ids[[3, 50]]
    problem = small_problem(start_ids=tuple(int(i) for i in ids))
    rows, _ = dense_starts(
        problem, OrbitalNeighbours(problem.catalogue), small_settings(), np.random.default_rng(0)
    )
    assert set(rows) == {3, 50}


def test_hops_that_a_classifier_keeps_for_not_knowing_them_are_counted_once():
    legs = labelled_dataset(40, seed=2).legs
    # Half of the hops have an engine that no model has seen, in the first of two legs.
    isp = np.where(np.arange(40) < 20, 19_000.0, legs.isp)
    strange = Legs(legs.rv_dep, legs.rv_arr, legs.tof_days, legs.m0, legs.thrust, isp, 0.0)
    hops = Hops((strange, legs), (np.zeros(40), np.zeros(40)))
    pruner = AllOf(ClassifierPruner(FeasibilityClassifier.load("default")))
    kept = keep_hops(pruner, hops)
    assert 0 < kept.mask[:20].sum() < 20
    assert kept.out_of_domain == kept.mask[:20].sum()
    assert kept.pruned == {"classifier": 40 - kept.mask.sum()}
