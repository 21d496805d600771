"""The quick features of eight legs at a time are those of one, wherever a leg stands."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from feasibility.classifier.margin import feature_kernels, free_feature_kernels
from feasibility.classifier.margin.features import quick_features
from feasibility.classifier.margin.free_features import quick_free_features
from feasibility.classifier.margin.lanes import math_kernels
from feasibility.constants import MU_SUN
from feasibility.dataset import read_protocol
from feasibility.orbits import synthetic_main_belt
from feasibility.runtime.jit import kernel

RENDEZVOUS = ["search", "general", "table1"]
FREE = ["launch", "launch-flyby", "arrival", "flyby"]


def drawn(protocol, n, seed=0):
    read = read_protocol(protocol)
    catalogue = synthetic_main_belt(400, np.random.default_rng(1))
    craft = read.craft() if read.spacecraft else None
    rng = np.random.default_rng(seed)
    return read.sampler.draw(n, rng, catalogue, craft, read.impulsive_grid).legs


def function_of(protocol):
    return quick_features if protocol in RENDEZVOUS else quick_free_features


def alone(legs, protocol):
    """Return the quick features by the kernel for one leg."""
    columns = (legs.rv_dep.copy(), legs.rv_arr.copy(), legs.tof_s, legs.exhaust_velocity)
    hint = np.empty(len(legs))
    if protocol in RENDEZVOUS:
        X = np.empty((len(legs), feature_kernels.N_QUICK))
        feature_kernels.quick_batch(*columns, MU_SUN, X, hint)
        return X, hint
    X = np.empty((len(legs), free_feature_kernels.N_FREE_QUICK))
    ends = np.column_stack([legs.vinf_dep, legs.vinf_arr])
    free_feature_kernels.free_quick_batch(*columns, ends, MU_SUN, X, hint)
    return X, hint


@pytest.mark.parametrize("protocol", RENDEZVOUS + FREE)
def test_eight_at_a_time_are_as_one_alone(protocol):
    legs = drawn(protocol, 2003)
    X, hint = function_of(protocol)(legs)
    expected, expected_hint = alone(legs, protocol)
    np.testing.assert_array_equal(np.isnan(hint), np.isnan(expected_hint))
    np.testing.assert_allclose(hint, expected_hint, atol=2e-5)
    # Sums of impulses are iterated to a part in a million; hardly any leg feels more than that.
    apart = np.abs(X - expected).max(axis=1)
    assert np.nanquantile(apart, 0.99) < 1e-5
    assert np.nanmax(apart) < 1e-2


@pytest.mark.parametrize("protocol", RENDEZVOUS + FREE)
def test_no_bit_of_a_leg_depends_on_the_others(protocol):
    legs = drawn(protocol, 203, seed=3)
    function = function_of(protocol)
    X, hint = function(legs)
    order = np.random.default_rng(0).permutation(len(legs))
    shuffled, shuffled_hint = function(legs.take(order))
    np.testing.assert_array_equal(shuffled, X[order])
    np.testing.assert_array_equal(shuffled_hint, hint[order])
    for first in range(5):
        one, one_hint = function(legs.take([first]))
        np.testing.assert_array_equal(one[0], X[first])
        np.testing.assert_array_equal(one_hint[0], hint[first])


@kernel
def elementary(x, y):
    s, c = math_kernels.sine_cosine(x)
    small_s, small_c = math_kernels.small_sine_cosine(0.8 * math_kernels.sine_cosine(y)[0])
    size = abs(x) + 1e-3
    return (
        math_kernels.log(size),
        math_kernels.exp(y),
        s,
        c,
        small_s,
        small_c,
        math_kernels.atan2(x, y),
        math_kernels.inverse_cube_root(size),
    )


@given(x=st.floats(-1e3, 1e3), y=st.floats(-20.0, 20.0))
def test_elementary_functions_by_arithmetic_alone(x, y):
    size, small = abs(x) + 1e-3, 0.8 * np.sin(y)
    expected = (np.log(size), np.exp(y), np.sin(x), np.cos(x), np.sin(small), np.cos(small),
                np.arctan2(x, y), size ** (-1 / 3))  # fmt: skip
    if x == 0.0 or y == 0.0:
        return
    np.testing.assert_allclose(elementary(x, y), expected, rtol=1e-12, atol=1e-12)
