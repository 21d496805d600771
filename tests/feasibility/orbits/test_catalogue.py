"""`Catalogue`: construction, look-up, and where the bodies are."""

import pickle
import subprocess
import sys
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from feasibility.constants import AU, DAY_S, MU_SUN
from feasibility.errors import InputError
from feasibility.orbits import Catalogue, classical_to_cartesian, earth, synthetic_main_belt
from feasibility.runtime.pykep_guard import load_pykep

# The first example pays for importing pykep or loading a compiled kernel.
UNTIMED = settings(deadline=None)


def one_body(a_au=2.5, e=0.1, i=0.2, node=1.0, argp=2.0, mean=3.0, epoch=0.0):
    return Catalogue([7], ["body"], epoch, [[a_au * AU, e, i, node, argp, mean]], "test")


@pytest.fixture(scope="module")
def belt():
    return synthetic_main_belt(500, np.random.default_rng(5))


@UNTIMED
@given(
    st.floats(0.3, 30.0),
    st.floats(0.0, 0.999),
    st.floats(0.0, np.pi),
    st.floats(0.0, 6.28),
    st.floats(0.0, 6.28),
    st.floats(-4e4, 4e4),
)
def test_states_agree_with_pykeps_keplerian_planet(a_au, e, i, argp, mean, t_mjd2000):
    pk = load_pykep()
    elements = [a_au * AU, e, i, 1.0, argp, mean]
    planet = pk.planet(
        pk.udpla.keplerian(
            when=pk.epoch(100.0),
            elem=elements,
            mu_central_body=MU_SUN,
            el_type=pk.el_type.KEP_M,
        )
    )
    position, velocity = planet.eph(t_mjd2000)
    state = one_body(a_au, e, i, 1.0, argp, mean, epoch=100.0).states(t_mjd2000)[0]
    # pykep propagates with Lagrange coefficients: where e nears 1, errors in the anomaly
    # grow with the rate at pericentre.
    tolerance = 1e-9 / (1.0 - e) ** 1.5
    assert np.linalg.norm(state[:3] - position) <= tolerance * np.linalg.norm(position)
    assert np.linalg.norm(state[3:] - velocity) <= tolerance * np.linalg.norm(velocity)


@UNTIMED
@given(st.floats(0.0, 1.0, exclude_max=True), st.floats(-10.0, 10.0))
def test_at_the_epoch_of_the_elements_the_state_is_that_of_the_elements(e, mean):
    body = one_body(e=e, mean=mean, epoch=1234.5)
    expected = classical_to_cartesian(body.elements)
    # The state at pericentre of a nearly rectilinear orbit is ill-conditioned in M.
    rtol = 1e-13 / (1.0 - e)
    radius = np.linalg.norm(expected[:, :3])
    assert np.linalg.norm(body.states(1234.5) - expected) <= max(rtol, 1e-13) * (
        radius + np.linalg.norm(expected[:, 3:])
    )


@UNTIMED
@given(st.floats(0.0, 0.999), st.floats(-1e5, 1e5))
def test_energy_and_angular_momentum_are_those_of_the_elements_at_every_epoch(e, t_mjd2000):
    state = one_body(e=e).states(t_mjd2000)[0]
    radius = np.linalg.norm(state[:3])
    energy = state[3:] @ state[3:] / 2 - MU_SUN / radius
    assert abs(energy + MU_SUN / (5.0 * AU)) <= 1e-12 * MU_SUN / radius
    momentum = np.linalg.norm(np.cross(state[:3], state[3:]))
    assert momentum == pytest.approx(np.sqrt(MU_SUN * 2.5 * AU * (1 - e * e)), rel=1e-11)


def test_after_one_period_every_body_is_back(belt):
    rows = np.arange(len(belt))
    start = belt.states(1000.0)
    later = belt.states_at(rows, 1000.0 + belt.period_days)
    assert_allclose(later[:, :3], start[:, :3], atol=1e-9 * AU)


def test_the_period_is_keplers_third_law():
    assert one_body(a_au=1.0).period_days[0] == pytest.approx(
        2 * np.pi * np.sqrt(AU**3 / MU_SUN) / DAY_S, rel=1e-15
    )


def test_states_at_takes_rows_in_any_order_with_repeats_and_own_epochs(belt):
    rows = np.array([7, 3, 7, 499])
    epochs = np.array([0.0, 100.0, -5000.0, 9000.0])
    states = belt.states_at(rows, epochs)
    for row, epoch, state in zip(rows, epochs, states, strict=True):
        assert_array_equal(state, belt.states(epoch)[row])
    assert_array_equal(belt.states_at(rows, 100.0), belt.states(100.0)[rows])
    assert belt.states_at([], 0.0).shape == (0, 6)


def test_rows_of_finds_ids_in_the_order_asked():
    catalogue = Catalogue([30, 10, 20], list("abc"), 0.0, one_body().elements.repeat(3, 0), "x")
    assert_array_equal(catalogue.rows_of([10, 30, 10]), [1, 0, 1])
    assert_array_equal(catalogue.rows_of(20), [2])
    for stranger in (5, 15, 40):
        with pytest.raises(InputError, match=f"id {stranger} is not in x"):
            catalogue.rows_of([10, stranger])


def test_select_keeps_the_order_and_takes_masks(belt):
    chosen = belt.select([5, 2])
    assert_array_equal(chosen.ids, belt.ids[[5, 2]])
    assert chosen.names == (belt.names[5], belt.names[2])
    assert_array_equal(chosen.states(77.0), belt.states(77.0)[[5, 2]])
    mask = belt.ids <= 3
    assert_array_equal(belt.select(mask).ids, [1, 2, 3])
    assert len(belt.select([])) == 0
    with pytest.raises(InputError, match="mask"):
        belt.select(mask[:-1])
    with pytest.raises(InputError, match="more than once"):
        belt.select([1, 1])


def test_a_catalogue_can_be_pickled_small_and_comes_back_equal(belt):
    belt.states(0.0)
    data = pickle.dumps(belt)
    back = pickle.loads(data)
    assert len(data) < 2 * len(pickle.dumps((belt.ids, belt.elements, belt.names)))
    assert_array_equal(back.states(12.0), belt.states(12.0))
    assert back.names == belt.names


def test_further_columns_follow_their_bodies_through_selection_and_pickling():
    mass = np.array([1.0, np.nan, np.inf])
    catalogue = Catalogue(
        [30, 10, 20], list("abc"), 0.0, one_body().elements.repeat(3, 0), "x", {"mass": mass}
    )
    mass[0] = 5.0
    assert_array_equal(catalogue.extra["mass"], [1.0, np.nan, np.inf])
    assert_array_equal(catalogue.select([2, 0]).extra["mass"], [np.inf, 1.0])
    assert_array_equal(catalogue.select(catalogue.ids < 15).extra["mass"], [np.nan])
    back = pickle.loads(pickle.dumps(catalogue))
    assert list(back.extra) == ["mass"]
    assert_array_equal(back.extra["mass"], catalogue.extra["mass"])
    for one in (catalogue, back):
        with pytest.raises(ValueError, match="read-only"):
            one.extra["mass"][0] = 0.0
        with pytest.raises(TypeError):
            one.extra["group"] = np.zeros(3)
        with pytest.raises(ValueError, match="read-only"):
            one.elements[0] = 0.0


@pytest.mark.parametrize(
    ("column", "message"),
    [
        ([1.0, 2.0], r"extra 'mass': expected shape \(1,\), one value an id, got \(2,\)"),
        (1.0, r"extra 'mass': expected shape \(1,\)"),
        (["heavy"], "extra 'mass': expected numbers"),
    ],
)
def test_further_columns_that_do_not_fit_are_refused(column, message):
    with pytest.raises(InputError, match=message):
        Catalogue([7], ["body"], 0.0, one_body().elements, "x", {"mass": column})


def test_catalogues_have_no_further_columns_of_their_own_accord(belt):
    assert dict(belt.extra) == {}
    assert dict(earth().extra) == {}


def test_arrays_are_copied_and_read_only():
    elements = np.array(one_body().elements)
    catalogue = Catalogue([1], ["a"], 0.0, elements, "x")
    elements[0, 0] = np.nan
    assert np.isfinite(catalogue.elements).all()
    with pytest.raises(ValueError, match="read-only"):
        catalogue.elements[0, 0] = 1.0


GOOD = [2.5 * AU, 0.1, 0.2, 1.0, 2.0, 3.0]


@pytest.mark.parametrize(
    ("ids", "names", "epoch", "elements", "message"),
    [
        ([1, 1], ["a", "b"], 0.0, [GOOD, GOOD], "1 occurs more than once"),
        ([1, 2], ["a"], 0.0, [GOOD, GOOD], "1 names, expected 2"),
        ([1, 2], ["a", "b"], 0.0, [GOOD], r"expected shape \(2, 6\)"),
        ([1, 2], ["a", "b"], [0.0, 1.0, 2.0], [GOOD, GOOD], "epoch_mjd2000"),
        ([1.5], ["a"], 0.0, [GOOD], "expected integers"),
        ([1, 2], ["a", "b"], [0.0, np.nan], [GOOD, GOOD], "row 1.*not finite"),
        ([1], ["a"], 0.0, [[*GOOD[:5], np.inf]], "row 0.*not finite"),
        ([1], ["a"], 0.0, [[2.5 * AU, 1.3, *GOOD[2:]]], "row 0.*not an ellipse"),
        ([1], ["a"], 0.0, [[-2.5 * AU, 1.3, *GOOD[2:]]], "row 0.*not an ellipse"),
        ([1], ["a"], 0.0, [[2.5 * AU, -0.1, *GOOD[2:]]], "row 0.*not an ellipse"),
    ],
)
def test_bad_bodies_are_refused(ids, names, epoch, elements, message):
    with pytest.raises(InputError, match=message):
        Catalogue(ids, names, epoch, elements, "x")


def test_bad_queries_are_refused(belt):
    with pytest.raises(InputError, match=r"row 500 is not in .*: expected 0 to 499"):
        belt.states_at([0, 500], 0.0)
    with pytest.raises(InputError, match="row -1"):
        belt.states_at([-1], 0.0)
    with pytest.raises(InputError, match="finite"):
        belt.states(np.nan)
    with pytest.raises(InputError, match="epochs: expected shape"):
        belt.states_at([0, 1, 2], [0.0, 1.0])
    with pytest.raises(InputError, match="states_at"):
        belt.states(np.zeros(2))


def test_the_earth_keeps_to_its_year_and_distance():
    planet = earth()
    assert planet.period_days[0] == pytest.approx(365.25, abs=0.02)
    distance = np.linalg.norm(
        planet.states_at(np.zeros(366, int), np.arange(366.0))[:, :3], axis=1
    )
    assert distance.min() / AU == pytest.approx(0.9833, abs=3e-4)
    assert distance.max() / AU == pytest.approx(1.0167, abs=3e-4)
    # Perihelion is in the first days of January (2000-01-03).
    assert int(np.argmin(distance)) in range(6)


def test_a_catalogue_of_gtoc7s_size_is_propagated_in_well_under_ten_milliseconds():
    belt = synthetic_main_belt(16_256, np.random.default_rng(1))
    belt.states(0.0)
    seconds = []
    for epoch in np.linspace(0.0, 8000.0, 15):
        start = time.perf_counter()
        belt.states(epoch)
        seconds.append(time.perf_counter() - start)
    # The best of many: the machine may be busy with other work.
    assert min(seconds) < 0.010


def test_importing_orbits_loads_neither_numba_nor_pykep():
    code = (
        "import sys, feasibility.orbits; "
        "print({'numba', 'pykep', 'pygmo', 'torch', 'matplotlib'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"
