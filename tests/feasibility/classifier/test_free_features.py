"""The inputs of the nets for legs with free ends: free of units, and right about the physics."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from feasibility import Legs
from feasibility.classifier.margin import free_feature_kernels as kernels
from feasibility.classifier.margin.features import FEATURES, log_acceleration, margin_features
from feasibility.classifier.margin.free_features import (
    FREE_DOMAIN_QUANTITIES,
    FREE_FEATURES,
    FREE_QUICK_FEATURES,
    features_and_excess,
    free_domain_quantities,
    free_features,
    log_free_acceleration,
    log_no_thrust,
    quick_free_features,
)
from feasibility.classifier.margin.lanes.free_kernels import free_quick_lane_batch
from feasibility.constants import AU, DAY_S, MU_SUN
from feasibility.orbits.kepler_kernels import propagate_batch
from feasibility.sims_flanagan.fast.solver import fast_max_initial_mass
from tests.helpers.free_legs import free_legs, with_ends

seeds = st.integers(0, 2**31)
BOUNDS = [(2000.0, 0.0), (0.0, 2000.0), (1500.0, np.inf), (0.0, np.inf), (800.0, 1200.0)]
bounds = st.sampled_from(BOUNDS)


def arrays(legs):
    ends = np.column_stack([legs.vinf_dep, legs.vinf_arr])
    return legs.rv_dep.copy(), legs.rv_arr.copy(), legs.tof_s, legs.exhaust_velocity, ends


def features_of(rv_dep, rv_arr, tof, exhaust, ends, mu=MU_SUN, *, quick=False):
    width = kernels.N_FREE_QUICK if quick else kernels.N_FREE
    X, hint = np.empty((len(tof), width)), np.empty(len(tof))
    if quick:
        free_quick_lane_batch(rv_dep, rv_arr, tof, exhaust, ends, mu, X, hint)
    else:
        excess = np.empty((len(tof), 6))
        kernels.free_feature_batch(rv_dep, rv_arr, tof, exhaust, ends, mu, X, hint, excess)
    return X, hint


def assert_close(first, second):
    """Equal but for rounding, which a leg at the edge between two starts may feel."""
    for before, after in zip(first, second, strict=True):
        close = np.isclose(before, after, rtol=1e-4, atol=1e-4, equal_nan=True)
        rows = close.reshape(len(close), -1).all(axis=1)
        assert rows.mean() >= 0.8


def test_every_feature_has_a_name():
    assert len(FREE_FEATURES) == len(set(FREE_FEATURES)) == kernels.N_FREE
    assert len(FREE_QUICK_FEATURES) == len(set(FREE_QUICK_FEATURES)) == kernels.N_FREE_QUICK
    X, hint = free_features(free_legs(30, 1, 1500.0, np.inf))
    known = X[:, FREE_FEATURES.index("moved_known")] == 1.0
    assert 5 < known.sum() < 30
    # Legs that need no thrust have nothing to show but that.
    assert (X[~known] == 0.0).all()
    np.testing.assert_array_equal(hint[~known], log_no_thrust())
    column = dict(zip(FREE_FEATURES, X[known].T, strict=True))
    assert (column["open_arr"] == 1.0).all()
    assert (column["open_dep"] == 0.0).all()
    assert (column["bound_dep"] > 0.0).all()
    assert (column["excess_to_bound_dep"] <= 1.0).all()


@pytest.mark.parametrize("quick", [False, True])
@given(seed=seeds, ends=bounds)
def test_a_rotation_of_everything_changes_nothing(quick, seed, ends):
    rv_dep, rv_arr, *rest = arrays(free_legs(20, seed, *ends))
    rotation = Rotation.random(random_state=np.random.default_rng(seed))

    def turned(rv):
        return np.column_stack([rotation.apply(rv[:, :3]), rotation.apply(rv[:, 3:])])

    assert_close(
        features_of(rv_dep, rv_arr, *rest, quick=quick),
        features_of(turned(rv_dep), turned(rv_arr), *rest, quick=quick),
    )


@pytest.mark.parametrize("quick", [False, True])
@given(seed=seeds, ends=bounds, length=st.floats(0.1, 10.0), time=st.floats(0.1, 10.0))
def test_other_units_change_nothing_but_the_accelerations(quick, seed, ends, length, time):
    rv_dep, rv_arr, tof, exhaust, limits = arrays(free_legs(20, seed, *ends))
    units = np.array([length] * 3 + [length / time] * 3)
    X, hint = features_of(rv_dep, rv_arr, tof, exhaust, limits, quick=quick)
    Y, other = features_of(
        rv_dep * units,
        rv_arr * units,
        tof * time,
        exhaust * length / time,
        limits * length / time,
        MU_SUN * length**3 / time**2,
        quick=quick,
    )
    rows = hint > log_no_thrust()
    assert_close((X[rows], hint[rows]), (Y[rows], other[rows] - np.log(length / time**2)))


def test_masses_and_thrust_are_not_among_the_inputs():
    legs = free_legs(20, 2, 1000.0, 1000.0)
    other = Legs(
        legs.rv_dep,
        legs.rv_arr,
        legs.tof_days,
        77.0,
        0.5,
        legs.isp,
        3.0,
        vinf_dep=1000.0,
        vinf_arr=1000.0,
    )
    for function in (free_features, quick_free_features):
        np.testing.assert_array_equal(function(legs)[0], function(other)[0])


def test_excess_of_a_millimetre_a_second_is_a_rendezvous():
    legs = free_legs(60, 3, 1e-3, 1e-3, far=0.03)
    _, hint = free_features(legs)
    rendezvous = with_ends(legs)
    _, expected = margin_features(rendezvous)
    # From the unit of the departure orbit to m/s2.
    expected -= log_acceleration(rendezvous, legs.m0) - log_free_acceleration(legs, legs.m0)
    # The linear problem has more rounds than the rendezvous hint.
    assert np.median(np.abs(hint - expected)) < 2e-3
    np.testing.assert_allclose(hint, expected, atol=0.05)


def test_excess_velocities_stay_within_their_bounds():
    for ends in BOUNDS:
        legs = free_legs(40, 4, *ends)
        found = features_and_excess(legs)[2]
        found = found[np.isfinite(found).all(axis=1)]
        assert len(found) > 30
        for k in range(2):
            assert np.linalg.norm(found[:, 3 * k : 3 * k + 3], axis=1).max() <= ends[k] * 1.001


@pytest.mark.parametrize("ends", BOUNDS)
def test_the_hint_is_near_the_solved_mass(ends):
    legs = free_legs(150, 5, *ends, far=0.05)
    solved = fast_max_initial_mass(legs)
    _, hint = free_features(legs)
    rows = np.flatnonzero(solved.converged & np.isfinite(solved.m0))
    assert len(rows) > 30
    error = np.abs(hint[rows] - log_free_acceleration(legs.take(rows), solved.m0[rows]))
    assert np.median(error) < 0.02
    assert np.quantile(error, 0.8) < 0.1


def test_more_excess_hardly_ever_gives_a_worse_hint():
    base = free_legs(100, 6, far=0.05)
    before = None
    for bound in (200.0, 500.0, 1000.0, 2000.0):
        _, hint = free_features(with_ends(base, bound, bound))
        if before is not None:
            both = np.isfinite(hint) & np.isfinite(before)
            assert np.quantile((hint - before)[both], 0.95) < 0.01
        before = hint


def test_no_bound_is_a_very_large_bound():
    base = free_legs(60, 7, far=0.05)
    _, hint = free_features(with_ends(base, 0.0, np.inf))
    _, large = free_features(with_ends(base, 0.0, 60000.0))
    assert np.nanmedian(np.abs(hint - large)) < 0.01


def test_a_coasting_leg_needs_no_thrust():
    legs = free_legs(20, 8, 1500.0, 2000.0)
    push = np.random.default_rng(8).normal(0.0, 500.0, (20, 3))
    kicked = legs.rv_dep.copy()
    kicked[:, 3:] += push
    arrival = propagate_batch(kicked, legs.tof_days * DAY_S, MU_SUN)
    arrival[:, 3:] += push
    coasting = Legs(
        legs.rv_dep,
        arrival,
        legs.tof_days,
        1500.0,
        0.3,
        3000.0,
        100.0,
        vinf_dep=1500.0,
        vinf_arr=2000.0,
    )
    for function in (free_features, quick_free_features):
        X, hint = function(coasting)
        short = hint == log_no_thrust()
        assert short.mean() > 0.8
        assert np.isfinite(X[short]).all()


def test_features_are_finite_wherever_there_is_a_hint():
    rng = np.random.default_rng(0)
    legs = free_legs(200, 9)
    wild = Legs(
        legs.rv_dep,
        legs.rv_arr[rng.permutation(200)],
        np.exp(rng.uniform(np.log(1.0), np.log(3000.0), 200)),
        1000.0,
        0.1,
        np.exp(rng.uniform(np.log(300.0), np.log(10000.0), 200)),
        0.0,
        vinf_dep=rng.choice([0.0, 1000.0, 30000.0, np.inf], 200),
        vinf_arr=rng.choice([0.0, 1000.0, 30000.0, np.inf], 200),
    )
    for function in (free_features, quick_free_features):
        X, hint = function(wild)
        known = np.isfinite(hint)
        assert np.isfinite(X[known]).all()
        assert np.isnan(X[~known]).all()
        assert known.mean() > 0.5
        assert free_domain_quantities(X).shape == (200, len(FREE_DOMAIN_QUANTITIES))


def test_a_leg_without_a_plane_has_no_features():
    legs = Legs(
        [[AU, 0, 0, 2e4, 0, 0]],
        [[0, 2 * AU, 0, -2e4, 0, 0]],
        300.0,
        1500.0,
        0.236,
        4190.0,
        1000.0,
        vinf_arr=np.inf,
    )
    for function in (free_features, quick_free_features):
        assert np.isnan(function(legs)[1]).all()


def test_the_first_features_are_those_of_a_rendezvous():
    assert FREE_FEATURES[: len(FEATURES)] == FEATURES
    assert free_features(free_legs(2, 0).take([]))[0].shape == (0, len(FREE_FEATURES))
