"""The hint of the least propellant of legs with free ends."""

import numpy as np
import pytest

from feasibility.classifier.margin.final_mass import full_thrust_velocity
from feasibility.classifier.margin.free_features import features_and_excess, log_free_acceleration
from feasibility.classifier.margin.free_final_mass import (
    FREE_FINAL_MASS_INPUTS,
    free_inputs_and_base,
)
from feasibility.sims_flanagan.fast.solver import fast_max_initial_mass, fast_min_propellant
from tests.helpers.free_legs import free_legs

BOUNDS = [(2000.0, 0.0), (0.0, 2000.0), (1500.0, np.inf)]


def inputs_of(legs, log_margin):
    X, hint, excess = features_and_excess(legs)
    assert np.isfinite(hint).all()
    return free_inputs_and_base(legs, X, excess, log_margin)


def test_every_input_has_a_name_and_is_finite():
    legs = free_legs(30, 1, 1500.0, np.inf, far=0.05)
    for log_margin in (0.0, 1.0, np.inf):
        inputs, base = inputs_of(legs, np.full(30, log_margin))
        assert inputs.shape == (30, len(FREE_FINAL_MASS_INPUTS))
        assert len(set(FREE_FINAL_MASS_INPUTS)) == len(FREE_FINAL_MASS_INPUTS)
        assert np.isfinite(inputs).all()
        full = full_thrust_velocity(legs, np.full(30, min(log_margin, 8.0)))
        assert (base >= 0.0).all()
        assert (base <= full * (1.0 + 1e-12)).all()


@pytest.mark.parametrize("ends", BOUNDS)
def test_the_hint_is_near_the_solved_propellant(ends):
    legs = free_legs(120, 5, *ends, far=0.05)
    solved = fast_max_initial_mass(legs)
    heavy = np.flatnonzero(solved.converged & np.isfinite(solved.m0))
    legs = legs.take(heavy).with_m0(np.maximum(0.6 * solved.m0[heavy], 101.0))
    least = fast_min_propellant(legs)
    margin = log_free_acceleration(legs, legs.m0) - log_free_acceleration(legs, solved.m0[heavy])
    _, base = inputs_of(legs, margin)
    change = -legs.exhaust_velocity * np.log(least.m_final / legs.m0)
    rows = np.flatnonzero(least.converged & (change > 10.0))
    assert len(rows) > 20
    assert np.median(np.abs(np.log(base / change))[rows]) < 0.1
