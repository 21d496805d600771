"""`Spacecraft` and `Legs`: what they refuse, and that selections of rows lose nothing."""

import dataclasses
import pickle
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from feasibility import InputError, Legs, Spacecraft
from feasibility.constants import AU, DAY_S, G0, MU_SUN, YEAR_DAYS

CIRCULAR = (MU_SUN / (2.7 * AU)) ** 0.5
DEPARTURE = [2.7 * AU, 0.0, 0.0, 0.0, CIRCULAR, 0.0]
ARRIVAL = [0.0, 2.7 * AU, 0.0, -CIRCULAR, 0.0, 0.0]
GOOD = {
    "rv_dep": [DEPARTURE, DEPARTURE, DEPARTURE],
    "rv_arr": [ARRIVAL, ARRIVAL, ARRIVAL],
    "tof_days": [400.0, 410.0, 420.0],
    "m0": [2000.0, 1900.0, 1800.0],
    "thrust": 0.3,
    "isp": 3000.0,
    "m_dry": 800.0,
}
NAMES = tuple(field.name for field in dataclasses.fields(Legs))


def second_row(state):
    """Three states, the second of them another one."""
    return [DEPARTURE, state, DEPARTURE]


def moving(metres, metres_per_second):
    return [metres, 0.0, 0.0, 0.0, metres_per_second, 0.0]


def refused(message, **changes):
    with pytest.raises(InputError) as caught:
        Legs(**{**GOOD, **changes})
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ((800, 0.3, [3000, 3000]), "Spacecraft isp: expected one number, got shape (2,)"),
        ((800, "strong", 3000), "Spacecraft thrust: expected a number (could not convert"),
        ((800, 0.3, np.nan), "Spacecraft isp, row 0: nan is not finite"),
        ((np.inf, 0.3, 3000), "Spacecraft m_dry, row 0: inf is not finite"),
        ((-1, 0.3, 3000), "Spacecraft m_dry, row 0: -1 kg, expected zero or more"),
        ((800, 0, 3000), "Spacecraft thrust, row 0: 0 N, expected more than zero"),
        ((800, 0.3, -3000), "Spacecraft isp, row 0: -3000 s, expected more than zero"),
        ((8e7, 0.3, 3000), "m_dry, row 0: 8e+07 kg is beyond 1e+07 kg; is it in g?"),
        ((800, 3000, 3000), "thrust, row 0: 3000 N is beyond 1000 N; is it in mN?"),
        (
            (800, 0.3, 29420),
            "isp, row 0: 29420 s is beyond 20000 s; is it in m/s, an exhaust velocity?",
        ),
    ],
)
def test_a_spacecraft_that_cannot_be_is_refused(values, message):
    with pytest.raises(InputError) as caught:
        Spacecraft(*values)
    assert message in str(caught.value)


def test_a_spacecraft_of_no_dry_mass_is_legal_and_its_numbers_are_floats():
    craft = Spacecraft(m_dry=np.int64(0), thrust=np.array(1), isp=3000)
    assert dataclasses.astuple(craft) == (0.0, 1.0, 3000.0)
    assert all(type(value) is float for value in dataclasses.astuple(craft))
    assert craft.exhaust_velocity == 3000 * G0


@pytest.mark.parametrize("name", ["rv_dep", "rv_arr"])
@pytest.mark.parametrize(
    ("state", "message"),
    [
        ([1.0, 2.0, 3.0], "expected shape (n, 6), position and velocity, got (3,)"),
        (np.ones((2, 3, 6)), "expected shape (n, 6), position and velocity, got (2, 3, 6)"),
        (1.0, "expected shape (n, 6), position and velocity, got ()"),
        ([["x"] * 6], "expected numbers (could not convert string"),
        ([[1.0] * 6, [1.0] * 5], "expected numbers ("),
        (second_row([np.nan, 0, 0, 0, CIRCULAR, 0]), "row 1, component 0: nan is not finite"),
        (second_row([2.7 * AU, 0, 0, 0, np.inf, 0]), "row 1, component 4: inf is not finite"),
        (second_row(moving(0.0, CIRCULAR)), "row 1: distance from the Sun 0 m, expected 1.5e+09"),
        (second_row(moving(2.7, CIRCULAR)), "row 1: distance from the Sun 2.7 m, expected"),
        (second_row(moving(2.7, CIRCULAR)), "to 1.5e+15 m; is it in AU?"),
        (second_row(moving(2.7 * AU / 1e3, CIRCULAR)), "m; is it in km?"),
        (second_row(moving(2e4 * AU, CIRCULAR)), "row 1: distance from the Sun 2.99196e+15 m"),
        (
            second_row(moving(2.7 * AU, CIRCULAR / 1e3)),
            "row 1: speed 18.1264 m/s where a circular",
        ),
        (second_row(moving(2.7 * AU, CIRCULAR / 1e3)), "has 1.813e+04 m/s; is it in km/s?"),
        (second_row(moving(2.7 * AU, CIRCULAR / (AU / DAY_S))), "m/s; is it in AU/day?"),
        (
            second_row(moving(2.7 * AU, CIRCULAR / (AU / DAY_S / YEAR_DAYS))),
            "m/s; is it in AU/year?",
        ),
        (second_row(moving(2.7 * AU, 0.0)), "row 1: speed 0 m/s where a circular orbit"),
        (second_row(moving(2.7 * AU, 3e6)), "row 1: speed 3e+06 m/s where a circular orbit"),
    ],
)
def test_states_that_cannot_be_are_refused_with_the_unit_that_was_probably_meant(
    name, state, message
):
    refused(f"Legs {name}", **{name: state})
    refused(message, **{name: state})


@pytest.mark.parametrize("state", [moving(2e4 * AU, CIRCULAR), moving(2.7 * AU, 3e6)])
def test_no_unit_is_guessed_where_none_fits(state):
    with pytest.raises(InputError) as caught:
        Legs(**{**GOOD, "rv_dep": state})
    assert "is it in" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("tof_days", [[1.0]], "Legs tof_days: expected shape (n,), got (1, 1)"),
        ("m0", "heavy", "Legs m0: expected numbers (could not convert string"),
        ("m0", [1.0, 2.0], "Legs m0: 2 rows, but rv_dep has 3; expected the same or one"),
        ("dep_id", [1, 2], "Legs dep_id: 2 rows, but rv_dep has 3; expected the same or one"),
        ("dep_id", "Vesta", "Legs dep_id: expected numbers (invalid literal"),
        ("t_dep_mjd2000", [0.0, np.nan, 0.0], "Legs t_dep_mjd2000, row 1: nan is not finite"),
        ("tof_days", [400.0, np.inf, 1.0], "Legs tof_days, row 1: inf is not finite"),
        ("tof_days", [400.0, 0.0, 1.0], "Legs tof_days, row 1: 0 days, expected more than zero"),
        (
            "tof_days",
            400 * DAY_S,
            "Legs tof_days, row 0: 3.456e+07 days is beyond 100000 days; is it in seconds?",
        ),
        ("thrust", np.nan, "Legs thrust, row 0: nan is not finite"),
        ("thrust", -0.3, "Legs thrust, row 0: -0.3 N, expected more than zero"),
        ("thrust", 3e3, "Legs thrust, row 0: 3000 N is beyond 1000 N; is it in mN?"),
        ("isp", 0.0, "Legs isp, row 0: 0 s, expected more than zero"),
        ("isp", 3000 * G0, "is beyond 20000 s; is it in m/s, an exhaust velocity?"),
        ("m0", [2000.0, 1900.0, np.nan], "Legs m0, row 2: nan is not finite"),
        ("m0", 0.0, "Legs m0, row 0: 0 kg, expected more than zero"),
        ("m0", 2e7, "Legs m0, row 0: 2e+07 kg is beyond 1e+07 kg; is it in g?"),
        ("m0", [2000.0, 700.0, 600.0], "Legs m0, row 1: 700 kg is below the dry mass of 800 kg"),
        ("m_dry", np.nan, "Legs m_dry, row 0: nan is not finite"),
        ("m_dry", -1.0, "Legs m_dry, row 0: -1 kg, expected zero or more"),
        ("m_dry", 8e7, "Legs m_dry, row 0: 8e+07 kg is beyond 1e+07 kg; is it in g?"),
    ],
)
def test_columns_that_cannot_be_are_refused_with_the_row_and_the_unit_meant(name, value, message):
    refused(message, **{name: value})


def test_other_masses_are_checked_as_the_first_were():
    legs = Legs(**GOOD)
    for mass, message in (
        ([2000.0, 1900.0], "Legs m0: 2 rows, expected 3 or one"),
        ([[2000.0]], "Legs m0: expected shape (n,), got (1, 1)"),
        (700.0, "row 0: 700 kg is below the dry mass of 800 kg"),
        ([900.0, np.nan, 900.0], "row 1: nan is not finite"),
    ):
        with pytest.raises(InputError) as caught:
            legs.with_m0(mass)
        assert message in str(caught.value)


def test_no_part_at_all_is_refused():
    with pytest.raises(InputError, match="expected at least one part, got none"):
        Legs.concatenate([])


@st.composite
def some_legs(draw, named=None):
    """0 to 6 legs, with epochs and ids or without."""
    if named is None:
        named = draw(st.booleans())
    n = draw(st.integers(0, 6))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    radius = rng.uniform(0.5, 5.0, (2, n)) * AU
    angle = rng.uniform(0.0, 2.0 * np.pi, (2, n))
    speed = np.sqrt(MU_SUN / radius)
    flat = np.zeros((2, n))
    along, across = np.cos(angle), np.sin(angle)
    states = np.stack(
        [radius * along, radius * across, flat, -speed * across, speed * along, flat], axis=2
    )
    # Heavy enough for the thrust: nobody should ask whether it is in mN.
    m_dry = rng.uniform(200.0, 1000.0, n)
    more = {
        "t_dep_mjd2000": rng.uniform(0.0, 1e4, n),
        "dep_id": rng.integers(1, 99, n),
        "arr_id": rng.integers(1, 99, n),
    }
    return Legs(
        rv_dep=states[0],
        rv_arr=states[1],
        tof_days=rng.uniform(1.0, 1000.0, n),
        m0=m_dry + rng.uniform(1.0, 1000.0, n),
        thrust=rng.uniform(0.1, 1.0, n),
        isp=rng.uniform(1000.0, 5000.0, n),
        m_dry=m_dry,
        **(more if named else {}),
    )


def assert_same(legs, expected, but=()):
    assert len(legs) == len(expected)
    for name in NAMES:
        one, other = getattr(legs, name), getattr(expected, name)
        if name in but:
            continue
        if other is None:
            assert one is None
        else:
            assert_array_equal(one, other)
            assert one.dtype == other.dtype


@given(some_legs(), st.data())
def test_parts_put_together_are_the_whole(legs, data):
    cuts = sorted(data.draw(st.lists(st.integers(0, len(legs)), max_size=3)))
    bounds = [0, *cuts, len(legs)]
    parts = [legs.take(range(a, b)) for a, b in pairwise(bounds)]
    assert_same(Legs.concatenate(parts), legs)


@given(some_legs(), st.data())
def test_rows_are_taken_in_the_order_asked_repeats_included(legs, data):
    order = data.draw(st.permutations(range(len(legs))))
    assert_same(legs.take(order).take(np.argsort(order)), legs)
    twice = np.repeat(np.arange(len(legs)), 2)
    assert_same(legs.take(twice).take(range(0, 2 * len(legs), 2)), legs)
    mask = np.array(data.draw(st.lists(st.booleans(), min_size=len(legs), max_size=len(legs))))
    mask = mask.astype(bool)
    assert_same(legs.take(mask), legs.take(np.flatnonzero(mask)))
    first = data.draw(st.integers(0, len(legs)))
    assert_same(legs.take(slice(first, None)), legs.take(np.arange(first, len(legs))))


@given(some_legs(), st.floats(1000.0, 5000.0))
def test_other_masses_change_the_masses_alone(legs, mass):
    heavier = legs.with_m0(mass)
    assert_array_equal(heavier.m0, np.full(len(legs), mass))
    assert_same(heavier, legs, but=("m0",))
    assert_same(heavier.with_m0(legs.m0), legs)


@given(some_legs(named=True), some_legs(named=False))
def test_columns_that_a_part_lacks_are_missing_in_the_whole(named, nameless):
    both = Legs.concatenate([named, nameless])
    assert both.dep_id is both.arr_id is both.t_dep_mjd2000 is None
    assert len(both) == len(named) + len(nameless)
    assert_same(both.take(range(len(named))), named, but=("t_dep_mjd2000", "dep_id", "arr_id"))


@given(some_legs())
def test_legs_survive_pickling_and_their_columns_cannot_be_written(legs):
    assert_same(pickle.loads(pickle.dumps(legs)), legs)
    for taken in (
        legs,
        legs.take(range(len(legs))),
        Legs.concatenate([legs]),
        legs.with_m0(5000.0),
    ):
        for name in NAMES:
            column = getattr(taken, name)
            assert column is None or not column.flags.writeable


def test_numbers_and_single_rows_count_for_every_leg_and_are_copied():
    tof_days = np.array([400.0, 410.0])
    legs = Legs(DEPARTURE, [ARRIVAL], tof_days, 2000, 0.3, 3000, 0, dep_id=7)
    tof_days[0] = -1.0
    assert repr(legs) == "Legs(n=2)"
    assert legs.rv_dep.shape == legs.rv_arr.shape == (2, 6)
    assert legs.dep_id.tolist() == [7, 7]
    assert legs.m_dry.tolist() == [0.0, 0.0]
    assert legs.tof_s.tolist() == [400 * DAY_S, 410 * DAY_S]
    assert legs.exhaust_velocity.tolist() == [3000 * G0, 3000 * G0]
    assert len(legs.take([])) == 0


def test_ends_are_those_of_a_rendezvous_unless_given_and_travel_with_the_legs():
    assert not Legs(**GOOD).free_ends.any()
    legs = Legs(**GOOD, vinf_dep=[0.0, 5.0, 3000.0], vinf_arr=np.inf)
    np.testing.assert_array_equal(legs.vinf_dep, [0.0, 5.0, 3000.0])
    np.testing.assert_array_equal(legs.take([2, 1]).vinf_dep, [3000.0, 5.0])
    both = Legs.concatenate([legs.take([1]), Legs(**GOOD)])
    np.testing.assert_array_equal(both.vinf_arr, [np.inf, 0.0, 0.0, 0.0])
    np.testing.assert_array_equal(both.free_ends, [True, False, False, False])
    assert legs.with_m0(1500.0).vinf_arr[0] == np.inf


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (-1.0, "row 0: -1 m/s, expected zero or more, or inf"),
        ([0.0, np.nan, 0.0], "row 1: nan m/s, expected zero or more, or inf"),
        ([0.0, 0.0, 3.5], "row 2: 3.5 m/s is the largest excess velocity, expected 0, or 20 m/s"),
        (6.0, "is it in km/s?"),
        (1e6, "row 0: 1e+06 m/s is beyond 300000 m/s; expected inf for any speed"),
    ],
)
def test_excess_velocities_that_cannot_be_are_refused(values, message):
    for name in ("vinf_dep", "vinf_arr"):
        refused(message, **{name: values})
        refused(f"Legs {name}", **{name: values})
