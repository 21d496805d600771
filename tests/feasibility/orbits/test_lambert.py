"""Batch Lambert against pykep and against Kepler propagation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from feasibility.constants import DAY_S
from feasibility.errors import InputError
from feasibility.orbits import synthetic_main_belt
from feasibility.orbits.kepler_kernels import propagate_batch
from feasibility.orbits.lambert import lambert, lambert_delta_v
from feasibility.runtime.pykep_guard import load_pykep

EPS = np.finfo(float).eps


def _units(n, rng):
    u = rng.normal(size=(n, 3))
    return u / np.linalg.norm(u, axis=1, keepdims=True)


def _geometry(n, rng, angle=None):
    """Random positions, or with a given small distance from 0 and 180 degrees in turn."""
    u1, other = _units(n, rng), _units(n, rng)
    if angle is None:
        u2 = other
    else:
        side = np.cross(u1, other)
        side /= np.linalg.norm(side, axis=1, keepdims=True)
        sign = np.where(np.arange(n) % 2, 1.0, -1.0)
        u2 = (sign * np.cos(angle))[:, None] * u1 + np.sin(angle)[:, None] * side
    return u1 * rng.uniform(0.5, 4, (n, 1)), u2 * rng.uniform(0.5, 4, (n, 1))


def _worst_against_pykep(r1, r2, tof, max_revs):
    """Largest relative difference of each leg; the branches must be the same ones."""
    pk = load_pykep()
    v1, v2 = lambert(r1, r2, tof, max_revs, mu=1.0)
    worst = np.empty(len(tof))
    for i in range(len(tof)):
        problem = pk.lambert_problem(r1[i], r2[i], tof[i], 1.0, False, max_revs)
        ours = np.hstack([v1[i], v2[i]])[: len(problem.v0)]
        assert np.isfinite(v1[i, :, 0]).sum() == len(problem.v0)
        theirs = np.hstack([problem.v0, problem.v1])
        worst[i] = (np.linalg.norm(ours - theirs, axis=1) / np.linalg.norm(theirs, axis=1)).max()
    return worst


@pytest.mark.parametrize("max_revs", [0, 3])
def test_equals_pykep_to_1e_10(max_revs):
    rng = np.random.default_rng(4)
    r1, r2 = _geometry(1500, rng)
    assert _worst_against_pykep(r1, r2, 10 ** rng.uniform(-1, 2.3, 1500), max_revs).max() < 1e-10


def test_equals_pykep_near_0_and_180_degrees():
    # The plane, r1 x r2, is known to EPS / sin(angle) only, whoever computes it; at
    # 1e-5 rad that is below 1e-10 and the plain tolerance holds, closer by it is scaled.
    rng = np.random.default_rng(5)
    n = 1200
    angle = 10 ** rng.uniform(-7, -1, n)
    r1, r2 = _geometry(n, rng, angle)
    worst = _worst_against_pykep(r1, r2, 10 ** rng.uniform(-0.5, 2.0, n), 2)
    assert worst[angle > 1e-4].max() < 1e-10
    assert (worst / (1e-10 + 50 * EPS / angle)).max() < 1


def test_arcs_arrive():
    rng = np.random.default_rng(6)
    r1, r2 = _geometry(2000, rng)
    tof = rng.uniform(1.0, 60.0, 2000)
    v1, v2 = lambert(r1, r2, tof, 2, mu=1.0)
    legs, branches = np.nonzero(np.isfinite(v1[:, :, 0]))
    end = propagate_batch(np.hstack([r1[legs], v1[legs, branches]]), tof[legs], 1.0)
    expected = np.hstack([r2[legs], v2[legs, branches]])
    error = np.linalg.norm(end - expected, axis=1) / np.linalg.norm(expected, axis=1)
    assert np.percentile(error, 99) < 1e-9
    momentum = np.cross(r1[legs], v1[legs, branches])[:, 2]
    assert (momentum > 0).all()


@settings(max_examples=200, deadline=None)
@given(
    st.lists(
        st.sampled_from([-1e3, -1.0, -1e-12, 0.0, 1e-12, 1.0, 1.0 + 1e-9, 1e3]),
        min_size=6,
        max_size=6,
    ),
    st.floats(1e-9, 1e9),
    st.integers(0, 3),
)
def test_any_geometry_ends_without_error(numbers, tof, max_revs):
    v1, v2 = lambert([numbers[:3]], [numbers[3:]], [tof], max_revs, mu=1.0)
    assert v1.shape == v2.shape == (1, 1 + 2 * max_revs, 3)
    assert not np.isinf(v1).any()


def test_exactly_0_and_180_degrees_have_no_branch():
    v1, _ = lambert([[1, 0, 0], [1, 0, 0]], [[2, 0, 0], [-2, 0, 0]], [3.0, 3.0], 1, mu=1.0)
    assert np.isnan(v1).all()


@pytest.mark.parametrize(
    ("r1", "tof", "revs"),
    [([1.0, 0, 0], [1.0], 0), ([[1.0, 0, 0]], [1.0, 2.0], 0), ([[1.0, 0, 0]], [1.0], -1)],
)
def test_wrong_shapes_are_input_errors(r1, tof, revs):
    with pytest.raises(InputError):
        lambert(r1, [[0, 1.0, 0]], tof, revs)


def test_the_velocity_change_of_a_coasting_leg_is_zero():
    belt = synthetic_main_belt(5, np.random.default_rng(3))
    # Half a period lies in every plane; a third does not.
    later = belt.states_at(np.arange(5), 8000.0 + belt.period_days / 3)
    cost = lambert_delta_v(belt.states(8000.0), later, belt.period_days / 3 * DAY_S)
    assert cost.shape == (5,)
    assert cost.max() < 1e-5


def test_the_velocity_change_is_the_least_sum_of_both_impulses_and_infinite_without_a_branch():
    rv_dep = np.array([[1, 0, 0, 0, 1, 0.1], [1, 0, 0, 1, 0, 0]])
    rv_arr = np.array([[0, 2, 0.1, -0.7, 0, 0], [-2, 0, 0, 0, -0.7, 0]])
    v1, v2 = lambert(rv_dep[:, :3], rv_arr[:, :3], [40.0, 40.0], 2, mu=1.0)
    sums = np.linalg.norm(v1[0] - rv_dep[0, 3:], axis=1)
    sums += np.linalg.norm(v2[0] - rv_arr[0, 3:], axis=1)
    assert np.isfinite(sums).all()
    assert lambert_delta_v(rv_dep, rv_arr, 40.0, mu=1.0).tolist() == [sums.min(), np.inf]


def test_states_of_another_shape_are_input_errors():
    with pytest.raises(InputError, match=r"rv_dep: expected shape \(n, 6\), got \(1, 3\)"):
        lambert_delta_v([[1.0, 0, 0]], [[0, 1.0, 0, 0, 0, 0]], 1.0)
    with pytest.raises(InputError, match="same number of rows"):
        lambert_delta_v(np.ones((2, 6)), np.ones((1, 6)), 1.0)
