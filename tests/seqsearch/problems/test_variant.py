"""Variants of a tour of rendezvous: what a child does not override is the base's."""

import pickle

import numpy as np

from seqsearch import Problem, SearchSettings
from seqsearch.problems.variant import RendezvousVariant
from tests.helpers.problems import small_problem

ATTRIBUTES = (
    "name",
    "catalogue",
    "spacecraft",
    "m0",
    "first_departure_mjd2000",
    "max_duration_days",
    "min_stay_days",
    "start_ids",
    "custom_moves",
)


class Same(RendezvousVariant):
    """Overrides nothing."""


def test_a_variant_that_overrides_nothing_answers_as_its_base():
    base = small_problem(start_ids=(5, 9))
    same = Same(base=base)
    assert isinstance(same, Problem)
    for name in ATTRIBUTES:
        assert getattr(same, name) is getattr(base, name) or getattr(same, name) == getattr(
            base, name
        )
    assert np.array_equal(same.start_rows(), base.start_rows())
    rows, epochs = same.start_rows(), np.array([7700.0, 7800.0])
    nodes = same.start_nodes(rows, epochs)
    assert np.array_equal(nodes.mass, base.start_nodes(rows, epochs).mass)
    target = np.array([[1, int(rows[0])], [2, 3]])
    assert np.array_equal(same.may_visit(nodes, target), [[True, False], [True, True]])
    departure = epochs[:, None]
    assert np.array_equal(same.days_left(nodes, departure), base.days_left(nodes, departure))
    hops = (nodes, np.array([0, 1]), np.array([1, 2]), epochs, np.array([200.0, 300.0]))
    assert np.array_equal(same.hops(*hops).legs[0].rv_arr, base.hops(*hops).legs[0].rv_arr)
    assert same.closing(1, 8000.0, 1500.0) == ()
    settings = SearchSettings()
    assert np.array_equal(same.tour_cost(nodes, settings), base.tour_cost(nodes, settings))
    assert same.tour_rules() == base.tour_rules()


def test_a_variant_can_travel_to_worker_processes():
    same = pickle.loads(pickle.dumps(Same(base=small_problem())))
    assert same.m0 == 2000.0


def test_a_variant_has_every_member_of_a_problem():
    members = [name for name in dir(Problem) if not name.startswith("_")]
    assert all(name in vars(RendezvousVariant) for name in members)
