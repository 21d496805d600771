"""`OrbitalNeighbours` against brute force and pykep's knn."""

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from feasibility.constants import MU_SUN
from feasibility.errors import InputError
from feasibility.orbits import Catalogue, OrbitalNeighbours, orbital_metric, synthetic_main_belt
from feasibility.runtime.pykep_guard import load_pykep


@pytest.fixture(scope="module")
def belt():
    return synthetic_main_belt(300, np.random.default_rng(9))


def by_brute_force(catalogue, row, epoch, count, tof_days, bucket_days):
    """The definition: distances to all bodies at the bucket's epoch, sorted."""
    states = catalogue.states(np.rint(epoch / bucket_days) * bucket_days)
    tof_s = tof_days * 86400.0
    distance = np.empty(len(catalogue))
    for other in range(len(catalogue)):
        difference = states[other] - states[row]
        drift = difference[:3] / tof_s
        departure = drift + difference[3:]
        distance[other] = np.sqrt(departure @ departure + drift @ drift)
    distance[row] = np.inf
    return np.argsort(distance, kind="stable")[:count], distance


@settings(max_examples=40, deadline=None)
@given(
    st.integers(1, 299),
    st.floats(10.0, 1000.0),
    st.floats(1.0, 200.0),
    st.lists(st.tuples(st.integers(0, 299), st.floats(-3e3, 1e4)), min_size=1, max_size=6),
)
def test_neighbours_are_those_of_brute_force(belt, count, tof_days, bucket_days, queries):
    rows = np.array([row for row, _ in queries])
    epochs = np.array([epoch for _, epoch in queries])
    found = OrbitalNeighbours(belt, tof_days, bucket_days).query(rows, epochs, count)
    assert found.shape == (len(rows), count)
    for row, epoch, answer in zip(rows, epochs, found, strict=True):
        expected, distance = by_brute_force(belt, row, epoch, count, tof_days, bucket_days)
        # Distances, not rows, so that a tie in the last digit may fall either way.
        np.testing.assert_allclose(distance[answer], distance[expected], rtol=1e-9)
        assert len(set(answer)) == count
        assert row not in answer


def test_neighbours_are_those_of_pykeps_knn(belt):
    pk = load_pykep()
    epoch = 6000.0
    states = belt.states(epoch)
    planets = [
        pk.planet(pk.udpla.keplerian(pk.epoch(epoch), [state[:3], state[3:]], MU_SUN))
        for state in states
    ]
    knn = pk.utils.knn(planets, epoch, metric="orbital", tof=180.0)
    found = OrbitalNeighbours(belt).query([11], [epoch], 10)[0]
    neighbours = knn.find_neighbours(planets[11], query_type="knn", k=11)
    assert_array_equal(found, neighbours[1][1:])


def test_a_query_depends_on_its_own_row_only(belt):
    rng = np.random.default_rng(2)
    rows, epochs = rng.integers(0, 300, 50), rng.uniform(0, 2000, 50)
    neighbours = OrbitalNeighbours(belt)
    together = neighbours.query(rows, epochs, 12)
    alone = [
        OrbitalNeighbours(belt).query([row], [epoch], 12)[0]
        for row, epoch in zip(rows, epochs, strict=True)
    ]
    assert_array_equal(together, alone)
    assert_array_equal(neighbours.query(rows[::-1], epochs[::-1], 12), together[::-1])


def test_bodies_at_the_same_place_do_not_hide_the_others_or_let_a_body_be_its_own_neighbour(belt):
    copies = 20
    rows = np.r_[np.zeros(copies, int), np.arange(1, 30)]
    crowd = Catalogue(
        np.arange(len(rows)),
        ["x"] * len(rows),
        belt.epoch_mjd2000[rows],
        belt.elements[rows],
        "crowd",
    )
    found = OrbitalNeighbours(crowd).query(np.arange(copies), 0.0, 3)
    assert np.all(found < copies)
    assert np.all(found != np.arange(copies)[:, None])
    whole = OrbitalNeighbours(crowd).query([4], 0.0, copies - 1)[0]
    assert_array_equal(whole, np.delete(np.arange(copies), 4))


def test_the_trees_kept_are_limited_and_do_not_travel(belt, monkeypatch):
    monkeypatch.setattr("feasibility.orbits.neighbours._MAX_POINTS", 64 * len(belt))
    neighbours = OrbitalNeighbours(belt, bucket_days=1.0)
    first = neighbours.query([3], 0.0, 5)
    for day in range(200):
        neighbours.query([0], float(day), 1)
    assert len(neighbours._trees) == 64
    assert_array_equal(neighbours.query([3], 0.0, 5), first)
    data = pickle.dumps(neighbours)
    assert len(data) < 1.1 * len(pickle.dumps(belt)) + 1000
    assert_array_equal(pickle.loads(data).query([3], 0.0, 5), first)


def test_the_metric_has_the_weights_of_its_definition():
    state = np.array([[86400.0, 0, 0, 0, 2.0, 0]])
    np.testing.assert_allclose(orbital_metric(state, 1.0), [[1.0, 2.0, 0, 1.0, 0, 0]])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda b: OrbitalNeighbours(b.select([0])), "expected two bodies or more, got 1"),
        (lambda b: OrbitalNeighbours(b, reference_tof_days=0.0), "reference_tof_days"),
        (lambda b: OrbitalNeighbours(b, bucket_days=np.nan), "bucket_days"),
        (lambda b: OrbitalNeighbours(b).query([0], 0.0, 300), "expected 1 to 299"),
        (lambda b: OrbitalNeighbours(b).query([0], 0.0, 0), "expected 1 to 299"),
        (lambda b: OrbitalNeighbours(b).query([300], 0.0, 3), "row 300"),
        (lambda b: OrbitalNeighbours(b).query([0, 1], [0.0, np.inf], 3), "finite"),
        (lambda b: OrbitalNeighbours(b).query([0, 1, 2], [0.0, 1.0], 3), "epochs"),
    ],
)
def test_bad_arguments_are_refused(belt, call, message):
    with pytest.raises(InputError, match=message):
        call(belt)


def test_no_rows_have_no_neighbours(belt):
    assert OrbitalNeighbours(belt).query([], [], 4).shape == (0, 4)


def test_the_densest_are_those_whose_nth_neighbour_is_nearest():
    belt = synthetic_main_belt(6000, np.random.default_rng(5))
    neighbours = OrbitalNeighbours(belt)
    rows = np.random.default_rng(6).permutation(6000)[:5500]
    points = orbital_metric(belt.states(600.0), 180.0)
    near = neighbours.query(rows, 600.0, 8)
    distance = np.linalg.norm(points[near[:, -1]] - points[rows], axis=1)
    for count in (1, 40, 700, 5500, 9000):
        found = neighbours.densest(rows, 600.0, 8, count)
        assert (np.diff(found) > 0).all()
        assert set(np.argsort(distance)[:count]) <= set(found.tolist())
    assert len(neighbours.densest(rows, 600.0, 8, 40)) < 1000


def test_many_queries_at_once_are_answered_as_few_are():
    belt = synthetic_main_belt(6000, np.random.default_rng(5))
    neighbours = OrbitalNeighbours(belt)
    rows = np.random.default_rng(7).permutation(6000)
    few = [neighbours.query(part, 600.0, 5) for part in np.array_split(rows, 3)]
    assert_array_equal(neighbours.query(rows, 600.0, 5), np.concatenate(few))
