"""Legs with free ends: what excess velocities can do, and what they must not change."""

import numpy as np
import pytest
from scipy.optimize import minimize

from feasibility import impulses, max_initial_mass, optimise
from feasibility.constants import AU, DAY_S, MU_SUN
from feasibility.legs import Legs
from feasibility.orbits.kepler_kernels import propagate_batch
from feasibility.orbits.lambert import lambert
from feasibility.orbits.varied_legs import varied_legs
from feasibility.sims_flanagan import solve_max_initial_mass
from feasibility.sims_flanagan.fast.solver import fast_max_initial_mass, fast_min_propellant
from feasibility.sims_flanagan.pykep_leg import confirm, scaled_leg
from feasibility.sims_flanagan.reference.pygmo_problems import (
    MaximumMassProblem,
    MinimumPropellantProblem,
)
from feasibility.sims_flanagan.reference.solver import (
    reference_max_initial_mass,
    reference_min_propellant,
)
from feasibility.sims_flanagan.solutions import BALLISTIC, EXCESS_TOLERANCE, Status
from tests.helpers.free_legs import free_legs, with_ends

BEFORE = [
    1004.8060576313067,
    4114.755745587225,
    3370.812524261023,
    869.25842599045,
    1732.3570849867288,
    10718.523839564892,
    75.54348759402602,
    2955.0836654091277,
    83.30865542203556,
    1292.0415784497388,
    164.70796923521635,
    557.3174368655784,
]
"""m* of the first legs of `varied_legs`, seed 0, before there were free ends."""


def sizes(excess):
    return np.linalg.norm(excess, axis=1)


def test_legs_from_rest_to_rest_are_solved_as_before_free_ends():
    legs = varied_legs(np.random.default_rng(0)).take(np.arange(len(BEFORE)))
    np.testing.assert_allclose(max_initial_mass(legs), BEFORE, rtol=1e-9)


def test_legs_from_rest_to_rest_are_the_same_to_the_bit_among_legs_with_free_ends():
    rest = free_legs(6, seed=1)
    alone = fast_max_initial_mass(rest)
    mixed = Legs.concatenate([with_ends(rest, 1000.0, np.inf), rest, with_ends(rest, 0.0, 2000.0)])
    among = fast_max_initial_mass(mixed).take(np.arange(6, 12))
    for name in ("throttles", "m0", "m_final", "start", "dep_excess", "arr_excess"):
        np.testing.assert_array_equal(getattr(among, name), getattr(alone, name))
    assert not alone.dep_excess.any()
    assert not alone.arr_excess.any()


@pytest.mark.parametrize("ends", [(2000.0, 0.0), (0.0, 2000.0), (1000.0, 500.0), (0.0, np.inf)])
def test_every_converged_row_is_confirmed_by_pykep_and_keeps_its_bounds(ends):
    legs = free_legs(30, 2, *ends, far=0.3)
    found = fast_max_initial_mass(legs)
    assert found.converged.mean() > 0.95
    good = found.converged
    again = confirm(
        legs.take(good),
        found.throttles[good],
        found.m0[good],
        found.m_final[good],
        found.dep_excess[good],
        found.arr_excess[good],
    )
    assert again.max() < 1e-6
    assert (sizes(found.dep_excess)[good] <= ends[0] * (1.0 + EXCESS_TOLERANCE)).all()
    assert (sizes(found.arr_excess)[good] <= ends[1] * (1.0 + EXCESS_TOLERANCE)).all()


def test_more_excess_never_lowers_the_maximum_mass():
    legs = free_legs(15, 3, far=0.4)
    for end in ("vinf_dep", "vinf_arr"):
        before = max_initial_mass(legs)
        for bound in (30.0, 300.0, 1000.0, 3000.0, 6000.0, np.inf):
            after = max_initial_mass(with_ends(legs, **{end: bound}))
            assert (after >= 0.997 * before).all()
            before = after


def test_solutions_turn_with_the_leg():
    rng = np.random.default_rng(4)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    legs = free_legs(12, 4, 1500.0, 800.0, far=0.3)

    def rotated(rv):
        return np.concatenate([rv[:, :3] @ turn.T, rv[:, 3:] @ turn.T], axis=1)

    other = Legs(
        *(rotated(legs.rv_dep), rotated(legs.rv_arr), legs.tof_days, legs.m0, legs.thrust),
        *(legs.isp, legs.m_dry),
        vinf_dep=legs.vinf_dep,
        vinf_arr=legs.vinf_arr,
    )
    one, two = fast_max_initial_mass(legs), fast_max_initial_mass(other)
    same = np.isclose(one.m0, two.m0, rtol=1e-4)
    assert same.mean() > 0.8
    assert np.abs(one.m0 / two.m0 - 1.0).max() < 5e-3
    for name in ("dep_excess", "arr_excess"):
        turned = getattr(one, name)[same] @ turn.T
        np.testing.assert_allclose(turned, getattr(two, name)[same], atol=60.0)


def test_a_leg_within_its_excess_velocities_needs_no_thrust_and_has_no_largest_mass():
    legs = free_legs(8, 5)
    v1, v2 = (v[:, 0] for v in lambert(legs.rv_dep[:, :3], legs.rv_arr[:, :3], legs.tof_s))
    first, second = sizes(v1 - legs.rv_dep[:, 3:]), sizes(v2 - legs.rv_arr[:, 3:])
    within = with_ends(legs, 1.001 * first, 1.001 * second)
    for method in ("fast", "reference", "best"):
        found = solve_max_initial_mass(within, method=method)
        assert np.isinf(found.m0).all()
        assert np.isinf(found.m_final).all()
        assert found.converged.all()
        assert not found.throttles.any()
        assert not impulses(within, found).any()
        if method != "best":
            assert (found.start == BALLISTIC).all()
        flown = optimise(within, method=method, guess=found)
        np.testing.assert_array_equal(flown.m_final, within.m0)
        assert (flown.status == Status.CONVERGED).all()
        start = within.rv_dep.copy()
        start[:, 3:] += flown.dep_excess
        end = propagate_batch(start, within.tof_s, MU_SUN)
        end[:, 3:] -= flown.arr_excess
        np.testing.assert_allclose(end[:, :3], within.rv_arr[:, :3], atol=1e-6 * AU)
        np.testing.assert_allclose(end[:, 3:], within.rv_arr[:, 3:], atol=0.1)
    beyond = with_ends(legs, 0.9 * first, 0.9 * second)
    assert np.isfinite(max_initial_mass(beyond)[:4]).all()


def test_a_fly_by_is_the_best_rendezvous_with_any_velocity():
    legs = free_legs(2, 6, 0.0, np.inf)
    found = fast_max_initial_mass(legs)
    for row in range(len(legs)):
        one = with_ends(legs.take([row]))
        arrival = one.rv_arr.copy()

        def heavier(velocity, one=one, arrival=arrival):
            arrival[0, 3:] = 1e3 * velocity
            trial = Legs(
                *(one.rv_dep, arrival, one.tof_days, one.m0, one.thrust, one.isp, one.m_dry)
            )
            return -float(np.log(max(max_initial_mass(trial)[0], 1e-3)))

        _, v2 = lambert(one.rv_dep[:, :3], one.rv_arr[:, :3], one.tof_s)
        options = {"maxfev": 300, "xatol": 1e-3, "fatol": 1e-6}
        oracle = minimize(heavier, v2[0, 0] / 1e3, method="Nelder-Mead", options=options)
        assert found.m0[row] == pytest.approx(np.exp(-oracle.fun), rel=3e-3)
        velocity = legs.rv_arr[row, 3:] + found.arr_excess[row]
        np.testing.assert_allclose(velocity / 1e3, oracle.x, atol=0.3)


def test_maximum_mass_is_proportional_to_thrust_with_free_ends_too():
    legs = free_legs(6, 7, 500.0, np.inf)
    doubled = Legs(
        *(legs.rv_dep, legs.rv_arr, legs.tof_days, legs.m0, 2 * legs.thrust, legs.isp, legs.m_dry),
        vinf_dep=legs.vinf_dep,
        vinf_arr=legs.vinf_arr,
    )
    np.testing.assert_allclose(max_initial_mass(doubled), 2 * max_initial_mass(legs), rtol=1e-12)


def test_less_propellant_is_burnt_with_more_excess_and_with_less_mass():
    rest = free_legs(10, 8, far=0.05)
    heaviest = fast_max_initial_mass(rest)
    rest = rest.with_m0(np.maximum(0.7 * heaviest.m0, 120.0))
    base = fast_min_propellant(rest, guess=heaviest)
    for ends in ((300.0, 0.0), (0.0, 300.0), (0.0, np.inf)):
        legs = with_ends(rest, *ends)
        guess = fast_max_initial_mass(legs)
        found = fast_min_propellant(legs, guess=guess)
        both = base.converged & found.converged
        assert both.mean() > 0.8
        burnt, before = ((s.m0 - s.m_final)[both] for s in (found, base))
        assert (burnt <= 1.003 * before).all()
        assert (sizes(found.dep_excess)[both] <= ends[0] * (1.0 + EXCESS_TOLERANCE)).all()
        assert (sizes(found.arr_excess)[both] <= ends[1] * (1.0 + EXCESS_TOLERANCE)).all()


def test_the_fast_solver_agrees_with_the_reference():
    legs = Legs.concatenate(
        [
            free_legs(2, 9, 800.0, 0.0),
            free_legs(2, 10, 0.0, 800.0),
            free_legs(2, 11, 0.0, np.inf),
            free_legs(2, 12, 300.0, np.inf),
        ]
    )
    fast, slow = fast_max_initial_mass(legs), reference_max_initial_mass(legs)
    assert (np.isinf(fast.m0) == np.isinf(slow.m0)).all()
    finite = np.isfinite(fast.m0) & slow.converged
    assert finite.sum() >= 6
    assert (fast.m0[finite] > 0.998 * slow.m0[finite]).all()
    rows = finite & (fast.m0 < 1e5)
    some, guess = legs.take(rows), fast.take(rows)
    some = some.with_m0(np.maximum(0.6 * guess.m0, 110.0))
    ours = fast_min_propellant(some, guess=guess)
    theirs = reference_min_propellant(some, guess=guess)
    both = ours.converged & theirs.converged
    assert both.any()
    burnt, least = ((s.m0 - s.m_final)[both] for s in (ours, theirs))
    assert (burnt < 1.005 * least).all()


@pytest.mark.parametrize("problem_type", [MaximumMassProblem, MinimumPropellantProblem])
@pytest.mark.parametrize("bounds", [(0.1, 0.0), (0.0, 0.2), (0.1, 0.2), (0.1, np.inf)])
def test_gradients_with_excess_velocities_equal_finite_differences(problem_type, bounds):
    rng = np.random.default_rng(13)
    problem = problem_type(scaled_leg(free_legs(1, 13), 0, 1500.0, 6), *bounds)
    n_ends = sum(bound > 0.0 for bound in bounds)
    x = np.concatenate(
        [
            rng.uniform(-0.5, 0.5, 18),
            rng.uniform(-0.05, 0.05, 3 * n_ends),
            rng.uniform(0.8, 1.2, problem.n_masses),
        ]
    )
    lower, upper = problem.get_bounds()
    assert len(lower) == len(upper) == len(x)
    exact = np.zeros((8 + problem.get_nic(), len(x)))
    rows, columns = problem.gradient_sparsity().T
    exact[rows, columns] = problem.gradient(x)
    step = 1e-6
    for column in range(len(x)):
        shift = np.zeros(len(x))
        shift[column] = step
        numeric = np.subtract(problem.fitness(x + shift), problem.fitness(x - shift)) / (2 * step)
        np.testing.assert_allclose(exact[:, column], numeric, rtol=2e-6, atol=2e-7)


def test_about_another_sun_excess_velocities_are_in_m_s_too():
    legs = free_legs(4, 14, 800.0, np.inf)
    k = 1.3
    rv_dep, rv_arr = legs.rv_dep.copy(), legs.rv_arr.copy()
    rv_dep[:, 3:] *= k
    rv_arr[:, 3:] *= k
    faster = Legs(
        *(rv_dep, rv_arr, legs.tof_days / k, legs.m0, k**2 * legs.thrust, k * legs.isp, 100.0),
        vinf_dep=k * legs.vinf_dep,
        vinf_arr=np.inf,
    )
    one = solve_max_initial_mass(legs)
    two = solve_max_initial_mass(faster, mu=k**2 * MU_SUN)
    np.testing.assert_allclose(one.m0, two.m0, rtol=1e-3)
    np.testing.assert_allclose(k * one.dep_excess, two.dep_excess, rtol=1e-2, atol=5.0)
    burnt = optimise(faster, guess=two, mu=k**2 * MU_SUN)
    assert (sizes(burnt.dep_excess)[burnt.converged] <= k * 800.0 * (1 + 1e-6)).all()


def test_a_leg_that_coasts_to_its_target_after_a_whole_turn_is_found():
    # Lambert's arcs, whose plane is that of both positions, are of no use there.
    legs = free_legs(6, 15)
    period = 2 * np.pi * np.sqrt((1.3 * AU) ** 3 / MU_SUN)
    radius, speed = 1.3 * AU, np.sqrt(MU_SUN / (1.3 * AU))
    legs = Legs(
        [radius, 0.0, 0.0, 0.0, speed, 0.0],
        [
            [radius * np.cos(a), radius * np.sin(a), h * AU, 0.0, speed, 900.0]
            for a, h in ((0.05, 0.02), (-0.04, 0.01), (0.03, -0.02))
        ],
        period / DAY_S,
        m0=1500.0,
        thrust=0.3,
        isp=3000.0,
        m_dry=100.0,
        vinf_arr=np.inf,
    )
    assert (max_initial_mass(legs) > 3000.0).all()


def test_a_spacecraft_that_passes_its_target_on_a_hyperbola_burns_less_than_at_full_thrust():
    circle = np.sqrt(MU_SUN / AU)
    legs = Legs(
        [AU, 0.0, 0.0, 0.0, circle, 0.0],
        [
            [3.0 * AU * np.cos(angle), 3.0 * AU * np.sin(angle), 0.05 * AU, -8e3, 12e3, 0.0]
            for angle in (0.6, 0.9, 1.2)
        ],
        tof_days=150.0,
        m0=1500.0,
        thrust=0.3,
        isp=4000.0,
        m_dry=0.0,
        vinf_dep=3000.0,
        vinf_arr=np.inf,
    )
    heaviest = fast_max_initial_mass(legs)
    lighter = legs.with_m0(np.maximum(0.7 * heaviest.m0, 100.0 * legs.thrust))
    flown = fast_min_propellant(lighter, guess=heaviest)
    assert flown.converged.all()
    speed = np.linalg.norm(legs.rv_arr[:, 3:] + flown.arr_excess, axis=1)
    radius = np.linalg.norm(legs.rv_arr[:, :3], axis=1)
    assert (speed > np.sqrt(2.0 * MU_SUN / radius)).any()
    at_full_thrust = 1.0 - heaviest.m_final / heaviest.m0
    assert (1.0 - flown.m_final / flown.m0 < 0.97 * at_full_thrust).all()


@pytest.mark.slow
@pytest.mark.parametrize(
    "ends", [(3000.0, 0.0), (0.0, 3000.0), (1000.0, 1000.0), (0.0, np.inf), (2000.0, np.inf)]
)
def test_many_legs_agree_with_the_reference(ends):
    legs = free_legs(40, 16, *ends, far=0.6)
    fast, slow = fast_max_initial_mass(legs), reference_max_initial_mass(legs)
    assert (np.isinf(fast.m0) == np.isinf(slow.m0)).mean() >= 0.97
    real = np.isfinite(slow.m0) & slow.converged & (slow.m_final > 0.0501 * slow.m0)
    worse = fast.m0[real] < 0.995 * slow.m0[real]
    assert worse.mean() <= 0.03
