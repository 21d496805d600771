"""The margin model's inputs: free of units and directions, and right about the physics."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from feasibility import Legs
from feasibility.classifier.margin import feature_kernels as kernels
from feasibility.classifier.margin.features import (
    DOMAIN_QUANTITIES,
    FEATURES,
    QUICK_FEATURES,
    domain_quantities,
    log_acceleration,
    margin_features,
    quick_features,
)
from feasibility.classifier.margin.lanes import math_kernels
from feasibility.classifier.margin.lanes.rendezvous_kernels import quick_lane_batch
from feasibility.classifier.margin.path_kernels import (
    STRIDE,
    balanced_impulse,
    impulse_effects,
    spent_segments,
)
from feasibility.constants import AU, DAY_S, MU_SUN
from feasibility.dataset import read_protocol
from feasibility.orbits import synthetic_main_belt
from feasibility.runtime.jit import kernel
from feasibility.sims_flanagan.fast.element_kernels import from_elements, to_elements
from feasibility.sims_flanagan.fast.solver import fast_max_initial_mass

seeds = st.integers(0, 2**31)


def drawn(protocol, n, seed=0):
    read = read_protocol(protocol)
    catalogue = synthetic_main_belt(400, np.random.default_rng(1))
    rng = np.random.default_rng(seed)
    return read.sampler.draw(n, rng, catalogue, read.craft(), read.impulsive_grid).legs


def arrays(legs):
    return legs.rv_dep.copy(), legs.rv_arr.copy(), legs.tof_s, legs.exhaust_velocity


def features_of(rv_dep, rv_arr, tof, exhaust, mu=MU_SUN, *, quick=False):
    width = kernels.N_QUICK if quick else kernels.N_FEATURES
    X, hint = np.empty((len(tof), width)), np.empty(len(tof))
    batch = quick_lane_batch if quick else kernels.feature_batch
    batch(rv_dep, rv_arr, tof, exhaust, mu, X, hint)
    return X, hint


def assert_close(first, second):
    """Equal but for rounding, which a leg at the edge between two branches may feel."""
    for before, after in zip(first, second, strict=True):
        close = np.isclose(before, after, rtol=1e-5, atol=1e-5, equal_nan=True)
        rows = close.reshape(len(close), -1).all(axis=1)
        assert rows.mean() >= 0.9


def test_every_feature_has_a_name():
    assert len(FEATURES) == len(set(FEATURES)) == kernels.N_FEATURES
    assert len(QUICK_FEATURES) == len(set(QUICK_FEATURES)) == kernels.N_QUICK
    X, _ = margin_features(drawn("general", 50))
    column = dict(zip(FEATURES, X.T, strict=True))
    for name in ("sin_longitude_arr", "cost_share_n", "log_first_nearest", "thrust_19_size"):
        assert np.isfinite(column[name]).all()
    norms = sum(column[f"thrust_0_{axis}"] ** 2 for axis in "rtn")
    np.testing.assert_allclose(norms, 1.0, rtol=1e-6)
    # The best number of revolutions is refined from its first path, with more steps.
    beside = column["chosen_beside_nearest"]
    assert np.abs(column["log_first_nearest"] - column["log_round_0"])[beside == 0].max() < 0.5


@given(seed=seeds, quick=st.booleans())
def test_a_rotation_of_everything_changes_nothing(seed, quick):
    rv_dep, rv_arr, tof, exhaust = arrays(drawn("general", 20, seed))
    rotation = Rotation.random(random_state=np.random.default_rng(seed))

    def turned(rv):
        return np.column_stack([rotation.apply(rv[:, :3]), rotation.apply(rv[:, 3:])])

    assert_close(
        features_of(rv_dep, rv_arr, tof, exhaust, quick=quick),
        features_of(turned(rv_dep), turned(rv_arr), tof, exhaust, quick=quick),
    )


@given(seed=seeds, length=st.floats(1e-12, 1e3), time=st.floats(1e-8, 1e3), quick=st.booleans())
def test_other_units_of_length_and_time_change_nothing(seed, length, time, quick):
    rv_dep, rv_arr, tof, exhaust = arrays(drawn("general", 20, seed))
    units = np.array([length] * 3 + [length / time] * 3)
    assert_close(
        features_of(rv_dep, rv_arr, tof, exhaust, quick=quick),
        features_of(
            rv_dep * units,
            rv_arr * units,
            tof * time,
            exhaust * length / time,
            MU_SUN * length**3 / time**2,
            quick=quick,
        ),
    )


def test_masses_and_thrust_are_not_among_the_inputs():
    legs = drawn("table1", 20)
    other = Legs(legs.rv_dep, legs.rv_arr, legs.tof_days, 77.0, 0.5, legs.isp, 3.0)
    for function in (margin_features, quick_features):
        np.testing.assert_array_equal(function(legs)[0], function(other)[0])


def test_the_unit_of_acceleration_is_that_of_the_departure_orbit():
    leg = Legs([AU, 0, 0, 0, np.sqrt(MU_SUN / AU), 0], [0, AU, 0, -3e4, 0, 0], 90.0, 1000.0, 2.0,
               3000.0, 0.0)  # fmt: skip
    expected = np.log(2.0 / 1000.0 / (MU_SUN / AU**2))
    np.testing.assert_allclose(log_acceleration(leg, leg.m0), expected, rtol=1e-12)


@kernel
def sine_cosine(x):
    """Python cannot call what becomes a part of loops."""
    return math_kernels.sine_cosine(x)


@given(x=st.floats(-1e4, 1e4))
def test_sines_and_cosines_by_arithmetic_alone(x):
    np.testing.assert_allclose(sine_cosine(x), (np.sin(x), np.cos(x)), atol=1e-12)


@given(quarter=st.integers(-20, 20), beside=st.floats(-1e-3, 1e-3))
def test_sines_and_cosines_beside_right_angles(quarter, beside):
    for x in (0.5 * np.pi * quarter + beside, 0.5 * np.pi * (quarter + 0.5) + beside):
        np.testing.assert_allclose(sine_cosine(x), (np.sin(x), np.cos(x)), atol=1e-13)


@given(seed=seeds)
def test_gauss_rows_are_what_a_small_impulse_does(seed):
    rng = np.random.default_rng(seed)
    x = np.array([rng.uniform(0.4, 2.5), *rng.uniform(-0.5, 0.5, 4), rng.uniform(-3, 3)])
    state, plus, minus = np.empty(6), np.empty(6), np.empty(6)
    from_elements(x, state)
    # The leg's orbit at one of seven nodes, among other ones.
    path, rows, anomaly = np.zeros((6, STRIDE)), np.zeros(13 * STRIDE), np.zeros(6 * STRIDE)
    path[:, :7] = np.array([1.0, 0.1, 0.1, 0.1, 0.1, 2.0])[:, None]
    node, remaining = rng.integers(7), rng.uniform(0.0, 5.0)
    path[:, node], anomaly[node] = x, remaining
    assert impulse_effects(path.reshape(-1), 7, rows, anomaly)
    row = rows.reshape(13, STRIDE)[:, node]
    r, v = state[:3], state[3:]
    radial = r / np.linalg.norm(r)
    normal = np.cross(r, v) / np.linalg.norm(np.cross(r, v))
    axes = (radial, np.cross(normal, radial), normal)
    n_r, n_t, ex_r, ex_t, ex_n, ey_r, ey_t, ey_n, h_n, k_n, l_r, l_t, l_n = row
    written = ((n_r, ex_r, ey_r, 0, 0, l_r), (n_t, ex_t, ey_t, 0, 0, l_t),
               (0, ex_n, ey_n, h_n, k_n, l_n))  # fmt: skip
    for axis, effect in zip(axes, written, strict=True):
        step = 1e-6
        to_elements(np.concatenate([r, v + step * axis]), plus)
        to_elements(np.concatenate([r, v - step * axis]), minus)
        change = (plus - minus) / (2 * step)
        change[5] += remaining * change[0]
        np.testing.assert_allclose(effect, change, rtol=1e-4, atol=1e-4)


@given(seed=seeds, spent=st.floats(1e-4, 0.8))
def test_the_lighter_spacecraft_gives_larger_impulses(seed, spent):
    nodes = 20
    g = np.random.default_rng(seed).uniform(0.1, 2.0, (4, STRIDE))
    exhaust = 1.3
    z = spent * exhaust / nodes
    shares = np.array([1 - z * spent_segments(i, nodes) / exhaust for i in range(nodes)])
    value = z * np.sum(g[3, :nodes] / shares)
    c = np.empty(STRIDE)
    assert balanced_impulse(value, g.reshape(-1), exhaust, nodes, c) == pytest.approx(z, rel=1e-3)


@pytest.mark.parametrize(("protocol", "typical"), [("search", 0.03), ("table1", 0.02)])
def test_the_hint_is_near_the_solved_mass(protocol, typical):
    legs = drawn(protocol, 60, seed=3)
    solved = fast_max_initial_mass(legs)
    _, hint = margin_features(legs)
    rows = np.flatnonzero(solved.converged)
    assert len(rows) > 30
    error = np.abs(hint[rows] - log_acceleration(legs.take(rows), solved.m0[rows]))
    assert np.median(error) < typical


def test_features_are_finite_wherever_orbits_are_ellipses():
    rng = np.random.default_rng(0)
    legs = drawn("general", 300)
    wild = Legs(
        legs.rv_dep,
        legs.rv_arr[rng.permutation(300)],
        np.exp(rng.uniform(np.log(0.1), np.log(20000.0), 300)),
        1000.0,
        0.1,
        np.exp(rng.uniform(np.log(100.0), np.log(20000.0), 300)),
        0.0,
    )
    for function in (margin_features, quick_features):
        X, hint = function(wild)
        known = np.isfinite(hint)
        assert np.isfinite(X[known]).all()
        assert np.isnan(X[~known]).all()
        assert known.mean() > 0.8
        assert domain_quantities(X).shape == (300, len(DOMAIN_QUANTITIES))


@pytest.mark.parametrize("angle", [0.0, 1e-9, np.pi - 1e-9, np.pi])
def test_lambert_singularities_do_no_harm(angle):
    speed = np.sqrt(MU_SUN / (2.0 * AU))
    end = 2.02 * AU * np.array([np.cos(angle), np.sin(angle), 0.0])
    velocity = speed * np.array([-np.sin(angle), np.cos(angle), 0.02])
    tof = (angle + 2 * np.pi) / np.sqrt(MU_SUN / (2.0 * AU) ** 3) / DAY_S
    leg = Legs([2 * AU, 0, 0, 0, speed, 0], [*end, *velocity], tof, 1000.0, 0.3, 3000.0, 0.0)
    X, hint = margin_features(leg)
    assert np.isfinite(X).all()
    solved = fast_max_initial_mass(leg)
    assert abs(hint - log_acceleration(leg, solved.m0))[0] < 0.05


def test_short_legs_far_off_in_phase_take_the_nearest_number_of_revolutions():
    legs = drawn("search", 200)
    short = Legs(legs.rv_dep, legs.rv_arr, 40.0, 1000.0, 0.3, 3000.0, 0.0)
    X, hint = margin_features(short)
    column = dict(zip(FEATURES, X.T, strict=True))
    assert np.isfinite(hint).all()
    assert np.abs(column["phase_rate"]).max() > 0.5
    assert (column["chosen_beside_nearest"] == 0).all()


def test_unbound_orbits_have_no_features():
    fast = [2 * AU, 0, 0, 0, 4e4, 0]
    slow = [0, 2 * AU, 0, -2e4, 0, 0]
    legs = Legs([fast, slow], [slow, fast], 300.0, 1500.0, 0.236, 4190.0, 1000.0)
    for function in (margin_features, quick_features):
        assert np.isnan(function(legs)[1]).all()


def test_no_legs_have_no_features():
    none = drawn("table1", 2).take([])
    assert margin_features(none)[0].shape == (0, len(FEATURES))
