"""Lambert and MIMA on legs whose end points do not tell the plane or the sense of rotation."""

import numpy as np
import pytest

from feasibility import LambertPruner, Legs, Mima2Pruner, MimaPruner, max_initial_mass
from feasibility.constants import AU, DAY_S, EARTH_VELOCITY, MU_SUN
from feasibility.orbits import OrbitalNeighbours, synthetic_main_belt
from feasibility.orbits.lambert import lambert_delta_v
from feasibility.orbits.mima import mima, mima2
from feasibility.orbits.transfer_plane import along_departure, levelled_targets

RADIUS = 2.6 * AU
SPEED = EARTH_VELOCITY / np.sqrt(2.6)
PRUNERS = [LambertPruner(1.3), MimaPruner(), Mima2Pruner()]


def circular_leg(angle_deg: float, up_deg: float = 0.0, tof_days: float = 0.0) -> Legs:
    """Return a leg between circular orbits, its target out of the plane by `up_deg`."""
    angle, up = np.radians([angle_deg, up_deg])
    outer, slower = 1.02 * RADIUS, SPEED / np.sqrt(1.02)
    if not tof_days:
        tof_days = angle / (SPEED / RADIUS) / DAY_S
    return Legs(
        rv_dep=[RADIUS, 0, 0, 0, SPEED, 0],
        rv_arr=[
            *(outer * np.cos(angle) * np.cos(up), outer * np.sin(angle) * np.cos(up)),
            *(outer * np.sin(up), -slower * np.sin(angle), slower * np.cos(angle), 0),
        ],
        tof_days=tof_days,
        m0=2000.0,
        thrust=0.3,
        isp=3000.0,
        m_dry=800.0,
    )


def turned(legs: Legs, matrix: np.ndarray) -> Legs:
    """Return the legs with all vectors multiplied by an orthogonal matrix."""
    states = [
        np.concatenate([rv[:, :3] @ matrix.T, rv[:, 3:] @ matrix.T], axis=1)
        for rv in (legs.rv_dep, legs.rv_arr)
    ]
    return Legs(*states, legs.tof_days, legs.m0, legs.thrust, legs.isp, legs.m_dry)


def belt_legs(n: int) -> Legs:
    rng = np.random.default_rng(4)
    belt = synthetic_main_belt(1000, rng)
    rows = rng.integers(len(belt), size=n)
    t, tof = rng.uniform(8000.0, 12000.0, n), rng.uniform(60.0, 900.0, n)
    near = OrbitalNeighbours(belt).query(rows, t, 3)[:, 2]
    states = belt.states_at(rows, t), belt.states_at(near, t + tof)
    return Legs(*states, tof, 1500.0, 0.3, 3000.0, 500.0)


def cosine_of_angle(legs: Legs) -> np.ndarray:
    start, end = legs.rv_dep[:, :3], legs.rv_arr[:, :3]
    sizes = np.linalg.norm(start, axis=1) * np.linalg.norm(end, axis=1)
    return np.einsum("ij,ij->i", start, end) / sizes


def estimates(legs: Legs) -> np.ndarray:
    """Return (3, n): Lambert's delta-v, MIMA, MIMA2."""
    states = legs.rv_dep, legs.rv_arr, legs.tof_s
    engine = legs.thrust, legs.exhaust_velocity
    return np.stack([lambert_delta_v(*states), mima(*states, *engine), mima2(*states, *engine)])


@pytest.mark.parametrize(
    "matrix",
    [
        np.diag([1.0, -1.0, 1.0]),
        np.diag([1.0, 1.0, -1.0]),
        np.diag([-1.0, 1.0, -1.0]),
        np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]]),
        np.array([[0.0, 0, 1], [0, 1, 0], [1, 0, 0]]),
    ],
    ids=["retrograde", "below", "upside-down", "polar", "polar-backward"],
)
def test_estimates_do_not_depend_on_where_the_orbit_stands(matrix):
    legs = belt_legs(300)
    legs = legs.take(np.abs(cosine_of_angle(legs)) < np.cos(np.radians(12.0)))
    expected, found = estimates(legs), estimates(turned(legs, matrix))
    # MIMA2 may find another switching time on arcs that are far too expensive.
    close = np.isclose(found, expected, rtol=1e-6)
    assert close.mean(axis=1).min() > 0.99


def test_flyable_retrograde_and_half_turn_legs_are_kept():
    for leg in (
        circular_leg(90.0),
        turned(circular_leg(90.0), np.diag([1.0, -1.0, 1.0])),
        circular_leg(180.0),
        circular_leg(180.0, up_deg=1.0),
        circular_leg(179.5, up_deg=-1.0),
        turned(circular_leg(180.0), np.diag([-1.0, 1.0, -1.0])),
        circular_leg(360.0),
    ):
        assert max_initial_mass(leg)[0] > leg.m0[0]
        for pruner in PRUNERS:
            assert pruner.keep(leg).all(), (pruner.name, leg.rv_arr)


def test_at_180_degrees_the_estimates_are_those_just_before():
    np.testing.assert_allclose(
        estimates(circular_leg(180.0)), estimates(circular_leg(179.99)), rtol=1e-2
    )


def test_legs_that_cannot_be_flown_are_still_dropped():
    for leg in (
        circular_leg(180.0, tof_days=100.0),
        turned(circular_leg(90.0, tof_days=100.0), np.diag([1.0, -1.0, 1.0])),
        circular_leg(3.0, up_deg=3.0, tof_days=40.0),
    ):
        assert max_initial_mass(leg)[0] < leg.m0[0]
        for pruner in PRUNERS:
            assert not pruner.keep(leg).any(), (pruner.name, leg.rv_arr)


def test_ordinary_prograde_legs_are_not_touched():
    legs = belt_legs(2000)
    targets = levelled_targets(legs.rv_dep, legs.rv_arr, legs.tof_s, MU_SUN)
    changed = (targets != legs.rv_arr).any(axis=1)
    assert 0 < changed.mean() < 0.05
    start, end = along_departure(legs.rv_dep, legs.rv_arr)
    changed |= (start != legs.rv_dep).any(axis=1)
    assert changed.mean() < 0.05
    assert (np.abs(cosine_of_angle(legs)[changed]) > np.cos(np.radians(10.1))).all()
    np.testing.assert_array_equal(end[~changed], legs.rv_arr[~changed])


def test_a_levelled_target_keeps_its_distance_and_speed_and_lies_in_the_plane():
    leg = circular_leg(178.0, up_deg=3.0)
    target = levelled_targets(leg.rv_dep, leg.rv_arr, leg.tof_s, MU_SUN)[0]
    momentum = np.cross(leg.rv_dep[0, :3], leg.rv_dep[0, 3:])
    assert abs(target[:3] @ momentum) < 1e-12 * np.linalg.norm(momentum) * RADIUS
    for part in (slice(0, 3), slice(3, 6)):
        before = np.linalg.norm(leg.rv_arr[0, part])
        assert np.linalg.norm(target[part]) == pytest.approx(before, rel=1e-12)


def test_legs_of_bodies_that_fall_straight_have_no_plane_and_do_no_harm():
    leg = Legs(
        [RADIUS, 0, 0, SPEED, 0, 0], [-RADIUS, 0, 0, SPEED, 0, 0], 800.0, 900.0, 0.3, 3e3, 1
    )
    assert np.isinf(lambert_delta_v(leg.rv_dep, leg.rv_arr, leg.tof_s)).all()
    for pruner in PRUNERS:
        assert not pruner.keep(leg).any()
