import numpy as np
import pytest
from scipy.optimize import minimize

from feasibility import InputError
from feasibility.constants import DAY_S
from feasibility.continuous import ContinuousLeg, refine_leg
from feasibility.continuous.grid import daily_edges, impulsive_path, on_grid
from feasibility.continuous.model import LegModel
from tests.helpers.continuous import T_DEP, kepler, leg_aside, leg_to_nearby, start_state


def _thrusts(arc):
    return np.linalg.norm(arc.thrust_n, axis=1)


def test_a_leg_closes_with_no_more_than_full_thrust():
    leg, throttles = leg_to_nearby(80.4, (300.0, -500.0, 100.0))
    arc = refine_leg(leg, T_DEP + 80.4, throttles)
    assert arc.converged
    assert arc.miss_km < 0.1
    assert arc.miss_m_s < 1e-4
    assert _thrusts(arc).max() <= leg.thrust_n
    np.testing.assert_array_equal(np.diff(arc.edges_mjd2000)[:-1], 1.0)
    flow = _thrusts(arc) / leg.exhaust_velocity_m_s * np.diff(arc.edges_mjd2000) * DAY_S
    np.testing.assert_allclose(-np.diff(arc.mass_kg), flow, rtol=1e-9, atol=1e-12)


def test_least_propellant_is_full_thrust_or_none():
    leg, throttles = leg_to_nearby(80.4, (300.0, -500.0, 100.0))
    sizes = _thrusts(refine_leg(leg, T_DEP + 80.4, throttles)) / leg.thrust_n
    between = (sizes > 1e-3) & (sizes < 1 - 1e-3)
    assert between.sum() <= 4
    assert (sizes < 1e-3).sum() > 10


@pytest.mark.parametrize("change", [(200.0, -100.0, 50.0), (-50.0, 150.0, -200.0)])
def test_no_general_optimiser_finds_less_propellant(change):
    days = 24.5
    leg, throttles = leg_to_nearby(days, change)
    arc = refine_leg(leg, T_DEP + days, throttles)
    assert arc.converged
    model = LegModel(leg, (T_DEP + days, T_DEP + days), 1.0)
    edges = daily_edges(T_DEP, T_DEP + days)
    dt = np.diff(edges)
    n = len(dt)

    def gap(x):
        return 1e5 * model.point(edges, x[: 3 * n].reshape(n, 3)).gap

    def gap_jacobian(x):
        u = x[: 3 * n].reshape(n, 3)
        linear = model.linearised(model.point(edges, u))
        along = u / np.maximum(np.linalg.norm(u, axis=1), 1e-9)[:, None]
        rows = linear.by_throttle + linear.by_size[:, :, None] * along[:, None, :]
        return 1e5 * np.hstack([rows.transpose(1, 0, 2).reshape(6, -1), np.zeros((6, n))])

    # Sizes s beside vectors u keep the cost smooth: sum dt s with |u| <= s <= 1.
    start = on_grid(throttles, edges)
    found = minimize(
        lambda x: dt @ x[3 * n :],
        np.concatenate([start.ravel(), np.linalg.norm(start, axis=1)]),
        jac=lambda x: np.concatenate([np.zeros(3 * n), dt]),
        bounds=[(-1, 1)] * (3 * n) + [(0, 1)] * n,
        constraints=[
            {"type": "eq", "fun": gap, "jac": gap_jacobian},
            {
                "type": "ineq",
                "fun": lambda x: (
                    x[3 * n :] ** 2 - (x[: 3 * n].reshape(n, 3) ** 2).sum(axis=1) + 1e-9
                ),
                "jac": lambda x: np.hstack(
                    [
                        (
                            -2 * x[: 3 * n].reshape(n, 3)[:, None, :] * np.eye(n)[:, :, None]
                        ).reshape(n, -1),
                        np.diag(2 * x[3 * n :]),
                    ]
                ),
            },
        ],
        method="SLSQP",
        options={"maxiter": 300, "ftol": 1e-10},
    )
    assert np.abs(gap(found.x)).max() < 1e-2
    ours = dt @ (_thrusts(arc) / leg.thrust_n)
    theirs = dt @ np.linalg.norm(found.x[: 3 * n].reshape(n, 3), axis=1)
    assert ours <= theirs * (1 + 1e-3)
    assert ours >= theirs * (1 - 2e-2)


def test_what_cannot_be_flown_is_said_and_flown_a_little_later():
    days = 60.0
    leg, throttles = leg_aside(days, 280.0)
    fixed = refine_leg(leg, T_DEP + days, throttles)
    assert not fixed.converged
    assert fixed.miss_km > 100
    window = (T_DEP + days, T_DEP + 100.0)
    later = refine_leg(leg, T_DEP + days, throttles, arrival_mjd2000=window)
    assert later.converged
    assert T_DEP + days + 1.0 < later.t_arr_mjd2000 < window[1]
    # The time is not much more than the least that will do.
    shorter = later.t_arr_mjd2000 - 2.0
    assert not refine_leg(leg, shorter, throttles).converged


def test_time_is_kept_where_it_can_be_and_worth_what_is_said():
    leg, throttles = leg_aside(60.3, 150.0)
    window = (T_DEP + 60.3, T_DEP + 90.0)
    kept = refine_leg(leg, window[0], throttles, arrival_mjd2000=window)
    cheap = refine_leg(leg, window[0], throttles, arrival_mjd2000=window, time_price=0.3)
    assert kept.converged
    assert cheap.converged
    assert kept.t_arr_mjd2000 == pytest.approx(window[0], abs=1e-6)
    assert cheap.t_arr_mjd2000 > window[0] + 1.0
    assert cheap.propellant_kg < kept.propellant_kg


def test_several_revolutions_begin_on_the_path_of_impulses():
    days, n = 2600.0, 20
    rng = np.random.default_rng(6)
    impulses = 60.0 * rng.standard_normal((n, 3)) + [0.0, 0.0, 80.0]
    edges = daily_edges(T_DEP, T_DEP + days)
    first = start_state()
    end = impulsive_path(first, impulses, edges, 1.32712440018e20)[-1]
    leg = ContinuousLeg(first, kepler(end, T_DEP + days), T_DEP, 1500.0, 0.1, 39000.0)
    throttles = 1500.0 * impulses / (0.1 * days / n * DAY_S)
    assert np.linalg.norm(throttles, axis=1).max() < 1.0
    arc = refine_leg(leg, T_DEP + days, throttles, impulses_m_s=impulses)
    assert arc.converged
    assert arc.miss_km < 0.1


def test_averages_on_the_grid_keep_the_whole():
    throttles = np.random.default_rng(0).uniform(-1, 1, (7, 3))
    edges = daily_edges(T_DEP, T_DEP + 33.37)
    averages = on_grid(throttles, edges)
    np.testing.assert_allclose(np.diff(edges) @ averages, 33.37 / 7 * throttles.sum(axis=0))


def test_input_that_cannot_be_used_is_refused():
    leg, throttles = leg_to_nearby(40.0, (0.0, 100.0, 0.0))
    with pytest.raises(InputError, match="throttles"):
        refine_leg(leg, T_DEP + 40.0, np.zeros(3))
    with pytest.raises(InputError, match="not finite"):
        refine_leg(leg, T_DEP + 40.0, np.full_like(throttles, np.nan))
    with pytest.raises(InputError, match="not finite"):
        refine_leg(leg, T_DEP + 40.0, throttles, impulses_m_s=np.full_like(throttles, np.inf))
    with pytest.raises(InputError, match="after the departure"):
        refine_leg(leg, T_DEP - 1.0, throttles)
    with pytest.raises(InputError, match="m0_kg"):
        ContinuousLeg(leg.departure, leg.target, T_DEP, 0.0, 0.3, 3e4)
    with pytest.raises(InputError, match="departure"):
        ContinuousLeg(np.full(6, np.nan), leg.target, T_DEP, 1.0, 0.3, 3e4)
