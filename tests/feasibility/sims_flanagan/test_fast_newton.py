"""The second-order finish of the fast solver."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from feasibility.constants import AU
from feasibility.legs import Legs
from feasibility.orbits import classical_to_cartesian
from feasibility.sims_flanagan.fast.newton_kernels import factor, solve_columns
from feasibility.sims_flanagan.fast.solver import fast_max_initial_mass
from feasibility.sims_flanagan.reference.solver import reference_max_initial_mass


def winding_legs(n: int, seed: int) -> Legs:
    """Return legs of one and a half to three revolutions near the Earth's orbit."""
    rng = np.random.default_rng(seed)
    low = [0.95, 0.0, 0.0, 0.0, 0.0, 0.0]
    high = [1.3, 0.15, 0.1, 2 * np.pi, 2 * np.pi, 2 * np.pi]
    elements = rng.uniform(low, high, (2, n, 6)) * [AU, 1, 1, 1, 1, 1]
    return Legs(
        rv_dep=classical_to_cartesian(elements[0]),
        rv_arr=classical_to_cartesian(elements[1]),
        tof_days=rng.uniform(800.0, 1300.0, n),
        m0=1500.0,
        thrust=0.236,
        isp=4190.0,
        m_dry=1.0,
    )


@given(seed=st.integers(0, 10**6), size=st.integers(6, 40), shift=st.floats(0.0, 10.0))
def test_columns_are_solved_as_by_numpy(seed: int, size: int, shift: float) -> None:
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((size, size))
    matrix = root @ root.T + np.eye(size)
    table = np.zeros((2 * size, size + 6))
    table[:size, :size] = np.tril(matrix)
    table[:size, size:] = rng.standard_normal((size, 6))
    assert factor(table, size, shift)
    solve_columns(table, size)
    expected = np.linalg.solve(matrix + shift * np.eye(size), table[:size, size:])
    np.testing.assert_allclose(table[size:, size:], expected, rtol=1e-8, atol=1e-10)


@given(seed=st.integers(0, 10**6))
def test_an_indefinite_matrix_has_a_factor_only_when_shifted_enough(seed: int) -> None:
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((8, 8))
    matrix = root + root.T
    least = float(np.linalg.eigvalsh(matrix)[0])
    table = np.zeros((16, 14))
    table[:8, :8] = matrix
    assert not factor(table, 8, -least - 0.01)
    assert factor(table, 8, -least + 0.01)


def test_winding_legs_are_seldom_below_the_reference() -> None:
    legs = winding_legs(6, 3)
    fast, reference = fast_max_initial_mass(legs), reference_max_initial_mass(legs, agreement=2)
    assert fast.converged[reference.converged].all()
    assert (fast.m0 >= 0.998 * reference.m0).mean() >= 5 / 6
