"""Charts of curves: what is looked up is what the predictor says."""

import numpy as np
import pytest

from feasibility import Legs
from feasibility.classifier.predictor import bounded_final_mass
from feasibility.orbits.lambert import lambert_delta_v
from seqsearch.chart.curve_kernels import (
    NEVER,
    mass_after,
    shortest_flight,
    squares,
    value_at,
)
from seqsearch.chart.curves import SPEED_UNIT
from seqsearch.chart.making import legs_of, make_chart
from tests.helpers.curve_charts import M0, roamed

WORK = np.empty(4)


@pytest.fixture(scope="module")
def world():
    return roamed()


def _drawn(world, count, rng):
    """Return pairs of the chart, shares of their intervals, flight times, and the legs."""
    chart, survey = world.chart, world.survey
    pairs = rng.integers(0, len(chart.target), count)
    entry = np.searchsorted(chart.offsets, pairs, side="right") - 1
    interval, source = np.divmod(entry, len(chart.rows))
    share = rng.uniform(0.0, 1.0, count)
    t_dep = chart.t0_mjd2000 + (interval + share) * chart.step_days
    tof = rng.uniform(chart.tof_days[0], chart.tof_days[-1], count)
    legs = Legs(
        rv_dep=survey.catalogue.states_at(chart.rows[source], t_dep),
        rv_arr=survey.catalogue.states_at(chart.rows[chart.target[pairs]], t_dep + tof),
        tof_days=tof,
        m0=M0,
        thrust=survey.thrust,
        isp=survey.isp,
        m_dry=survey.m_dry,
    )
    return pairs, share, tof, legs


def _log_m_star(chart, pair, share):
    y = np.empty(len(chart.tof_days))
    squares(chart.inverse[pair], share, chart.inverse_unit, y)
    return -0.5 * np.log(y)


def _speeds(chart, pair, share):
    v = np.empty(len(chart.tof_days))
    squares(chart.speed[pair], share, SPEED_UNIT, v)
    return np.sqrt(v)


def test_looking_up_is_asking(world):
    chart, rng = world.chart, np.random.default_rng(1)
    pairs, share, tof, legs = _drawn(world, 600, rng)
    asked = np.log(world.predictor.quick_margin(legs) * M0)
    speed = lambert_delta_v(legs.rv_dep, legs.rv_arr, legs.tof_s, 0)
    x = np.log(chart.tof_days)
    drawn = list(zip(pairs, share, np.log(tof), strict=True))
    m_star = np.array([value_at(x, _log_m_star(chart, p, s), t, WORK) for p, s, t in drawn])
    speeds = np.array([value_at(x, _speeds(chart, p, s), t, WORK) for p, s, t in drawn])
    flyable = (asked > np.log(800.0)) & (asked < np.log(2100.0))
    assert flyable.sum() > 100
    error = (m_star - asked)[flyable]
    assert abs(error.mean()) < 0.005
    assert np.median(np.abs(error)) < 0.01
    assert np.quantile(np.abs(error), 0.9) < 0.04
    assert np.median(np.abs(speeds / speed - 1.0)[flyable]) < 0.01


def test_the_shortest_flight_is_where_the_curve_reaches_the_level(world):
    chart, rng = world.chart, np.random.default_rng(2)
    x = np.log(chart.tof_days)
    reached = 0
    for pair, share, level in zip(
        rng.integers(0, len(chart.target), 300),
        rng.uniform(0.0, 1.0, 300),
        np.log(rng.uniform(800.0, 2500.0, 300)),
        strict=True,
    ):
        y = _log_m_star(chart, pair, share)
        at = shortest_flight(x, y, level, WORK)
        if at == NEVER:
            assert (y < level).all()
        elif at == x[0]:
            assert y[0] >= level
        else:
            reached += 1
            assert x[0] < at <= x[-1]
            assert value_at(x, y, at, WORK) == pytest.approx(level, abs=5e-3)
    assert reached > 50


def test_burn_is_the_predictors_bound(world):
    _, _, _, legs = _drawn(world, 200, np.random.default_rng(3))
    margin = world.predictor.quick_margin(legs)
    speed = lambert_delta_v(legs.rv_dep, legs.rv_arr, legs.tof_s, 0)
    expected = bounded_final_mass(legs, margin)
    exhaust = float(legs.exhaust_velocity[0])
    for k in np.flatnonzero(np.isfinite(expected) & (margin > 1.0) & np.isfinite(speed)):
        after = mass_after(
            M0, np.log(margin[k] * M0), speed[k], legs.tof_s[k], legs.thrust[k], exhaust
        )
        assert after == pytest.approx(expected[k], rel=1e-3)


def test_a_chart_does_not_depend_on_the_number_of_threads(world):
    two = make_chart(world.survey, world.predictor, threads=2)
    assert two is not None
    assert np.array_equal(two.offsets, world.chart.offsets)
    assert np.array_equal(two.target, world.chart.target)
    assert np.abs(two.inverse.astype(int) - world.chart.inverse).max() <= 1


def test_charts_are_given_up_when_told(world):
    answers = iter([True, True, False])
    assert make_chart(world.survey, world.predictor, goes_on=lambda: next(answers)) is None


def test_the_estimate_of_the_work_grows_with_bodies_and_intervals(world):
    assert legs_of(world.survey) > 16 * len(world.survey.rows) * world.survey.intervals
