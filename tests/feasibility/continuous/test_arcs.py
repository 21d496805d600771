import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from feasibility.continuous.arc_kernels import follow, sensitivities, shoot, shoot_derivatives

PUSH, BURN = 0.03, 0.02


def _arc(seed, n=12, radius=1.5, dt=0.05):
    rng = np.random.default_rng(seed)
    speed = radius**-0.5
    x0 = np.array([radius, 0, 0, 0, speed, 0]) * (1 + 0.15 * rng.standard_normal(6))
    x0[[2, 5]] = 0.1 * rng.standard_normal(2)
    u = rng.standard_normal((n, 3))
    u *= (rng.uniform(0.05, 1.0, n) / np.linalg.norm(u, axis=1))[:, None]
    return x0, u, rng.uniform(0.2, 1.0, n) * dt


def _shot(x0, u, dt):
    nodes = np.empty((len(dt) + 1, 7))
    shoot(x0, u, dt, PUSH, BURN, nodes)
    return nodes


def _derivatives(x0, u, dt, defects=None):
    n = len(dt)
    nodes, ends, jacobian = np.empty((n + 1, 7)), np.empty((n, 6)), np.empty((n, 6, 11))
    nodes[0, :6] = x0
    shoot_derivatives(u, dt, PUSH, BURN, True, nodes, ends, jacobian)
    by_u, by_s = np.empty((n, 6, 3)), np.empty((n, 6))
    sensitivities(jacobian, np.zeros((n, 6)), dt, BURN, by_u, by_s)
    return nodes, jacobian, by_u, by_s


@settings(max_examples=15, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    radius=st.sampled_from([0.4, 1.0, 2.5]),
    dt=st.sampled_from([0.02, 0.3]),
)
def test_an_arc_is_what_dop853_integrates(seed, radius, dt):
    x0, u, steps = _arc(seed, radius=radius, dt=dt)
    nodes = _shot(x0, u, steps)
    y = np.append(x0, 1.0)
    for k, step in enumerate(steps):
        thrust = u[k]

        def motion(_t, y, thrust=thrust):
            gain = PUSH * thrust / y[6] - y[:3] / np.linalg.norm(y[:3]) ** 3
            return np.concatenate([y[3:6], gain, [-BURN * np.linalg.norm(thrust)]])

        y = solve_ivp(motion, (0, step), y, method="DOP853", rtol=1e-13, atol=1e-15).y[:, -1]
    # Passages near the Sun let rounding grow.
    np.testing.assert_allclose(nodes[-1], y, rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize(("seed", "dt"), [(1, 0.05), (2, 0.6)])
def test_derivatives_are_those_of_differences(seed, dt):
    x0, u, steps = _arc(seed, dt=dt)
    _, _, by_u, by_s = _derivatives(x0, u, steps)
    for k in (0, 5, 11):
        for c in range(3):
            h = 1e-5 * np.eye(3)[c]
            ahead, back = u.copy(), u.copy()
            ahead[k] += h
            back[k] -= h
            slope = (_shot(x0, ahead, steps) - _shot(x0, back, steps))[-1, :6] / 2e-5
            ours = by_u[k, :, c] + by_s[k] * u[k, c] / np.linalg.norm(u[k])
            np.testing.assert_allclose(ours, slope, atol=1e-8)


def test_joined_segments_derive_as_one_arc():
    x0, u, steps = _arc(3)
    nodes, jacobian, by_u, by_s = _derivatives(x0, u, steps)
    n = len(steps)
    defects = np.zeros((n, 6))
    change = 1e-6 * np.random.default_rng(4).standard_normal((n, 3))
    sizes = np.linalg.norm(u + change, axis=1) - np.linalg.norm(u, axis=1)
    moved = nodes.copy()
    follow(jacobian, defects, steps, BURN, change, sizes, moved)
    shot = _shot(x0, u + change, steps)
    np.testing.assert_allclose(moved[:, :6], shot[:, :6], atol=1e-10)
    end = np.einsum("kij,kj->i", by_u, change) + by_s.T @ sizes
    np.testing.assert_allclose(end, (moved - nodes)[-1, :6], atol=1e-15)


def test_steps_are_cut_where_the_sun_is_near():
    x0 = np.array([0.3, 0.0, 0.0, 0.0, 1.8, 0.0])
    whole = _shot(x0, np.array([[0.5, 0.0, 0.0]]), np.array([0.4]))
    halves = _shot(x0, np.array([[0.5, 0.0, 0.0]] * 8), np.full(8, 0.05))
    np.testing.assert_allclose(whole[-1], halves[-1], atol=1e-12)
