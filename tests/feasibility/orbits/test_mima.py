"""MIMA and MIMA2 against pykep."""

import numpy as np
import pytest

from feasibility.constants import AU, DAY_S, MU_SUN
from feasibility.errors import InputError
from feasibility.orbits.lambert import lambert, lambert_delta_v
from feasibility.orbits.mima import (
    mima,
    mima2,
    mima2_branches,
    mima_branches,
)
from feasibility.orbits.varied_legs import varied_legs
from feasibility.runtime.pykep_guard import load_pykep

THRUST, EXHAUST = 0.3, 30000.0


def _both(max_revs=2):
    """Return pykep's and our values on every existing branch, and the impulses' sum."""
    pk = load_pykep()
    rows = []
    for seed in range(4):
        legs = varied_legs(np.random.default_rng(seed))
        v1, v2 = lambert(legs.rv_dep[:, :3], legs.rv_arr[:, :3], legs.tof_s, max_revs)
        first = mima_branches(legs.rv_dep, legs.rv_arr, legs.tof_s, THRUST, EXHAUST, max_revs)
        second = mima2_branches(legs.rv_dep, legs.rv_arr, legs.tof_s, THRUST, EXHAUST, max_revs)
        np.testing.assert_array_equal(np.isnan(first), np.isnan(v1[:, :, 0]))
        for i, b in zip(*np.nonzero(np.isfinite(first)), strict=True):
            dv1 = v1[i, b] - legs.rv_dep[i, 3:]
            dv2 = legs.rv_arr[i, 3:] - v2[i, b]
            arc = [legs.rv_dep[i, :3], v1[i, b]]
            tof = legs.tof_s[i]
            rows.append(
                (
                    pk.mima(dv1, dv2, tof, THRUST, EXHAUST)[0],
                    first[i, b],
                    pk.mima2(arc, dv1, dv2, tof, THRUST, EXHAUST, MU_SUN)[0],
                    second[i, b],
                    np.linalg.norm(dv1) + np.linalg.norm(dv2),
                )
            )
    return np.array(rows)


@pytest.fixture(scope="module")
def both():
    return _both()


def test_mima_equals_pykep_to_1e_10(both):
    assert len(both) > 300
    np.testing.assert_allclose(both[:, 1], both[:, 0], rtol=1e-10)


def test_mima2_equals_pykep_to_1e_10_where_the_switching_time_is_unique(both):
    # Where several switching times make the accelerations equal, each is a solution and pykep's
    # search may end at another one; this happens on arcs far beyond any low thrust.
    cheap = both[:, 4] < 6000.0
    assert cheap.sum() > 30
    np.testing.assert_allclose(both[cheap, 3], both[cheap, 2], rtol=1e-10)
    same = np.isclose(both[:, 3], both[:, 2], rtol=1e-10)
    assert same.mean() > 0.95


def test_best_branch_is_the_largest_and_a_missing_one_counts_as_zero():
    legs = varied_legs(np.random.default_rng(9))
    arguments = (legs.rv_dep, legs.rv_arr, legs.tof_s, legs.thrust, legs.exhaust_velocity)
    for best, branches in ((mima, mima_branches), (mima2, mima2_branches)):
        np.testing.assert_array_equal(best(*arguments), np.nanmax(branches(*arguments), axis=1))
        assert (best(*arguments) >= best(*arguments, max_revs=0)).all()
    # Straight up, towards the opposite side: not even the departure orbit has a plane.
    opposite = np.array([[2 * AU, 0, 0, 2e4, 0, 0], [-2 * AU, 0, 0, 0, -2e4, 0]])
    for best in (mima, mima2):
        assert best(opposite[:1], opposite[1:], [200 * DAY_S], 0.3, 3e4)[0] == 0.0
    assert np.isinf(lambert_delta_v(opposite[:1], opposite[1:], [200 * DAY_S])[0])


def test_mass_is_proportional_to_thrust_at_given_exhaust_velocity():
    legs = varied_legs(np.random.default_rng(9))
    single = mima2(legs.rv_dep, legs.rv_arr, legs.tof_s, 0.2, 3e4)
    double = mima2(legs.rv_dep, legs.rv_arr, legs.tof_s, 0.4, 3e4)
    np.testing.assert_allclose(double, 2 * single, rtol=1e-14)


def test_wrong_shapes_are_input_errors():
    state = np.ones((2, 6))
    for bad in (
        lambda: mima(state[:, :5], state, 1.0, 1.0, 1.0),
        lambda: mima(state, state[:1], 1.0, 1.0, 1.0),
        lambda: mima2(state, state, [1.0, 2.0, 3.0], 1.0, 1.0),
        lambda: mima2(state, state, 1.0, 1.0, 1.0, max_revs=-1),
    ):
        with pytest.raises(InputError):
            bad()
