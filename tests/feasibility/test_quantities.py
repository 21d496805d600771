"""Quantities that carry units, and thrusts that are evidently in mN."""

import numpy as np
import pytest

from feasibility import InputError, Legs, Spacecraft
from feasibility.constants import AU
from feasibility.orbits import Catalogue

GOOD = {
    "rv_dep": [4e11, 0, 0, 0, 1.8e4, 0],
    "rv_arr": [0, 4.1e11, 0, -1.8e4, 0, 0],
    "tof_days": 400.0,
    "m0": 2000.0,
    "thrust": 0.3,
    "isp": 3000.0,
    "m_dry": 800.0,
}
FACTORS = {
    "kg": {"t": 1e3, "kg": 1.0},
    "N": {"mN": 1e-3, "N": 1.0},
    "day": {"h": 1 / 24, "day": 1.0},
    "s": {"s": 1.0},
    "m": {"km": 1e3, "m": 1.0},
    "m/s": {"km/s": 1e3},
    "rad": {"deg": np.pi / 180.0},
    "": {"": 1.0},
}


class LikeAstropy:
    """A number or an array with a unit."""

    def __init__(self, value, unit):
        self.value, self.unit = value, unit
        if np.ndim(value):
            self.ndim = np.ndim(value)

    def to_value(self, unit):
        return np.multiply(self.value, FACTORS[unit][self.unit])

    def __float__(self):
        raise TypeError("only dimensionless scalar quantities can be converted")


class LikePint:
    """Numpy takes its number without a word about the unit, as it does of pint's."""

    def __init__(self, magnitude, units):
        self.magnitude, self.units = magnitude, units

    def to(self, unit):
        return LikePint(np.multiply(self.magnitude, FACTORS[unit][self.units]), unit)

    def __array__(self, dtype=None, copy=None):
        return np.asarray(self.magnitude, dtype)


def legs(**changes):
    return Legs(**{**GOOD, **changes})


@pytest.mark.parametrize("quantity", [LikeAstropy, LikePint])
def test_quantities_are_converted(quantity):
    made = legs(
        tof_days=quantity(9600.0, "h"),
        m0=quantity(np.array([2.0, 1.9]), "t"),
        thrust=[quantity(300.0, "mN"), 0.2],
        m_dry=quantity(0.8, "t"),
        t_dep_mjd2000=quantity(240.0, "h"),
    )
    np.testing.assert_allclose(made.tof_days, 400.0)
    np.testing.assert_allclose(made.m0, [2000.0, 1900.0])
    np.testing.assert_allclose(made.thrust, [0.3, 0.2])
    np.testing.assert_allclose(made.m_dry, 800.0)
    np.testing.assert_allclose(made.t_dep_mjd2000, 10.0)
    np.testing.assert_allclose(made.with_m0(quantity(1.5, "t")).m0, 1500.0)
    craft = Spacecraft(quantity(0.8, "t"), quantity(300.0, "mN"), quantity(3000.0, "s"))
    assert craft == Spacecraft(800.0, 0.3, 3000.0)


@pytest.mark.parametrize("quantity", [LikeAstropy, LikePint])
def test_states_are_converted_entry_by_entry(quantity):
    row = [quantity(4e8, "km"), quantity(0, "m"), quantity(0, "m")]
    row += [quantity(0, "km/s"), quantity(18.0, "km/s"), quantity(0, "km/s")]
    np.testing.assert_allclose(legs(rv_dep=row).rv_dep, legs().rv_dep)
    np.testing.assert_allclose(legs(rv_dep=[row, row]).rv_dep, legs(tof_days=[1, 2]).rv_dep)


@pytest.mark.parametrize("quantity", [LikeAstropy, LikePint])
@pytest.mark.parametrize(
    ("column", "value", "unit", "message"),
    [
        ("m0", 2.0, "s", r"Legs m0: has a unit \(s\) that cannot be converted; .* kg$"),
        ("isp", 30.0, "km/s", r"Legs isp: has a unit \(km/s\) .* plain numbers in s$"),
        ("rv_dep", np.ones(6), "m", r"Legs rv_dep: has a unit \(m\); .* in m and m/s$"),
        ("dep_id", 3, "m", r"Legs dep_id: has a unit \(m\); expected plain numbers$"),
    ],
)
def test_a_unit_that_does_not_fit_is_named(quantity, column, value, unit, message):
    with pytest.raises(InputError, match=message):
        legs(**{column: quantity(value, unit)})


SLIPS = {
    "position in AU": ({"rv_dep": [2.7, 0, 0, 0, 1.8e4, 0]}, r"rv_dep, row 0: .*is it in AU\?"),
    "position in km": ({"rv_arr": [0, 4e8, 0, -1.8e4, 0, 0]}, r"rv_arr, row 0: .*is it in km\?"),
    "velocity in km/s": ({"rv_dep": [4e11, 0, 0, 0, 18, 0]}, r"is it in km/s\?"),
    "velocity in AU/day": ({"rv_dep": [4e11, 0, 0, 0, 0.0104, 0]}, r"is it in AU/day\?"),
    "time in seconds": ({"tof_days": 3.5e7}, r"Legs tof_days, row 0: .*is it in seconds\?"),
    "thrust in mN": ({"thrust": 300.0}, r"row 0: 300 N on 2000 kg is 0.15 m/s2.*is it in mN\?"),
    "one thrust in mN": ({"thrust": [0.3, 300]}, r"row 1: 300 N on 2000 kg .*is it in mN\?"),
    "a small thrust in mN": ({"thrust": 25.0}, r"25 N on 2000 kg .*is it in mN\?"),
    "masses in t": ({"m0": 2, "m_dry": 0.8}, r"0.3 N on 2 kg is 0.15 m/s2.*the mass in t\?"),
    "exhaust velocity": ({"isp": 29420}, r"Legs isp.*an exhaust velocity\?"),
    "mass in g": ({"m0": 2e8}, r"Legs m0.*is it in g\?"),
    "wet below dry": ({"m0": 700}, "Legs m0, row 0: 700 kg is below the dry mass of 800 kg"),
    "nan": ({"m0": [2000, np.nan]}, "Legs m0, row 1: nan is not finite"),
    "negative": ({"thrust": -0.3}, "Legs thrust, row 0: -0.3 N, expected more than zero"),
    "masked": ({"m0": np.ma.array([1e3, 2e3], mask=[True, False])}, "m0: has masked entries"),
    "time span": ({"tof_days": np.timedelta64(400, "h")}, "Legs tof_days: dates or time spans"),
    "complex": ({"m0": np.array([2000 + 1j])}, "Legs m0: complex numbers"),
    "words": ({"m0": "heavy"}, "Legs m0: expected numbers"),
    "nothing": ({"m0": None}, "Legs m0: is None"),
    "too large": ({"dep_id": 2**70}, "Legs dep_id: expected numbers"),
    "lengths": ({"m0": [2e3, 2e3], "thrust": [0.3] * 3}, "Legs thrust: 3 rows, but m0 has 2"),
    "state of five": ({"rv_dep": [4e11, 0, 0, 0, 1.8e4]}, r"expected shape \(n, 6\)"),
}


@pytest.mark.parametrize("slip", SLIPS)
def test_a_slip_is_named_with_column_and_row(slip):
    changes, message = SLIPS[slip]
    with pytest.raises(InputError, match=message) as caught:
        legs(**changes)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("thrust", "mass"), [(5.4, 2000.0), (0.0011, 12.0), (0.236, 650.0), (1e-5, 0.1)]
)
def test_true_spacecraft_pass(thrust, mass):
    legs(thrust=thrust, m0=mass, m_dry=0.4 * mass)
    Spacecraft(0.4 * mass, thrust, 3000.0)


def test_a_spacecrafts_thrust_is_compared_with_its_dry_mass():
    with pytest.raises(InputError, match=r"Spacecraft thrust: 300 N on 800 kg .*in mN\?"):
        Spacecraft(800.0, 300.0, 3000.0)
    with pytest.raises(InputError, match="Spacecraft isp: expected one number"):
        Spacecraft(800.0, 0.3, [3000.0, 2000.0])
    with pytest.raises(InputError, match="Spacecraft isp: expected a number"):
        Spacecraft(800.0, 0.3, "fast")
    # Without a dry mass there is nothing to compare with.
    assert Spacecraft(0.0, 0.3, 3000.0).m_dry == 0.0


def test_plain_numbers_are_as_they_were():
    made = legs(rv_dep=[[4 * AU, 0, 0, 0, 1.5e4, 0]] * 3, tof_days=np.array([1, 2, 3]))
    assert len(made) == 3
    assert made.tof_days.dtype == np.float64


def body(**changes):
    given = {
        "ids": [7],
        "names": ["A"],
        "epoch_mjd2000": 8000.0,
        "elements": [[2.0 * AU, 0.1, 0.05, 1.0, 2.0, 3.0]],
        "source": "a test",
    }
    return Catalogue(**{**given, **changes})


@pytest.mark.parametrize("quantity", [LikeAstropy, LikePint])
def test_elements_of_catalogues_are_converted(quantity):
    angles = [quantity(value, "deg") for value in (3.0, 60.0, 120.0, 180.0)]
    row = [quantity(3e8, "km"), quantity(0.1, ""), *angles]
    made = body(elements=[row, row], ids=[1, 2], names=["A", "B"])
    wanted = [3e11, 0.1, *np.radians([3.0, 60.0, 120.0, 180.0])]
    np.testing.assert_allclose(made.elements, [wanted, wanted])
    mixed = [3e11, 0.1, angles[0], 1.0, 2.0, 3.0]
    assert body(elements=[mixed]).elements[0, 2] == pytest.approx(np.radians(3.0))
    assert body(epoch_mjd2000=quantity(48000.0, "h")).epoch_mjd2000[0] == 2000.0


@pytest.mark.parametrize("quantity", [LikeAstropy, LikePint])
def test_elements_whose_units_would_be_dropped_are_refused(quantity):
    plain = body().elements
    with pytest.raises(InputError, match=r"Catalogue elements: has a unit \(km\)"):
        body(elements=quantity(plain, "km"))
    with pytest.raises(InputError, match=r"Catalogue elements: .*expected plain numbers in m$"):
        body(elements=[[quantity(1.0, "kg"), *plain[0, 1:]]])
    with pytest.raises(InputError, match=r"Catalogue extra 'mass': has a unit \(kg\)"):
        body(extra={"mass": quantity([1.0], "kg")})
    with pytest.raises(InputError, match=r"Catalogue elements: expected numbers"):
        body(elements=[["far", 0, 0, 0, 0, 0]])
