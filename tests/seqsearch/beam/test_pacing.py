"""Pacing: beams as wide as the time allows, weights that follow what runs out."""

from dataclasses import replace

import numpy as np
import pytest

from seqsearch import search
from seqsearch.beam.counters import RankCounters
from seqsearch.beam.pacing import ClockPacing, FixedPacing
from seqsearch.beam.rankings.rebalance import rebalanced
from seqsearch.beam.scouting.guide import ItineraryGuide
from seqsearch.core.nodes import Nodes, no_nodes
from seqsearch.deadline import Deadline
from tests.helpers.problems import small_problem, small_settings


@pytest.fixture
def clock(monkeypatch):
    """A clock that stands still until it is told to move."""
    now = [1000.0]
    monkeypatch.setattr("time.monotonic", lambda: now[0])
    return now


def _nodes(problem, depth, elapsed_days, mass):
    start = problem.first_departure_mjd2000[0]
    nodes = problem.start_nodes(np.array([1, 2]), np.full(2, start))
    return replace(
        nodes,
        depth=np.full(2, depth),
        t_arr_mjd2000=np.full(2, start + elapsed_days),
        mass=np.full(2, mass),
    )


def _ends(paths):
    """Return nodes that visited the given catalogue rows in turn."""
    depth = np.array([len(path) - 1 for path in paths])
    rows = np.array([path[0] for path in paths])
    nodes = Nodes.at_start(rows, np.zeros(len(paths)), np.ones(len(paths)))
    visited = np.array([path + [-1] * (4 - len(path)) for path in paths])
    return replace(nodes, depth=depth, visited=visited)


def _counters(n, seconds_per_node):
    return [
        RankCounters(pass_number=1, rank=k + 1, nodes=n, seconds=n * seconds_per_node)
        for k in range(5)
    ]


def test_the_beam_is_as_wide_as_the_time_left_can_pay_for(clock):
    problem = small_problem()
    settings = small_settings()
    pacer = ClockPacing(problem, Deadline(80.0), settings)
    pacer.begin_pass(1, settings, [], scouted=False)
    nodes = _nodes(problem, 2, problem.max_duration_days / 3, 1700.0)
    # 20 s, four more ranks at this pace, 10 ms a node.
    assert pacer.width(nodes, settings, _counters(100, 0.01)) == pytest.approx(500, abs=1)
    clock[0] += 10.0
    assert pacer.width(nodes, settings, _counters(100, 0.01)) == pytest.approx(250, abs=1)
    assert pacer.width(nodes, settings, _counters(100, 1e-5)) == settings.max_beam_width
    assert pacer.width(nodes, settings, _counters(100, 10.0)) == 60


def test_passes_grow_and_the_last_one_takes_what_is_left(clock):
    problem = small_problem()
    settings = small_settings(max_beam_width=10**6)
    pacer = ClockPacing(problem, Deadline(600.0), settings)
    # With one rank to come and half a second a node, widths are twice the seconds.
    nodes = _nodes(problem, 1, problem.max_duration_days / 2, 1700.0)
    seconds = []
    for pass_number in (1, 2, 3):
        pacer.begin_pass(pass_number, settings, [], scouted=False)
        seconds.append(pacer.width(nodes, settings, _counters(10, 0.5)) / 2)
        clock[0] += seconds[-1]
    assert seconds == pytest.approx([40, 120, 440], abs=2)


def test_the_audit_takes_a_tenth_of_the_time(clock):
    pacer = ClockPacing(small_problem(), Deadline(60.0), small_settings())
    records = [RankCounters(pass_number=1, rank=1, nodes=9, seconds=30.0)]
    assert pacer.audits(records)
    records[0].seconds_audit = 2.0
    assert not pacer.audits(records)


def test_what_ran_out_first_weighs_more_in_the_next_pass():
    problem = small_problem()
    settings = small_settings(propellant_weight=0.5)
    no_time = rebalanced(settings, _nodes(problem, 5, problem.max_duration_days, 1100.0), problem)
    assert no_time.propellant_weight < 0.5
    no_mass = rebalanced(
        settings, _nodes(problem, 5, 0.8 * problem.max_duration_days, 800.0), problem
    )
    assert no_mass.propellant_weight > 0.5
    dry = problem.spacecraft.m_dry
    even = _nodes(problem, 5, 0.9 * problem.max_duration_days, dry + 0.1 * (problem.m0 - dry))
    assert rebalanced(settings, even, problem).propellant_weight == pytest.approx(0.5)
    only_time = rebalanced(settings.with_(propellant_weight=0.0), even, problem)
    assert only_time.propellant_weight == 0.0


def test_a_time_limit_is_used_up_and_not_exceeded_by_much():
    import time

    began = time.monotonic()
    result = search(small_problem(), settings=small_settings(), time_limit_s=4.0)
    assert result.stopped == "time limit"
    assert 4.0 <= time.monotonic() - began < 12.0


def test_a_guided_pass_keeps_to_the_itineraries_that_there_is_time_for(clock):
    problem = small_problem()
    pacer = ClockPacing(problem, Deadline(100.0), small_settings())
    pacer.begin_pass(1, small_settings(), [], scouted=True)
    ends = _ends([[5, 1, 2, 3], [5, 1, 4, 6], [7, 8, 9, 10]])
    waiting = _ends([[5], [7], [11]])
    guide = ItineraryGuide(ends)
    assert guide.legs_left(waiting) == 3
    # What leads nowhere is dropped, however much time there is.
    assert pacer.narrowed(guide, waiting, _counters(100, 0.001)).row.tolist() == [5, 7]
    # 80 s for 3 legs at 4 nodes an itinerary and 4 s a node: one itinerary.
    assert pacer.narrowed(guide, waiting, _counters(100, 4.0)).row.tolist() == [5]
    onward = guide.allows(waiting, np.array([0, 0, 1]), np.array([1, 8, 8]))
    assert onward.tolist() == [True, False, False]
    # Itineraries on which nothing was flown do not take the place of others.
    guide = ItineraryGuide(ends)
    assert pacer.narrowed(guide, waiting.take([1]), _counters(100, 4.0)).row.tolist() == [7]
    assert guide.legs_left(_ends([[11]])) == 0
    assert len(FixedPacing().narrowed(guide, waiting, [])) == 3


def test_in_little_time_a_narrow_beam_comes_first_and_later_one_is_among_the_scouted(clock):
    problem, settings = small_problem(), small_settings()
    pacer = ClockPacing(problem, Deadline(10.0), settings)
    assert pacer.begin_narrow_pass(1) is not None
    assert pacer.begin_narrow_pass(2) is None
    pacer = ClockPacing(problem, Deadline(600.0), settings)
    assert pacer.begin_narrow_pass(1) is None
    narrow = pacer.begin_narrow_pass(2)
    assert narrow is not None
    assert pacer.width(no_nodes(), narrow, _counters(100, 1e-5)) == narrow.beam_width == 60
    assert pacer.begin_narrow_pass(3) is None
    pacer.begin_pass(3, settings, [], scouted=True)
    clock[0] += 599.0
    assert pacer.begin_narrow_pass(2) is None
    assert FixedPacing().begin_narrow_pass(2) is None


def test_scouts_are_narrower_where_they_would_take_all_the_time(clock):
    settings = small_settings(scouts={"width": 200})
    for limit, width in ((600.0, 200), (30.0, 100), (1.0, 30)):
        pacer = ClockPacing(small_problem(), Deadline(limit), settings)
        assert pacer.begin_pass(1, settings, [], scouted=True).scouts.width == width
