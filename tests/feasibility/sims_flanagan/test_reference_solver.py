"""The reference leg solver: gradients, closure, physics of m*, and failures as rows."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from feasibility import InputError, Legs, max_initial_mass, optimise
from feasibility.constants import AU, EARTH_VELOCITY, MU_SUN
from feasibility.orbits import classical_to_cartesian
from feasibility.sims_flanagan import LegSolutions, Status, solve_max_initial_mass
from feasibility.sims_flanagan.pykep_leg import confirm, scaled_leg
from feasibility.sims_flanagan.reference import solver as reference
from feasibility.sims_flanagan.reference.pygmo_problems import (
    MaximumMassProblem,
    MinimumPropellantProblem,
)
from feasibility.sims_flanagan.reference.solver import (
    reference_max_initial_mass,
    reference_min_propellant,
)
from feasibility.sims_flanagan.reference.starts import FROM_GUESS
from feasibility.sims_flanagan.solutions import MISMATCH_TOLERANCE, THROTTLE_TOLERANCE


def main_belt_legs(n: int, seed: int, tof_days: tuple[float, float]) -> Legs:
    """Return legs between similar main-belt orbits, some flyable and some not."""
    rng = np.random.default_rng(seed)
    departure = np.column_stack(
        [
            rng.uniform(2.2, 3.0, n) * AU,
            rng.uniform(0.0, 0.2, n),
            rng.uniform(0.0, 0.15, n),
            *rng.uniform(0.0, 2.0 * np.pi, (3, n)),
        ]
    )
    arrival = departure + rng.normal(size=(n, 6)) * [0.03 * AU, 0.01, 0.01, 0.1, 0.1, 0.1]
    arrival[:, 1:3] = np.abs(arrival[:, 1:3])
    tof = rng.uniform(*tof_days, n)
    arrival[:, 5] += np.sqrt(MU_SUN / arrival[:, 0] ** 3) * tof * 86400.0
    craft = {"m0": 1500.0, "thrust": 0.3, "isp": 3000.0, "m_dry": 50.0}
    return Legs(classical_to_cartesian(departure), classical_to_cartesian(arrival), tof, **craft)


@pytest.fixture(scope="module")
def legs() -> Legs:
    return main_belt_legs(6, seed=3, tof_days=(150.0, 700.0))


@pytest.fixture(scope="module")
def heaviest(legs) -> LegSolutions:
    return solve_max_initial_mass(legs, method="reference")


@pytest.fixture(scope="module")
def flyable(legs, heaviest) -> tuple[Legs, LegSolutions, LegSolutions]:
    lighter = legs.with_m0(0.8 * heaviest.m0)
    return lighter, heaviest, optimise(lighter, method="reference", guess=heaviest)


@pytest.mark.parametrize("problem_type", [MaximumMassProblem, MinimumPropellantProblem])
@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_gradients_equal_finite_differences(problem_type, seed):
    rng = np.random.default_rng(seed)
    row = main_belt_legs(1, seed=seed % 1000, tof_days=(100.0, 400.0))
    problem = problem_type(scaled_leg(row, 0, 1500.0, 6))
    x = np.concatenate([rng.uniform(-0.5, 0.5, 18), rng.uniform(0.8, 1.2, problem.n_masses)])
    sparse = problem.gradient(x)
    exact = np.zeros((1 + 7 + 6, len(x)))
    rows, columns = problem.gradient_sparsity().T
    exact[rows, columns] = sparse
    step = 1e-6
    numeric = np.empty_like(exact)
    for column in range(len(x)):
        shift = np.zeros(len(x))
        shift[column] = step
        numeric[:, column] = np.subtract(problem.fitness(x + shift), problem.fitness(x - shift))
    np.testing.assert_allclose(exact, numeric / (2.0 * step), rtol=2e-6, atol=2e-7)


def test_gradient_is_finite_where_the_thrust_is_off(legs):
    problem = MinimumPropellantProblem(scaled_leg(legs, 0, 1500.0, 20))
    assert np.isfinite(problem.gradient(np.append(np.zeros(60), 1.0))).all()


def test_every_leg_has_a_maximum_initial_mass_and_pykep_confirms_it(legs, heaviest):
    assert heaviest.converged.all()
    assert (heaviest.status == Status.CONVERGED).all()
    assert (heaviest.start >= 0).all()
    mismatch = confirm(legs, heaviest.throttles, heaviest.m0, heaviest.m_final)
    assert (mismatch < MISMATCH_TOLERANCE).all()
    np.testing.assert_array_equal(mismatch, heaviest.mismatch)


def test_confirm_tells_a_leg_that_does_not_close(legs, heaviest):
    off = heaviest.throttles.copy()
    off[0, 3] *= 0.99
    heavier = heaviest.m0 * np.where(np.arange(len(legs)) == 1, 1.001, 1.0)
    final = np.where(np.arange(len(legs)) == 2, np.nan, heaviest.m_final)
    mismatch = confirm(legs, off, heavier, final)
    assert (mismatch[:2] > MISMATCH_TOLERANCE).all()
    assert mismatch[2] == np.inf
    assert (mismatch[3:] < MISMATCH_TOLERANCE).all()


def test_at_the_maximum_mass_the_thrust_is_always_full(heaviest):
    norms = np.linalg.norm(heaviest.throttles, axis=2)
    assert norms.max() <= 1.0 + THROTTLE_TOLERANCE
    assert norms.min() > 0.99


def coast(rv: np.ndarray, seconds: float) -> np.ndarray:
    def motion(_t, y):
        return [*y[3:], *(-MU_SUN * y[:3] / np.linalg.norm(y[:3]) ** 3)]

    return solve_ivp(motion, (0.0, seconds), rv, method="DOP853", rtol=1e-12, atol=1e-3).y[:, -1]


@pytest.mark.parametrize("kind", ["maximum mass", "minimum propellant"])
def test_an_independent_propagation_arrives(legs, heaviest, flyable, kind):
    row = 1
    solution = heaviest if kind == "maximum mass" else flyable[2]
    throttles, mass = solution.throttles[row], float(solution.m0[row])
    dt = float(legs.tof_s[row]) / len(throttles)
    c = float(legs.exhaust_velocity[row])
    impulse = float(legs.thrust[row]) * dt
    rv = legs.rv_dep[row]
    for segment, throttle in enumerate(throttles):
        size = np.linalg.norm(throttle)
        divisor = mass
        if segment >= len(throttles) // 2:
            # Backward half: the impulse is over the mass after it, which is the root of
            # after * exp(impulse * size / (after * c)) = mass.
            for _ in range(50):
                divisor = mass * np.exp(-impulse * size / (divisor * c))
        rv = coast(rv, dt / 2.0)
        rv = rv + np.concatenate([np.zeros(3), impulse * throttle / divisor])
        rv = coast(rv, dt / 2.0)
        mass *= np.exp(-impulse * size / (divisor * c))
    error = np.abs(rv - legs.rv_arr[row])
    assert error[:3].max() < 1e-5 * AU
    assert error[3:].max() < 1e-5 * EARTH_VELOCITY
    assert mass == pytest.approx(solution.m_final[row], rel=1e-5)


def test_maximum_mass_is_proportional_to_thrust(legs, heaviest):
    columns = (legs.rv_dep, legs.rv_arr, legs.tof_days, legs.m0, 2.5 * legs.thrust, legs.isp)
    stronger = max_initial_mass(Legs(*columns, m_dry=0.0), method="reference")
    np.testing.assert_allclose(stronger, 2.5 * heaviest.m0, rtol=2e-4)


def test_maximum_mass_does_not_depend_on_the_mass_given(legs, heaviest):
    masses = max_initial_mass(legs.take([0, 1]).with_m0([500.0, 9000.0]), method="reference")
    np.testing.assert_allclose(masses, heaviest.m0[:2], rtol=2e-4)


def test_more_starts_never_lower_the_mass(legs):
    one = reference_max_initial_mass(legs.take([2]), agreement=1)
    more = reference_max_initial_mass(
        legs.take([2]), agreement=6, n_random=2, rng=np.random.default_rng(0)
    )
    assert more.m0[0] >= one.m0[0]


def test_a_guess_is_one_more_start_and_never_lost(legs, heaviest, monkeypatch):
    rows = np.array([0, 2])
    guess = heaviest.take(rows)
    monkeypatch.setattr(reference, "reference_starts", lambda *_: iter(()))
    started = reference_max_initial_mass(legs.take(rows), guess=guess, agreement=1)
    assert (started.m0 >= guess.m0).all()
    assert (started.start == FROM_GUESS).all()
    # Neither a guess that does not close nor one that is a failed row is taken for a solution.
    wrong = dataclasses.replace(guess, m0=2.0 * guess.m0, m_final=2.0 * guess.m_final)
    monkeypatch.setattr(reference, "_solve_maximum", lambda *_: None)
    assert not reference_max_initial_mass(legs.take(rows), guess=wrong).converged.any()
    failed = LegSolutions.unsolved(2, 20)
    assert not reference_max_initial_mass(legs.take(rows), guess=failed).converged.any()


def test_a_guess_has_the_number_of_segments(legs):
    guess = reference_max_initial_mass(legs.take([0]), n_segments=7, agreement=1)
    started = solve_max_initial_mass(legs.take([0]), method="reference", guess=guess)
    assert started.throttles.shape == (1, 7, 3)
    assert started.m0[0] >= guess.m0[0]


def test_the_same_seed_gives_the_same_solution(legs):
    runs = [
        reference_max_initial_mass(
            legs.take([0]), agreement=1, n_random=1, rng=np.random.default_rng(4)
        )
        for _ in range(2)
    ]
    np.testing.assert_array_equal(runs[0].throttles, runs[1].throttles)


def test_minimum_propellant_closes_and_saves_propellant(flyable):
    lighter, heaviest, solutions = flyable
    assert solutions.converged.all()
    np.testing.assert_array_equal(solutions.m0, lighter.m0)
    assert (confirm(lighter, solutions.throttles, solutions.m0, solutions.m_final) < 1e-6).all()
    assert (np.linalg.norm(solutions.throttles, axis=2) <= 1.0 + THROTTLE_TOLERANCE).all()
    assert (solutions.m_final >= lighter.m_dry).all()
    # The heaviest leg scaled down burns the same share of the mass: the optimum burns less.
    scaled_down = lighter.m0 / heaviest.m0 * heaviest.m_final
    assert (solutions.m_final > scaled_down).all()


def test_at_the_maximum_mass_no_propellant_can_be_saved(legs, heaviest):
    row = legs.take([0]).with_m0(heaviest.m0[:1])
    solution = optimise(row, method="reference", guess=heaviest.take(np.array([0])))
    assert solution.converged[0]
    assert solution.m_final[0] == pytest.approx(heaviest.m_final[0], rel=1e-3)


def assert_unsolved(solution: LegSolutions, status: Status) -> None:
    assert solution.status.tolist() == [status]
    assert not solution.converged[0]
    assert solution.m0[0] == solution.m_final[0] == 0.0
    assert solution.mismatch[0] == np.inf
    assert solution.start[0] == -1
    assert np.isnan(solution.throttles).all()


def test_a_leg_that_is_too_heavy_is_a_row(legs, heaviest):
    heavy = legs.take([0]).with_m0(1.01 * heaviest.m0[:1])
    assert_unsolved(optimise(heavy, guess=heaviest.take(np.array([0]))), Status.TOO_HEAVY)


def test_a_leg_that_needs_too_much_propellant_is_a_row(legs, heaviest):
    row = legs.take([0])
    mass = 0.9 * heaviest.m0[0]
    hollow = Legs(row.rv_dep, row.rv_arr, row.tof_days, mass, row.thrust, row.isp, 0.999 * mass)
    solution = optimise(hollow, guess=heaviest.take(np.array([0])))
    assert_unsolved(solution, Status.BELOW_DRY_MASS)


def test_a_leg_that_does_not_close_is_a_row():
    # From 1 to 30 AU in a day at a specific impulse that leaves no mass on arrival.
    slow, far = [AU, 0, 0, 0, EARTH_VELOCITY, 0], [-30 * AU, 0, 0, 0, -5e3, 0]
    impossible = Legs(slow, far, 1.0, 1000.0, 0.1, 300.0, 0.0)
    solution = reference_max_initial_mass(impossible, agreement=1)
    assert_unsolved(solution, Status.NOT_CONVERGED)
    assert_unsolved(optimise(impossible, guess=solution), Status.NOT_CONVERGED)


def test_an_antipodal_leg_in_which_the_lambert_plane_is_undefined_is_solved():
    legs = Legs(
        [2.5 * AU, 0, 0, 0, EARTH_VELOCITY / 2.5**0.5, 0],
        [-2.6 * AU, 0, 0, 0, -EARTH_VELOCITY / 2.6**0.5, 0],
        720.0,
        1000.0,
        0.3,
        3000.0,
        0.0,
    )
    assert reference_max_initial_mass(legs, agreement=1).converged.all()


def test_no_legs_give_no_rows(legs):
    none = legs.take([])
    assert len(solve_max_initial_mass(none)) == 0
    assert len(optimise(none)) == 0


def test_number_of_segments_is_free(legs):
    solution = reference_max_initial_mass(legs.take([0]), n_segments=7, agreement=1)
    assert solution.converged.all()
    assert solution.throttles.shape == (1, 7, 3)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda legs: max_initial_mass(legs, method="slow"), "method.*'slow'.*'reference'"),
        (lambda legs: optimise(legs, method="slow"), "method.*'slow'"),
        (lambda legs: reference_max_initial_mass(legs, n_segments=1), "n_segments.*1"),
        (lambda legs: reference_max_initial_mass(legs, n_random=2), "n_random.*rng"),
        (lambda legs: reference_max_initial_mass(legs, agreement=0), "agreement 0"),
        (
            lambda legs: reference_max_initial_mass(legs, guess=LegSolutions.unsolved(2, 20)),
            "2 guesses for 6 legs",
        ),
        (
            lambda legs: solve_max_initial_mass(legs, guess=LegSolutions.unsolved(6, 20)),
            "guess: method 'fast' takes none",
        ),
        (
            lambda legs: reference_min_propellant(legs, guess=LegSolutions.unsolved(2, 20)),
            "2 guesses for 6 legs",
        ),
    ],
)
def test_bad_input_is_one_clear_line(legs, call, words):
    with pytest.raises(InputError, match=words) as error:
        call(legs)
    assert "\n" not in str(error.value)
