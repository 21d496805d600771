"""Minimum propellant of legs that are many times lighter than m*, by every solver."""

import numpy as np
import pytest

from feasibility import Legs, optimise
from feasibility.constants import AU, DAY_S, EARTH_VELOCITY, MU_SUN
from feasibility.orbits import classical_to_cartesian
from feasibility.orbits.lambert import lambert_delta_v
from feasibility.sims_flanagan import Status, solve_max_initial_mass
from feasibility.sims_flanagan.fast.solver import fast_max_initial_mass, fast_min_propellant
from feasibility.sims_flanagan.light_legs import are_light
from feasibility.sims_flanagan.solutions import TWO_IMPULSE
from tests.helpers.long_legs import long_legs


def waiting_leg() -> Legs:
    """Return a leg that is best flown as a Hohmann transfer after a long wait."""
    inner, outer = 2.4 * AU, 2.6 * AU
    motions = np.sqrt(MU_SUN / np.array([inner, outer]) ** 3)
    hohmann = np.pi * np.sqrt((0.5 * (inner + outer)) ** 3 / MU_SUN)
    wait = 700.0 * DAY_S
    angle = motions[0] * wait + np.pi + motions[1] * 300.0 * DAY_S
    speeds = EARTH_VELOCITY * np.sqrt(AU / np.array([inner, outer]))
    return Legs(
        rv_dep=[inner, 0, 0, 0, speeds[0], 0],
        rv_arr=[
            *(outer * np.cos(angle), outer * np.sin(angle), 0),
            *(-speeds[1] * np.sin(angle), speeds[1] * np.cos(angle), 0),
        ],
        tof_days=(wait + hohmann) / DAY_S + 300.0,
        m0=500.0,
        thrust=0.6,
        isp=4000.0,
        m_dry=0.0,
    )


@pytest.mark.parametrize("method", ["fast", "reference", "best"])
def test_a_light_leg_waits_for_its_hohmann_transfer(method):
    leg = waiting_leg()
    r1, r2 = 2.4 * AU, 2.6 * AU
    mean = 0.5 * (r1 + r2)
    hohmann = np.sqrt(MU_SUN / r1) * (np.sqrt(r2 / mean) - 1)
    hohmann += np.sqrt(MU_SUN / r2) * (1 - np.sqrt(r1 / mean))
    least = leg.m0[0] * -np.expm1(-hohmann / leg.exhaust_velocity[0])
    burnt = leg.m0[0] - optimise(leg, method=method).m_final[0]
    # Finite thrust and impulses at the segments' centres cost a little.
    assert least * 0.999 < burnt < 1.1 * least


def test_propellant_per_mass_falls_with_the_mass_however_light_a_leg_is():
    legs = long_legs(20, seed=5)
    heaviest = fast_max_initial_mass(legs)
    flown = heaviest.converged
    legs, heaviest = legs.take(flown), heaviest.take(flown)
    before = np.full(len(legs), np.inf)
    for ratio in (2.0, 6.0, 20.0, 60.0, 200.0):
        light = legs.with_m0(heaviest.m0 / ratio)
        solved = fast_min_propellant(light, guess=heaviest)
        assert solved.converged.all()
        share = 1.0 - solved.m_final / light.m0
        # A lighter spacecraft can fly whatever a heavier one flies.
        assert (share <= before * 1.01).all()
        before = share


def test_other_arcs_win_on_some_light_legs_and_never_lose():
    legs = long_legs(40, seed=8)
    heaviest = fast_max_initial_mass(legs)
    legs = legs.take(heaviest.converged)
    heaviest = heaviest.take(heaviest.converged)
    solved = fast_min_propellant(legs.with_m0(heaviest.m0 / 30.0), guess=heaviest)
    assert solved.converged.all()
    won = solved.start >= TWO_IMPULSE
    assert won.any()
    assert not won.all()


def test_the_reference_is_not_far_from_the_fast_solver_on_light_legs():
    legs = long_legs(4, seed=3)
    heaviest = fast_max_initial_mass(legs)
    light = legs.with_m0(heaviest.m0 / 20.0)
    fast = optimise(light, guess=heaviest)
    reference = optimise(light, method="reference", guess=heaviest)
    best = optimise(light, method="best", guess=heaviest)
    assert best.converged.all()
    np.testing.assert_array_equal(best.m_final, np.maximum(fast.m_final, reference.m_final))
    np.testing.assert_allclose(light.m0 - fast.m_final, light.m0 - reference.m_final, rtol=0.02)


def test_legs_near_their_maximum_mass_keep_to_its_arc():
    legs = long_legs(6, seed=4)
    heaviest = fast_max_initial_mass(legs)
    solved = fast_min_propellant(legs.with_m0(heaviest.m0 / 2.0), guess=heaviest)
    np.testing.assert_array_equal(solved.start, heaviest.start)


def test_retrograde_and_half_turn_legs_cost_as_much_as_their_lambert_arcs_suggest():
    radius, speed = 2.7 * AU, EARTH_VELOCITY / np.sqrt(2.7)
    prograde = Legs(
        rv_dep=[radius, 0, 0, 0, speed, 0],
        rv_arr=[0, 1.02 * radius, 0, -speed, 0, 0],
        tof_days=430.0,
        m0=300.0,
        thrust=0.6,
        isp=4000.0,
        m_dry=0.0,
    )
    mirror = np.array([1.0, -1.0, 1.0, 1.0, -1.0, 1.0])
    retrograde = Legs(
        rv_dep=prograde.rv_dep * mirror,
        rv_arr=prograde.rv_arr * mirror,
        tof_days=430.0,
        m0=300.0,
        thrust=0.6,
        isp=4000.0,
        m_dry=0.0,
    )
    for method in ("fast", "reference"):
        masses = [optimise(leg, method=method).m_final[0] for leg in (prograde, retrograde)]
        assert masses[0] == pytest.approx(masses[1], rel=1e-4)
    impulsive = lambert_delta_v(prograde.rv_dep, prograde.rv_arr, prograde.tof_s)[0]
    spent = -prograde.exhaust_velocity[0] * np.log(masses[0] / 300.0)
    assert spent < 1.5 * impulsive


def test_the_reference_returns_a_row_where_the_end_points_give_no_sense_of_rotation():
    radius, speed = 2.7 * AU, EARTH_VELOCITY / np.sqrt(2.7)
    states = [radius, 0, 0, 0, speed, 0], [-radius, 0, 0.03 * AU, 0, -speed, 0]
    leg = Legs(*states, 800.0, 500.0, 0.3, 3000.0, 0.0)
    fast = solve_max_initial_mass(leg)
    reference = solve_max_initial_mass(leg, method="reference")
    assert reference.converged.all()
    np.testing.assert_allclose(reference.m0, fast.m0, rtol=0.01)


def test_long_legs_of_less_than_half_their_maximum_mass_try_other_arcs():
    rng = np.random.default_rng(3)
    n = 40
    orbits = np.zeros((2, n, 6))
    orbits[..., 0] = AU * np.array([1.0, 1.2])[:, None] * rng.uniform(0.9, 1.2, (2, n))
    orbits[..., 1] = rng.uniform(0.0, 0.3, (2, n))
    orbits[..., 2] = np.radians(rng.uniform(0.0, 6.0, (2, n)))
    orbits[..., 3:] = rng.uniform(0.0, 2 * np.pi, (2, n, 3))
    ends = (classical_to_cartesian(half) for half in orbits)
    legs = Legs(*ends, rng.uniform(500.0, 1200.0, n), 100.0, 0.3, 3500.0, 0.0)
    heaviest = fast_max_initial_mass(legs)
    assert heaviest.converged.all()
    lighter = legs.with_m0(heaviest.m0 / 3.0)
    assert are_light(lighter, heaviest.m0).all()
    solved = fast_min_propellant(lighter, guess=heaviest)
    won = solved.start >= TWO_IMPULSE
    assert won.any()
    kept = heaviest.m_final / heaviest.m0
    assert (solved.m_final[won] > lighter.m0[won] * kept[won]).all()
    near = legs.with_m0(heaviest.m0 / 1.9)
    assert not are_light(near, heaviest.m0).any()


def test_short_legs_are_light_from_a_quarter_of_their_maximum_mass_on():
    legs = long_legs(4, seed=1)
    short = Legs(legs.rv_dep, legs.rv_arr, 30.0, [90.0, 40.0, 26.0, 24.0], 0.1, 3000.0, 0.0)
    assert are_light(short, np.full(4, 100.0)).tolist() == [False, False, False, True]


def degenerate_legs() -> Legs:
    """Return legs whose end points give no plane, no sense of rotation or no arc at all."""
    radius, speed = 2.7 * AU, EARTH_VELOCITY / np.sqrt(2.7)
    ahead = [radius, 0, 0, 0, speed, 0]
    ends = [
        (ahead, [-radius, 0, 0, 0, -speed, 0], 1621.0),  # opposite
        (ahead, [0, 0, radius, -speed, 0, 0], 500.0),  # over the pole
        (ahead, ahead, 1.0),  # the same state
        (ahead, [1.5 * radius, 0, 0, 0, 0.8 * speed, 0], 300.0),  # on one ray
        (ahead, [0, -radius, 0, -speed, 0, 0], 900.0),  # backwards
        ([radius, 0, 0, 4 * speed, 0, 0], [0, radius, 0, -speed, 0, 0], 400.0),  # unbound, radial
    ]
    dep, arr, tof = zip(*ends, strict=True)
    return Legs(dep, arr, tof, 500.0, 0.3, 3000.0, 0.0)


def test_the_reference_returns_a_row_for_every_degenerate_leg():
    legs = degenerate_legs()
    heaviest = solve_max_initial_mass(legs, method="reference", n_segments=6)
    assert len(heaviest) == len(legs)
    assert (np.isnan(heaviest.throttles).any(axis=(1, 2)) == ~heaviest.converged).all()
    assert (heaviest.status[~heaviest.converged] == Status.NOT_CONVERGED).all()
    solved = optimise(legs, method="reference", guess=heaviest)
    assert (solved.converged == (solved.status == Status.CONVERGED)).all()
