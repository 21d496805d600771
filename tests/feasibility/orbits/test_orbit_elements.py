"""Conversions of orbital elements: round trips, singular cases, and pykep as the judge."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from feasibility.constants import AU, EARTH_VELOCITY, MU_SUN
from feasibility.errors import InputError
from feasibility.orbits import (
    cartesian_to_classical,
    cartesian_to_equinoctial,
    classical_to_cartesian,
    classical_to_equinoctial,
    equinoctial_to_cartesian,
    equinoctial_to_classical,
)
from feasibility.orbits.classical import mean_to_eccentric
from feasibility.runtime.pykep_guard import load_pykep

# The first example pays for importing pykep or loading a compiled kernel.
UNTIMED = settings(deadline=None)

ANGLE = st.floats(0.0, 2.0 * np.pi)


def ellipses(e_max=0.99, i_max=3.1, e_min=0.0, i_min=0.0):
    return st.tuples(
        st.floats(0.3, 30.0).map(lambda a: a * AU),
        st.floats(e_min, e_max),
        st.floats(i_min, i_max),
        ANGLE,
        ANGLE,
        ANGLE,
    ).map(np.array)


def assert_same_state(actual, expected, rtol=1e-10):
    """Compare relative to distance and speed: components may vanish."""
    distance = np.linalg.norm(expected[..., :3], axis=-1, keepdims=True)
    speed = np.linalg.norm(expected[..., 3:], axis=-1, keepdims=True)
    assert np.all(np.abs(actual[..., :3] - expected[..., :3]) <= rtol * distance)
    assert np.all(np.abs(actual[..., 3:] - expected[..., 3:]) <= rtol * speed)


def assert_same_angle(actual, expected, atol):
    assert abs(np.angle(np.exp(1j * (actual - expected)))) <= atol


@UNTIMED
@given(st.floats(-50.0, 50.0), st.floats(0.0, 1.0, exclude_max=True))
def test_keplers_equation_is_solved_for_every_eccentricity_below_one(mean, e):
    anomaly = mean_to_eccentric(mean, e)
    # M cannot be met better than E is representable, nor than the turns in M are.
    assert abs(anomaly - e * np.sin(anomaly) - mean) <= 4e-15 * max(1.0, abs(mean))


@UNTIMED
@given(ellipses(i_max=np.pi))
def test_a_round_trip_over_classical_elements_returns_the_state(elements):
    state = classical_to_cartesian(elements)
    assert_same_state(classical_to_cartesian(cartesian_to_classical(state)), state, rtol=1e-9)


@UNTIMED
@given(ellipses(e_min=0.01, i_min=0.01, e_max=0.95))
def test_regular_classical_elements_survive_a_round_trip(elements):
    back = cartesian_to_classical(classical_to_cartesian(elements))
    assert_allclose(back[:3], elements[:3], rtol=1e-9, atol=1e-11)
    for column in (3, 4, 5):
        assert_same_angle(back[column], elements[column], atol=1e-8)


@UNTIMED
@given(ellipses(i_max=2.5))
def test_equinoctial_elements_lead_to_the_same_state_as_classical_ones(elements):
    state = classical_to_cartesian(elements)
    equinoctial = classical_to_equinoctial(elements)
    assert_same_state(equinoctial_to_cartesian(equinoctial), state, rtol=1e-9)
    assert_same_state(
        classical_to_cartesian(equinoctial_to_classical(equinoctial)), state, rtol=1e-9
    )


states_of_any_conic = st.tuples(
    st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3),
    st.lists(st.floats(-2.0, 2.0), min_size=3, max_size=3),
).map(lambda rv: np.concatenate([np.array(rv[0]) * AU, np.array(rv[1]) * EARTH_VELOCITY]))


def has_clear_plane(state):
    momentum = np.cross(state[:3], state[3:])
    size = np.linalg.norm(momentum)
    scale = np.linalg.norm(state[:3]) * np.linalg.norm(state[3:])
    return (
        np.linalg.norm(state[:3]) > 0.1 * AU
        and size > 0.05 * scale
        and size > 0.05 * AU * EARTH_VELOCITY
        and momentum[2] > -0.95 * size
    )


@UNTIMED
@given(states_of_any_conic.filter(has_clear_plane))
def test_equinoctial_round_trip_holds_for_hyperbolas_too(state):
    assert_same_state(equinoctial_to_cartesian(cartesian_to_equinoctial(state)), state, rtol=1e-9)


@UNTIMED
@given(states_of_any_conic.filter(has_clear_plane))
def test_equinoctial_elements_agree_with_pykep(state):
    pk = load_pykep()
    expected = np.array(pk.ic2mee([state[:3], state[3:]], MU_SUN))
    actual = cartesian_to_equinoctial(state)
    # pykep goes by way of the classical elements and answers NaN for circles.
    assume(np.isfinite(expected).all() and np.hypot(actual[1], actual[2]) > 1e-3)
    assert_allclose(actual[0], expected[0], rtol=1e-10)
    assert_allclose(actual[1:5], expected[1:5], rtol=1e-9, atol=1e-9)
    assert_same_angle(actual[5], expected[5], atol=1e-9)
    position, velocity = pk.mee2ic(actual, MU_SUN)
    assert_same_state(np.concatenate([position, velocity]), state, rtol=1e-9)


@UNTIMED
@given(ellipses(e_min=0.01, e_max=0.95, i_min=0.01))
def test_classical_elements_agree_with_pykep(elements):
    pk = load_pykep()
    state = classical_to_cartesian(elements)
    true_anomaly = pk.m2f(elements[5], elements[1])
    position, velocity = pk.par2ic([*elements[:5], true_anomaly], MU_SUN)
    assert_same_state(state, np.concatenate([position, velocity]))
    expected = pk.ic2par([state[:3], state[3:]], MU_SUN)
    actual = cartesian_to_classical(state)
    assert_allclose(actual[:3], expected[:3], rtol=1e-9)
    # pykep takes angles from arc cosines, which lose half the digits near 0 and pi.
    for column in (3, 4):
        assert_same_angle(actual[column], expected[column], atol=1e-6)
    assert_same_angle(actual[5], pk.f2m(expected[5], expected[1]), atol=1e-6)


def test_a_circular_orbit_has_zero_argument_of_pericentre_and_counts_from_the_node():
    node, latitude = 1.0, 0.7
    state = classical_to_cartesian([AU, 0.0, 0.3, node, 0.5, latitude - 0.5])
    # A speed that is exactly circular in floating point: e must come out as exactly 0.
    position = np.array([AU, 0.0, 0.0])
    exact = cartesian_to_classical([*position, 0.0, 0.0, 1.0], mu=AU)
    assert exact[1] == 0.0
    assert exact[4] == 0.0
    by_equinoctial = equinoctial_to_classical(
        classical_to_equinoctial([AU, 0.0, 0.3, node, 0.5, latitude - 0.5])
    )
    assert by_equinoctial[4] == pytest.approx(0.0, abs=1e-15)
    assert by_equinoctial[5] == pytest.approx(latitude, abs=1e-14)
    assert_same_state(classical_to_cartesian(by_equinoctial), state, rtol=1e-14)


@pytest.mark.parametrize("inclination", [0.0, np.pi])
def test_an_equatorial_orbit_has_zero_node(inclination):
    # In the plane exactly: sin(pi) is not 0 in floating point.
    state = np.array([AU, 0.0, 0.0, 1e3, np.cos(inclination) * 2.9e4, 0.0])
    elements = cartesian_to_classical(state)
    assert elements[2] == pytest.approx(inclination, abs=1e-15)
    assert elements[3] == 0.0
    assert_same_state(classical_to_cartesian(elements), state, rtol=1e-12)


def test_equatorial_equinoctial_elements_have_zero_node():
    elements = equinoctial_to_classical([AU, 0.1, 0.2, 0.0, 0.0, 1.0])
    assert elements[3] == 0.0
    assert elements[4] == pytest.approx(np.arctan2(0.2, 0.1), abs=1e-15)


@UNTIMED
@given(ellipses())
def test_angles_lie_in_one_turn(elements):
    angles = cartesian_to_classical(classical_to_cartesian(elements))[3:]
    assert np.all((angles >= 0.0) & (angles < 2.0 * np.pi))


def test_rows_are_independent_and_any_leading_shape_is_kept():
    rng = np.random.default_rng(3)
    elements = np.column_stack(
        [rng.uniform(1, 3, 12) * AU, rng.uniform(0, 0.9, 12), *rng.uniform(0, 3, (4, 12))]
    )
    together = classical_to_cartesian(elements)
    one_by_one = np.array([classical_to_cartesian(row) for row in elements])
    assert_allclose(together, one_by_one, rtol=1e-14)
    assert classical_to_cartesian(elements.reshape(3, 4, 6)).shape == (3, 4, 6)


@pytest.mark.parametrize(
    ("convert", "row", "message"),
    [
        (classical_to_cartesian, [AU, 1.2, 0, 0, 0, 0], "row 1.*0 <= e < 1"),
        (classical_to_cartesian, [-AU, 0.2, 0, 0, 0, 0], "row 1.*a > 0"),
        (classical_to_cartesian, [np.nan, 0.2, 0, 0, 0, 0], "row 1.*a > 0"),
        (classical_to_equinoctial, [AU, 0.2, np.pi, 0, 0, 0], "row 1.*180 degrees"),
        (equinoctial_to_classical, [AU, 1.2, 0, 0, 0, 0], "row 1.*bound orbits only"),
        (equinoctial_to_classical, [-AU, 0.2, 0, 0, 0, 0], "row 1.*semilatus"),
        (equinoctial_to_cartesian, [AU, 2.0, 0, 0, 0, np.pi], "row 1.*asymptote"),
        (cartesian_to_classical, [AU, 0, 0, 0, 5e4, 0], "row 1.*bound orbits only"),
        (cartesian_to_classical, [AU, 0, 0, 1e3, 0, 0], "row 1.*bound orbits only"),
        (cartesian_to_equinoctial, [AU, 0, 0, 1e3, 0, 0], "row 1.*straight line"),
        (cartesian_to_equinoctial, [AU, 0, 0, 0, -3e4, 0], "row 1.*180 degrees"),
    ],
)
def test_what_has_no_such_elements_is_refused_with_its_row(convert, row, message):
    good = {
        classical_to_cartesian: [AU, 0.1, 0.1, 0, 0, 0],
        classical_to_equinoctial: [AU, 0.1, 0.1, 0, 0, 0],
        equinoctial_to_classical: [AU, 0.1, 0.1, 0, 0, 0],
        equinoctial_to_cartesian: [AU, 0.1, 0.1, 0, 0, 0],
        cartesian_to_classical: [AU, 0, 0, 0, 3e4, 0],
        cartesian_to_equinoctial: [AU, 0, 0, 0, 3e4, 0],
    }[convert]
    with pytest.raises(InputError, match=message):
        convert([good, row])


def test_a_wrong_shape_is_refused():
    with pytest.raises(InputError, match=r"expected shape \(\.\.\., 6\), got \(5,\)"):
        classical_to_cartesian(np.ones(5))
