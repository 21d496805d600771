"""Beams over a chart: tours from one orbit to another that keep the limits."""

import numpy as np
import pytest

from feasibility import Legs
from seqsearch.carriers.homing import Homing, HomingSettings
from seqsearch.chart.choice_kernels import choose
from seqsearch.core.nodes import Nodes
from tests.helpers.charts import DURATION_DAYS, M0, T0, charted

STAY_DAYS = 30.0
SETTINGS = HomingSettings(width=200, results=3)


@pytest.fixture(scope="module")
def world():
    return charted()


@pytest.fixture(scope="module")
def homing(world):
    return Homing(world.chart, world.maker, world.problem, 0.005)


@pytest.fixture(scope="module")
def ends(world):
    """Return two bodies with many neighbours."""
    order = np.argsort(-np.bincount(world.chart.target, minlength=len(world.chart.rows)))
    return int(order[0]), int(order[5])


def starts_at(row, count=8):
    epochs = T0 + np.linspace(0.0, 200.0, count)
    return Nodes.at_start(np.full(count, row), epochs, np.full(count, M0))


@pytest.fixture(scope="module")
def tours(homing, ends):
    found = homing.run(starts_at(ends[0]), ends[1], np.zeros(0, dtype=np.intp), SETTINGS)
    assert len(found) > 5
    return found


def test_tours_lead_from_the_start_to_the_end_in_time(tours, ends):
    for tour in tours:
        itinerary = tour.itinerary
        assert (itinerary.rows[0], itinerary.rows[-1]) == ends
        assert tour.visits == len(itinerary.rows) - 2
        assert len(set(itinerary.rows.tolist())) == len(itinerary.rows)
        assert tour.duration_days <= DURATION_DAYS
        assert itinerary.duration_days == pytest.approx(tour.duration_days)
        stays = itinerary.t_dep_mjd2000[1:] - itinerary.t_arr_mjd2000[:-1]
        np.testing.assert_allclose(stays, STAY_DAYS, atol=1e-9)


def test_those_with_most_visits_come_first_and_no_tour_comes_twice(tours):
    order = [(-tour.visits, tour.duration_days) for tour in tours]
    assert order == sorted(order)
    kinds = [(frozenset(t.itinerary.rows.tolist()), int(t.itinerary.rows[-2])) for t in tours]
    assert len(set(kinds)) == len(kinds)


def test_the_classifier_believes_in_the_legs(tours, world):
    catalogue, craft = world.problem.catalogue, world.problem.spacecraft
    margins = []
    for tour in tours[:4]:
        itinerary, mass = tour.itinerary, M0
        for k in range(len(itinerary)):
            legs = Legs(
                rv_dep=catalogue.states_at(itinerary.rows[[k]], itinerary.t_dep_mjd2000[[k]]),
                rv_arr=catalogue.states_at(itinerary.rows[[k + 1]], itinerary.t_arr_mjd2000[[k]]),
                tof_days=itinerary.tof_days[[k]],
                m0=mass,
                thrust=craft.thrust,
                isp=craft.isp,
                m_dry=craft.m_dry,
            )
            margins.append(float(world.predictor.margin(legs)[0]))
            mass = float(world.predictor.final_mass(legs)[0])
    assert np.median(margins) > 1.0
    assert min(margins) > 0.85


def test_avoided_bodies_are_not_visited(homing, ends, tours):
    avoid = np.unique(tours[0].itinerary.rows[1:-1])
    others = homing.run(starts_at(ends[0]), ends[1], avoid, SETTINGS)
    assert others
    for tour in others:
        assert not np.isin(tour.itinerary.rows, avoid).any()


def test_a_wider_beam_is_hardly_worse(homing, ends, tours):
    none = np.zeros(0, dtype=np.intp)
    narrow = homing.run(starts_at(ends[0]), ends[1], none, HomingSettings(width=30))
    best = [max(tour.value(DURATION_DAYS) for tour in found) for found in (narrow, tours)]
    assert best[1] >= best[0]


def test_a_tour_is_gone_on_with_from_some_visit_on(homing, ends, tours):
    """What begins in the middle of a tour gets to its end at least as soon, if it is as wide."""
    tour = tours[0]
    kept = tour.visits - 2
    head = tour.itinerary.part(0, kept)
    mass = np.array([1200.0])
    node = Nodes(
        row=head.rows[-1:],
        depth=np.array([kept]),
        t_ready_mjd2000=tour.itinerary.t_dep_mjd2000[kept : kept + 1],
        t_arr_mjd2000=head.t_arr_mjd2000[-1:],
        t_first_mjd2000=head.t_dep_mjd2000[:1],
        mass=mass,
        visited=head.rows[None, :],
        tree_id=np.array([-1]),
        parent_id=np.array([-1]),
    )
    tails = homing.run(node, ends[1], np.zeros(0, dtype=np.intp), SETTINGS)
    assert tails
    for tail in tails:
        assert tail.visits == kept + len(tail.itinerary.rows) - 2
        assert tail.itinerary.rows[0] == head.rows[-1]
        assert not np.isin(tail.itinerary.rows[1:], head.rows).any()
        end = float(tail.itinerary.t_arr_mjd2000[-1])
        assert tail.duration_days == pytest.approx(end - float(head.t_dep_mjd2000[0]))


def test_the_same_question_has_the_same_answer(homing, ends, tours):
    again = homing.run(starts_at(ends[0]), ends[1], np.zeros(0, dtype=np.intp), SETTINGS)
    for one, other in zip(tours, again, strict=True):
        np.testing.assert_array_equal(one.itinerary.rows, other.itinerary.rows)
        np.testing.assert_array_equal(one.itinerary.tof_days, other.itinerary.tof_days)


def test_orbits_that_are_not_on_the_chart_have_no_tours(homing, ends, world):
    outside = len(world.problem.catalogue) + 5
    assert homing.run(starts_at(ends[0]), outside, np.zeros(0, dtype=np.intp), SETTINGS) == []


def test_caps_hold_and_the_best_go_on():
    rng = np.random.default_rng(4)
    count, parents, bodies = 400, 20, 30
    row = rng.integers(0, bodies, count).astype(np.int32)
    parent = rng.integers(0, parents, count).astype(np.int32)
    arrival = rng.uniform(100.0, 160.0, count)
    score = rng.uniform(0.0, 1.0, count)
    sets = rng.integers(1, 2**63, parents, dtype=np.int64).astype(np.uint64)
    keys = rng.integers(1, 2**63, bodies, dtype=np.int64).astype(np.uint64)
    start = (np.arange(parents) % 4).astype(np.int32)
    caps = np.array([60, 5, 2, 20])
    taken = np.empty(60, dtype=np.int64)
    order = np.argsort(score, kind="stable")
    mass = np.full(count, 1000.0)
    kept = choose(
        *(order, row, parent, arrival, sets, keys, start, caps, bodies, 20.0, mass, 1e9, taken)
    )

    expected: list[int] = []
    for c in order:
        same = [d for d in expected if parent[d] == parent[c]]
        cell = [d for d in expected if row[d] == row[c] and arrival[d] // 20 == arrival[c] // 20]
        begun = [d for d in expected if start[parent[d]] == start[parent[c]]]
        twice = [d for d in cell if sets[parent[d]] == sets[parent[c]]]
        if len(same) < 5 and len(cell) < 2 and len(begun) < 20 and not twice:
            expected.append(int(c))
        if len(expected) == 60:
            break
    assert taken[:kept].tolist() == expected
