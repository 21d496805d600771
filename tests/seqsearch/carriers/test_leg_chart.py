"""Charts of legs: what is looked up is what the predictor says."""

import numpy as np
import pytest

from feasibility import InputError
from feasibility.classifier.predictor import bounded_final_mass
from feasibility.orbits.lambert import lambert_delta_v
from seqsearch.carriers.chart_files import has_chart, read_chart, write_chart
from seqsearch.carriers.chart_kernels import (
    LOG_MASS_LOW,
    LOG_MASS_UNIT,
    NEVER,
    SPEED_UNIT,
    mass_after,
    shortest_flight,
    value_at,
)
from seqsearch.carriers.leg_chart import HOME_TOF_DAYS, STEP_DAYS, TOF_DAYS
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


def test_looking_up_is_asking(world):
    chart, rng = world.chart, np.random.default_rng(1)
    pairs, source, share, t_dep, tof = _drawn(world, 400, rng)
    legs = known_legs(world, source, chart.target[pairs], t_dep, tof)
    asked = np.log(world.predictor.quick_margin(legs) * M0)
    speed = lambert_delta_v(legs.rv_dep, legs.rv_arr, legs.tof_s, 0)
    log_tof = np.log(TOF_DAYS)
    looked_up = LOG_MASS_LOW + LOG_MASS_UNIT * np.array(
        [
            value_at(chart.m_star[p], s, log_tof, np.log(t))
            for p, s, t in zip(pairs, share, tof, strict=True)
        ]
    )
    speeds = SPEED_UNIT * np.array(
        [
            value_at(chart.delta_v[p], s, log_tof, np.log(t))
            for p, s, t in zip(pairs, share, tof, strict=True)
        ]
    )
    flyable = (asked > np.log(700.0)) & (asked < np.log(4000.0))
    assert flyable.sum() > 100
    error = np.abs(looked_up - asked)[flyable]
    assert np.median(error) < 0.05
    assert np.quantile(error, 0.8) < 0.15
    assert np.median(np.abs(speeds / speed - 1.0)[flyable]) < 0.03


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
        curve = chart.m_star[p]
        at = shortest_flight(curve, share, log_tof, level)
        code = (level - LOG_MASS_LOW) / LOG_MASS_UNIT
        if at == NEVER:
            assert all(value_at(curve, share, log_tof, x) < code for x in log_tof)
        elif at > log_tof[0]:
            reached += 1
            assert value_at(curve, share, log_tof, at) == pytest.approx(code, abs=1e-6)
            assert value_at(curve, share, log_tof, at - 1e-3) < code
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
            (np.log(M0 * margin[k]) - LOG_MASS_LOW) / LOG_MASS_UNIT,
            speed[k] / SPEED_UNIT,
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
    at = np.log(140.0)
    codes = [
        (
            value_at(near.m_star[near.index[k, body]], 0.4, near.log_tof, at),
            value_at(far.m_star[far.index[k, body]], 0.4, far.log_tof, at),
        )
        for k, body in np.argwhere(both)
    ]
    difference = LOG_MASS_UNIT * np.diff(np.array(codes), axis=1)
    assert np.median(np.abs(difference)) < 0.03
    assert far.log_tof[-1] == np.log(HOME_TOF_DAYS[-1])


def test_a_folder_gives_the_chart_back(world, tmp_path):
    folder = tmp_path / "chart"
    assert not has_chart(folder)
    write_chart(world.chart, folder)
    assert has_chart(folder)
    read = read_chart(folder)
    assert read.t0_mjd2000 == world.chart.t0_mjd2000
    for name in ("rows", "offsets", "target", "m_star", "delta_v", "points", "source", "to"):
        np.testing.assert_array_equal(getattr(read, name), getattr(world.chart, name))


def test_a_damaged_file_of_a_chart_is_one_clear_error(world, tmp_path):
    write_chart(world.chart, tmp_path / "chart")
    file = tmp_path / "chart" / "m_star.npy"
    file.write_bytes(file.read_bytes()[:1000])
    with pytest.raises(InputError, match=r"m_star\.npy: not a chart's file"):
        read_chart(tmp_path / "chart")
