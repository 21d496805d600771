"""Finding flight times and starts with a predictor: against brute force on a toy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from feasibility import AllOf, KeepAll, Legs
from feasibility.classifier.predictor import (
    QuickPredictor,
    bounded_final_mass,
    lambert_final_mass,
)
from feasibility.orbits import OrbitalNeighbours
from seqsearch import search
from seqsearch.beam.forecast import Forecast, PairCurves
from seqsearch.beam.starts import reachable_starts
from seqsearch.core.margin_curves import MarginCurves, flight_times
from tests.helpers.predictors import Toy
from tests.helpers.problems import small_problem, small_settings


@pytest.fixture(scope="module")
def problem():
    return small_problem()


@pytest.fixture(scope="module")
def neighbours(problem):
    return OrbitalNeighbours(problem.catalogue)


def _nodes(problem, n=3):
    rows = np.arange(5, 5 + n)
    return problem.start_nodes(rows, np.full(n, problem.first_departure_mjd2000[0]))


@given(
    st.lists(st.floats(-0.6, 0.3), min_size=1, max_size=5),
    st.floats(0.5, 2.0),
    st.floats(0.0, 0.1),
)
def test_the_shortest_flyable_time_is_where_the_curve_crosses(offsets, slope, level):
    offset = np.asarray(offsets)
    first, last = np.full(len(offset), 40.0), np.full(len(offset), 240.0)
    times = flight_times(first, last, 9)

    def truth(tof):
        return offset[:, None] + slope * np.log(tof / 150.0) + 0.05 * np.sin(tof / 40.0)

    curves = MarginCurves.through(first, last, truth(times))
    shortest = curves.shortest(level)
    fine = np.geomspace(40.0, 240.0, 4001)
    margins = truth(np.broadcast_to(fine, (len(offset), len(fine))))
    for i in range(len(offset)):
        flyable = margins[i] >= level
        if not flyable.any():
            assert np.isnan(shortest[i])
            continue
        if np.isnan(shortest[i]):
            assert margins[i, -1] < level + 0.01
            continue
        found = np.interp(shortest[i], fine, margins[i])
        assert abs(found - level) < 0.01 or (shortest[i] <= 40.0 + 1e-9 and found >= level)
        assert not (margins[i, fine < shortest[i] - 1.0] > level + 0.02).any()


def test_one_good_answer_corrects_a_whole_curve():
    first, last = np.full(3, 60.0), np.full(3, 240.0)
    times = flight_times(first, last, 9)
    truth = np.array([0.1, 0.0, -0.1])[:, None] + np.log(times / 150.0)
    wrong = truth + np.array([0.03, -0.02, 0.05])[:, None]
    asked = np.array([140.0, 150.0, 160.0])
    answers = np.array([0.1, 0.0, -0.1]) + np.log(asked / 150.0)
    curves = MarginCurves.through(first, last, wrong).corrected(asked, answers)
    expected = 150.0 * np.exp(-np.array([0.1, 0.0, -0.1]))
    assert np.allclose(curves.shortest(0.0), expected, rtol=1e-3)
    assert np.allclose(curves.take(np.array([2])).shortest(0.0), expected[2], rtol=1e-3)
    silent = MarginCurves.through(first, last, truth).corrected(asked, np.full(3, np.nan))
    assert np.allclose(silent.shortest(0.0), expected, rtol=1e-3)


def test_proposed_times_are_the_shortest_that_can_be_flown(problem, neighbours):
    assert isinstance(Toy(), QuickPredictor)
    predictor = Toy(bias=0.04)
    forecast = Forecast(problem, predictor, neighbours)
    settings = small_settings(neighbours=20, flight_time_stretches=(1.0, 1.2))
    nodes = _nodes(problem)
    pairs = PairCurves.concatenate([s.pairs for s in forecast.surveys(nodes, settings)])
    sharp = forecast.sharpened(nodes, pairs, settings)
    candidates, _, pair = forecast.outlook(nodes, sharp, settings)
    shortest = np.flatnonzero(np.diff(np.concatenate([[-1], pair])) != 0)
    assert 5 < len(shortest) < 60
    fine = np.arange(settings.tof_days_min, settings.tof_days_max, 0.25)
    flyable_targets = 0
    for parent in range(len(nodes)):
        near = neighbours.query(nodes.row[[parent]], nodes.t_ready_mjd2000[[parent]], 20)[0]
        for target in near:
            n = len(fine)
            hops = problem.hops(
                nodes,
                np.full(n, parent),
                np.full(n, target),
                np.full(n, nodes.t_ready_mjd2000[parent]),
                fine,
            )
            margin = predictor.margin(hops.legs[0])
            enough = margin >= 1.0 + settings.margin_reserve
            rows = [
                i
                for i in shortest
                if candidates.parent[i] == parent and candidates.target[i] == target
            ]
            if not enough.any():
                assert not rows or margin.max() > 0.99
                continue
            flyable_targets += 1
            if not rows:
                assert margin[-1] < 1.01
                continue
            assert abs(candidates.hops.tof_days[rows[0]] - fine[enough.argmax()]) < 1.5
    assert flyable_targets >= len(shortest) - 1


def test_answers_do_not_depend_on_threads(problem, neighbours):
    settings = small_settings()
    nodes = _nodes(problem, 8)
    found = []
    for threads in (1, 3):
        forecast = Forecast(problem, Toy(), neighbours, threads)
        pairs = PairCurves.concatenate([s.pairs for s in forecast.surveys(nodes, settings)])
        found.append(forecast.outlook(nodes, pairs, settings))
    assert np.array_equal(found[0][1], found[1][1])
    assert np.array_equal(found[0][0].hops.tof_days, found[1][0].hops.tof_days)


def test_targets_of_which_nothing_is_known_are_proposed_on_the_grid(problem):
    class Ignorant:
        def margin(self, legs, /):
            return np.full(len(legs), np.nan)

        def final_mass(self, legs, /):
            return lambert_final_mass(legs)

    settings = small_settings(neighbours=3, starts=3, solves_per_rank=40)
    result = search(
        problem, pruner=AllOf(KeepAll()), predictor=Ignorant(), beam_width=2, settings=settings
    )
    first = result.counters[0]
    assert first.unknown == first.nodes * 3 * len(settings.tof_days())
    assert first.optimised == 40


def test_starts_are_those_from_which_most_can_be_reached(problem, neighbours):
    settings = small_settings(starts=4, start_epochs=2, screen_legs=10**6)
    rng = np.random.default_rng(3)
    rows, epochs = reachable_starts(problem, neighbours, Toy(), settings, rng)
    again, _ = reachable_starts(
        problem, neighbours, Toy(), settings, np.random.default_rng(3), threads=2
    )
    assert np.array_equal(rows, again)
    assert len(set(rows)) == 4

    def count(row, epoch):
        total = 0.0
        node = problem.start_nodes(np.array([row]), np.array([epoch]))
        for target in neighbours.query([row], [epoch], 30)[0]:
            for share in (0.5, 0.75, 1.0):
                tof = np.array([share * settings.reference_tof_days])
                zero = np.zeros(1, dtype=np.intp)
                legs = problem.hops(node, zero, np.array([target]), np.array([epoch]), tof)
                legs = legs.legs[0].with_m0(1400.0)
                total += np.clip(1.0 + np.log(Toy().margin(legs)[0]) / 0.3, 0.0, 1.0)
        return total

    chosen = [count(row, epoch) for row, epoch in zip(rows, epochs, strict=True)]
    assert np.all(np.diff(chosen) <= 1e-9)
    others = np.random.default_rng(0).integers(0, len(problem.catalogue), 40)
    rest = [count(row, epoch) for row in others for epoch in np.unique(epochs)]
    assert np.min(chosen) >= np.max(rest) - 1e-9 or set(rows) & set(others)


def test_final_masses_lie_between_impulses_and_full_thrust():
    legs = Legs(
        [4e11, 0, 0, 0, 1.8e4, 0],
        [0, 4.1e11, 0, -1.8e4, 0, 0],
        400.0,
        m0=[1000.0, 1500.0, 1500.0],
        thrust=0.3,
        isp=3000.0,
        m_dry=500.0,
    )
    masses = bounded_final_mass(legs, np.array([1.0, 1.0, 3.0]))
    burnt = legs.thrust * legs.tof_s / legs.exhaust_velocity
    assert np.all(masses >= legs.m0 - burnt - 1e-9)
    assert masses[2] > masses[1]
