"""Charts of legs: what is looked up is what the predictor says."""

import numpy as np
import pytest

from feasibility import InputError
from feasibility.classifier.predictor import bounded_final_mass
from feasibility.orbits.lambert import lambert_delta_v
from seqsearch.carriers.chart_files import has_chart, read_chart, write_chart
from seqsearch.carriers.leg_chart import HOME_TOF_DAYS, STEP_DAYS, TOF_DAYS
from seqsearch.chart.curve_kernels import NEVER, mass_after, shortest_flight, squares, value_at
from seqsearch.chart.curves import SPEED_UNIT, inverse_unit
from tests.helpers.charts import CRAFT, M0, charted, known_legs


@pytest.fixture(scope="module")
def world():
    return charted()


def _drawn(world, count, rng):
    """Return pairs of the chart, departures within their intervals, and flight times."""
    chart = world.chart
    pairs = rng.integers(0, len(chart.target), count)
    interval, source = np.divmod(chart.source[pairs], len(chart.rows))
    share = rng.uniform(0.0, 1.0, count)
    t_dep = chart.t0_mjd2000 + (interval + share) * STEP_DAYS
    tof = rng.uniform(TOF_DAYS[0], TOF_DAYS[-1], count)
    return pairs, source, share, t_dep, tof


def _masses(codes, share):
    """Return log(m*) at all flight times."""
    out = np.empty(codes.shape[1])
    squares(codes, share, inverse_unit(CRAFT.m_dry), out)
    return -0.5 * np.log(out)


def _speeds(codes, share):
    """Return the velocity changes at all flight times."""
    out = np.empty(codes.shape[1])
    squares(codes, share, SPEED_UNIT, out)
    return np.sqrt(out)


def test_looking_up_is_asking(world):
    chart, rng = world.chart, np.random.default_rng(1)
    pairs, source, share, t_dep, tof = _drawn(world, 400, rng)
    legs = known_legs(world, source, chart.target[pairs], t_dep, tof)
    asked = np.log(world.predictor.quick_margin(legs) * M0)
    speed = lambert_delta_v(legs.rv_dep, legs.rv_arr, legs.tof_s, 0)
    log_tof = np.log(TOF_DAYS)
    looked_up, speeds = (
        np.array(
            [
                value_at(log_tof, curve(codes[p], s), np.log(t), np.empty(4))
                for p, s, t in zip(pairs, share, tof, strict=True)
            ]
        )
        for curve, codes in ((_masses, chart.inverse), (_speeds, chart.speed))
    )
    flyable = (asked > np.log(700.0)) & (asked < np.log(4000.0))
    assert flyable.sum() > 100
    error = (looked_up - asked)[flyable]
    assert abs(error.mean()) < 0.01
    assert np.median(np.abs(error)) < 0.01
    assert np.quantile(np.abs(error), 0.8) < 0.04
    assert np.median(np.abs(speeds / speed - 1.0)[flyable]) < 0.01


def test_the_shortest_flight_is_where_the_curve_reaches_the_level(world):
    chart, rng = world.chart, np.random.default_rng(2)
    log_tof = np.log(TOF_DAYS)
    reached = 0
    for p, share, level in zip(
        rng.integers(0, len(chart.target), 300),
        rng.uniform(0.0, 1.0, 300),
        np.log(rng.uniform(800.0, 2500.0, 300)),
        strict=True,
    ):
        curve, work = _masses(chart.inverse[p], share), np.empty(4)
        at = shortest_flight(log_tof, curve, level, work)
        if at == NEVER:
            assert (curve < level).all()
        elif at > log_tof[0]:
            reached += 1
            assert value_at(log_tof, curve, at, work) == pytest.approx(level, abs=1e-3)
            assert value_at(log_tof, curve, at - 1e-2, work) < level
    assert reached > 50


def test_the_mass_on_arrival_is_that_of_the_predictor(world):
    rng = np.random.default_rng(3)
    pairs, source, _, t_dep, tof = _drawn(world, 200, rng)
    legs = known_legs(world, source, world.chart.target[pairs], t_dep, tof)
    margin = world.predictor.quick_margin(legs)
    speed = lambert_delta_v(legs.rv_dep, legs.rv_arr, legs.tof_s, 0)
    expected = bounded_final_mass(legs, margin)
    got = [
        mass_after(
            M0,
            np.log(M0 * margin[k]),
            speed[k],
            legs.tof_s[k],
            CRAFT.thrust,
            CRAFT.exhaust_velocity,
        )
        for k in range(len(legs))
    ]
    within = expected > CRAFT.m_dry
    assert within.sum() > 20
    np.testing.assert_allclose(np.array(got)[within], expected[within], rtol=1e-9)


def test_ways_of_the_chart_are_its_pairs_to_a_body(world):
    chart = world.chart
    end = int(np.bincount(chart.target).argmax())
    ways = chart.ways(end, 3, 9)
    n = len(chart.rows)
    expected = [
        (interval, body)
        for interval in range(3, 10)
        for body in range(n)
        if end
        in chart.target[
            chart.offsets[interval * n + body] : chart.offsets[interval * n + body + 1]
        ]
    ]
    found = [(int(k) + 3, int(body)) for k, body in np.argwhere(ways.index >= 0)]
    assert found == expected
    assert len(expected) > 20


def test_thorough_ways_reach_farther_and_agree_where_both_know(world):
    chart = world.chart
    end = int(np.bincount(chart.target).argmax())
    near, far = chart.ways(end, 3, 5), world.maker.ways(end, 3, 5)
    both = (near.index >= 0) & (far.index >= 0)
    assert (far.index >= 0).sum() > 1.5 * both.sum() > 10
    at, work = np.log(140.0), np.empty(4)
    difference = [
        value_at(near.log_tof, _masses(near.inverse[near.index[k, body]], 0.4), at, work)
        - value_at(far.log_tof, _masses(far.inverse[far.index[k, body]], 0.4), at, work)
        for k, body in np.argwhere(both)
    ]
    assert np.median(np.abs(difference)) < 0.03
    assert far.log_tof[-1] == np.log(HOME_TOF_DAYS[-1])


def test_ways_are_the_same_whether_asked_at_once_or_in_parts(world):
    end = int(np.bincount(world.chart.target).argmax())
    whole = charted().maker.ways(end, 3, 7)
    maker = charted().maker
    maker.ways(end, 4, 4)
    maker.ways(end, 6, 7)
    again = maker.ways(end, 3, 7)
    np.testing.assert_array_equal(whole.index, again.index)
    for name in ("inverse", "speed"):
        np.testing.assert_allclose(getattr(whole, name), getattr(again, name), atol=1)


def test_a_folder_gives_the_chart_back(world, tmp_path):
    folder = tmp_path / "chart"
    assert not has_chart(folder)
    write_chart(world.chart, folder)
    assert has_chart(folder)
    read = read_chart(folder)
    assert read.t0_mjd2000 == world.chart.t0_mjd2000
    for name in ("rows", "offsets", "target", "inverse", "speed", "points", "source", "to"):
        np.testing.assert_array_equal(getattr(read, name), getattr(world.chart, name))


def test_a_damaged_file_of_a_chart_is_one_clear_error(world, tmp_path):
    write_chart(world.chart, tmp_path / "chart")
    file = tmp_path / "chart" / "inverse.npy"
    file.write_bytes(file.read_bytes()[:1000])
    with pytest.raises(InputError, match=r"inverse\.npy: not a chart's file"):
        read_chart(tmp_path / "chart")
