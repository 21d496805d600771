"""Nodes and hops: visits of nodes of different depth, chains of legs."""

import numpy as np
import pytest

from feasibility import Legs
from seqsearch.core.hops import Hops
from seqsearch.core.nodes import Nodes
from seqsearch.core.optimisation import solve_hops
from seqsearch.core.problem import Problem
from tests.helpers.problems import small_problem


@pytest.fixture(scope="module")
def problem():
    return small_problem()


def _child(nodes, parent, target):
    parent, target = np.asarray(parent), np.asarray(target)
    return Nodes(
        row=target,
        depth=nodes.depth[parent] + 1,
        t_ready_mjd2000=nodes.t_ready_mjd2000[parent] + 100.0,
        t_arr_mjd2000=nodes.t_ready_mjd2000[parent] + 70.0,
        t_first_mjd2000=nodes.t_first_mjd2000[parent],
        mass=nodes.mass[parent] - 100.0,
        visited=nodes.extended_visits(parent, target),
        tree_id=np.full(len(parent), -1),
        parent_id=nodes.tree_id[parent],
    )


def test_visits_of_different_depth_live_together():
    starts = Nodes.at_start(np.array([5, 6]), np.zeros(2), np.full(2, 2000.0))
    first = _child(starts, [0, 1], [7, 8])
    second = _child(first, [1], [9])
    together = Nodes.concatenate([starts, second, first])
    assert together.visited.tolist() == [
        [5, -1, -1],
        [6, -1, -1],
        [6, 8, 9],
        [5, 7, -1],
        [6, 8, -1],
    ]
    assert together.depth.tolist() == [0, 0, 2, 1, 1]
    mixed = together.extended_visits(np.array([2, 0]), np.array([1, 2]))
    assert mixed.tolist() == [[6, 8, 9, 1], [5, 2, -1, -1]]


def test_the_rendezvous_problem_is_a_problem(problem):
    assert isinstance(problem, Problem)


def test_legs_of_a_hop_are_solved_with_the_mass_that_is_left(problem):
    nodes = problem.start_nodes(np.array([5]), np.array([problem.first_departure_mjd2000[0]]))
    parent = np.zeros(1, dtype=np.intp)
    t = nodes.t_ready_mjd2000

    def coast(t_dep):
        rv_dep = problem.catalogue.states_at([5], t_dep)
        rv_arr = problem.catalogue.states_at([5], t_dep + 100.0) + np.eye(6)[3] * 300.0
        return Legs(rv_dep, rv_arr, 100.0, 2000.0, 0.3, 3000.0, 800.0, t_dep_mjd2000=t_dep)

    hops = Hops((coast(t), coast(t + 100.0)), (np.array([40.0]), np.array([1.0])))
    solved = solve_hops(hops, "fast")
    assert solved.flyable[0]
    assert solved.solved_legs.tolist() == [2]
    first, second = solved.solutions
    assert 1900.0 < first.m_final[0] < 2000.0
    assert second.m0[0] == first.m_final[0] - 40.0
    hopeless = Hops((coast(t), coast(t + 100.0)), (np.array([1900.0]), np.array([1.0])))
    assert not solve_hops(hopeless, "fast").flyable[0]
    direct = problem.hops(nodes, parent, np.array([6]), t, np.array([100.0]))
    assert np.array_equal(direct.t_arr_mjd2000, t + 100.0)
