"""Segments, gravitational parameter, and the impulses that throttles stand for."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from feasibility import InputError, Legs, impulses, max_initial_mass, optimise
from feasibility.constants import AU, DAY_S, EARTH_VELOCITY, MU_SUN
from feasibility.orbits import classical_to_cartesian
from feasibility.sims_flanagan import Status, solve_max_initial_mass
from tests.helpers.long_legs import long_legs


def quarter_turn(**changes) -> Legs:
    radius, speed = 2.7 * AU, EARTH_VELOCITY / np.sqrt(2.7)
    values = {"tof_days": 400.0, "m0": 1500.0, "thrust": 0.3, "isp": 3000.0, "m_dry": 500.0}
    return Legs(
        rv_dep=[radius, 0, 0, 0, speed, 0],
        rv_arr=[0, 1.03 * radius, 0.02 * AU, -speed, 0, 0],
        **(values | changes),
    )


def flown(leg: Legs, dv: np.ndarray, mu: float = MU_SUN) -> tuple[np.ndarray, float]:
    """Return the end state and final mass of one leg flown with impulses dv (s, 3)."""
    dt = leg.tof_s[0] / len(dv)
    state, mass = leg.rv_dep[0].copy(), leg.m0[0]

    def acceleration(_, y):
        return np.concatenate([y[3:], -mu * y[:3] / np.linalg.norm(y[:3]) ** 3])

    for impulse in dv:
        for half in range(2):
            span = (0.0, dt / 2)
            state = solve_ivp(acceleration, span, state, "DOP853", rtol=1e-12, atol=1e-3).y[:, -1]
            if half == 0:
                state[3:] += impulse
                mass *= np.exp(-np.linalg.norm(impulse) / leg.exhaust_velocity[0])
    return state, mass


@pytest.mark.parametrize("n_segments", [20, 31])
def test_impulses_fly_the_leg(n_segments):
    leg = quarter_turn()
    solved = optimise(leg, n_segments=n_segments)
    assert solved.converged.all()
    state, mass = flown(leg, impulses(leg, solved)[0])
    np.testing.assert_allclose(state[:3], leg.rv_arr[0, :3], atol=2e5)
    np.testing.assert_allclose(state[3:], leg.rv_arr[0, 3:], atol=0.05)
    assert mass == pytest.approx(solved.m_final[0], rel=1e-6)


def test_impulses_of_unsolved_rows_are_nan_and_others_do_not_depend_on_their_neighbours():
    legs = Legs.concatenate([quarter_turn(), quarter_turn(m0=1e5), quarter_turn(m0=1200.0)])
    solved = optimise(legs)
    dv = impulses(legs, solved)
    assert np.isnan(dv[1]).all()
    for row in (0, 2):
        alone = impulses(legs.take([row]), solved.take([row]))[0]
        np.testing.assert_array_equal(dv[row], alone)
    with pytest.raises(InputError, match="impulses: 3 solutions for 1 legs"):
        impulses(legs.take([0]), solved)


def test_more_segments_come_nearer_to_continuous_thrust():
    leg = quarter_turn()
    masses = [max_initial_mass(leg, n_segments=n)[0] for n in (10, 20, 40, 80)]
    steps = np.abs(np.diff(masses))
    assert steps[0] > steps[1] > steps[2]
    assert optimise(leg, n_segments=40).n_segments == 40
    coarse = solve_max_initial_mass(leg, n_segments=10)
    assert optimise(leg, guess=coarse).n_segments == 10


def test_bad_options_are_refused_in_one_line():
    leg = quarter_turn()
    guess = solve_max_initial_mass(leg, n_segments=10)
    with pytest.raises(InputError, match="n_segments: 1, expected 2 or more"):
        max_initial_mass(leg, n_segments=1)
    with pytest.raises(InputError, match="n_segments: 20, expected 10 as in the guess"):
        optimise(leg, guess=guess, n_segments=20)
    with pytest.raises(InputError, match=r"mu: -1\.0, expected a positive number"):
        max_initial_mass(leg, mu=-1.0)
    with pytest.raises(InputError, match="expected one of 'fast', 'reference', 'best', 'auto'"):
        optimise(leg, method="slow")


@pytest.mark.parametrize("method", ["fast", "reference"])
def test_a_sun_of_its_own(method):
    leg = quarter_turn()
    mu = 1.1 * MU_SUN
    solved = optimise(leg, method=method, mu=mu)
    assert solved.converged.all()
    state, mass = flown(leg, impulses(leg, solved)[0], mu)
    np.testing.assert_allclose(state[:3], leg.rv_arr[0, :3], atol=2e5)
    assert mass == pytest.approx(solved.m_final[0], rel=1e-6)


def test_the_better_solver_counts():
    legs = long_legs(3, seed=1)
    single = [max_initial_mass(legs, method=method) for method in ("fast", "reference")]
    best = max_initial_mass(legs, method="best")
    assert (best >= np.maximum(*single) * (1 - 1e-9)).all()


def test_impulses_are_those_of_a_plain_loop_to_the_last_bit():
    legs = long_legs(12, seed=6)
    solved = optimise(legs)
    dv = impulses(legs, solved)
    for row in np.flatnonzero(solved.converged):
        one, throttles = legs.take([row]), solved.throttles[row]
        n = len(throttles)
        push = float(one.thrust[0]) * float(one.tof_days[0]) / n * DAY_S
        exhaust = float(one.exhaust_velocity[0])
        norms = np.linalg.norm(throttles, axis=1)
        masses = np.empty(n)
        mass = float(solved.m0[row])
        for k in range(n // 2):
            masses[k] = mass
            mass *= float(np.exp(-push * norms[k] / mass / exhaust))
        mass = float(solved.m_final[row])
        for k in range(n - 1, n // 2 - 1, -1):
            masses[k] = mass
            mass *= float(np.exp(push * norms[k] / mass / exhaust))
        np.testing.assert_array_equal(dv[row], throttles * (push / masses)[:, None])


def eccentric_legs(e_dep: float, e_arr: float, n: int, seed: int) -> Legs:
    rng = np.random.default_rng(seed)
    ends = []
    for e in (e_dep, e_arr):
        perihelion = rng.uniform(0.4, 1.0, n) if e > 0.5 else rng.uniform(1.0, 2.0, n)
        orbits = np.empty((n, 6))
        orbits[:, 0], orbits[:, 1] = AU * np.minimum(perihelion / (1 - e), 4.0), e
        orbits[:, 2] = np.radians(rng.rayleigh(5.0, n))
        orbits[:, 3:] = rng.uniform(0.0, 2 * np.pi, (n, 3))
        ends.append(classical_to_cartesian(orbits))
    return Legs(*ends, rng.uniform(400.0, 1200.0, n), 300.0, 0.3, 3000.0, 0.0)


@pytest.mark.parametrize(("e_dep", "e_arr"), [(0.95, 0.1), (0.1, 0.95), (0.9, 0.9)])
def test_very_eccentric_orbits_go_to_the_reference_too(e_dep, e_arr):
    legs = eccentric_legs(e_dep, e_arr, 2, seed=2)
    fast = solve_max_initial_mass(legs)
    careful = solve_max_initial_mass(legs, method="auto")
    assert careful.converged.all()
    assert (careful.m0 >= fast.m0 * (1 - 1e-9)).all()
    light = legs.with_m0(careful.m0 / 1.5)
    solved = optimise(light, method="auto", guess=careful)
    assert solved.converged.all()
    assert (solved.m_final < light.m0).all()
    assert np.isfinite(solved.throttles).all()


def test_the_careful_method_is_the_fast_one_where_that_is_good():
    legs = long_legs(6, seed=1)
    heaviest = solve_max_initial_mass(legs)
    assert heaviest.converged.all()
    np.testing.assert_array_equal(max_initial_mass(legs, method="auto"), heaviest.m0)
    light = legs.with_m0(0.8 * heaviest.m0)
    solved = [optimise(light, method=method, guess=heaviest) for method in ("fast", "auto")]
    np.testing.assert_array_equal(solved[0].m_final, solved[1].m_final)


def test_legs_that_rounding_made_too_heavy_are_solved_at_their_maximum_mass():
    leg = quarter_turn()
    m_star = max_initial_mass(leg)[0]
    heavier = leg.with_m0(m_star * 1.004)
    assert optimise(heavier).status.tolist() == [Status.TOO_HEAVY]
    solved = optimise(heavier, mass_tolerance=0.005)
    assert solved.converged.all()
    assert solved.m0[0] == pytest.approx(m_star)
    assert optimise(heavier, mass_tolerance=0.003).status.tolist() == [Status.TOO_HEAVY]
    with pytest.raises(InputError, match=r"mass_tolerance: -1\.0, expected 0 or more"):
        optimise(leg, mass_tolerance=-1.0)
