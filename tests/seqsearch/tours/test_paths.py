"""Where bodies and tours are: against the verifier's own motion."""

import numpy as np
import pytest

from feasibility.constants import MU_SUN
from feasibility.errors import InputError
from seqsearch import verify_tour
from seqsearch.tours.motion import body_state, fly
from seqsearch.tours.paths import body_states, impulsive_trajectory, orbit_points
from tests.helpers.handmade_tours import handmade_tour


def test_the_handmade_tour_is_a_tour():
    verification = verify_tour(handmade_tour())
    assert verification.passed, verification.table()


def test_bodies_are_where_the_verification_has_them():
    epochs = np.linspace(-3000.0, 20000.0, 40)
    for body in handmade_tour().bodies:
        expected = [body_state(body, t, MU_SUN) for t in epochs]
        found = body_states(body, epochs, MU_SUN)
        assert np.abs(found - expected)[:, :3].max() < 1.0
        assert np.abs(found - expected)[:, 3:].max() < 1e-6


def test_a_body_lies_on_its_orbit():
    body = handmade_tour().bodies[1]
    ring = orbit_points(body, 20_001)
    assert np.array_equal(ring[0], ring[-1]) or np.abs(ring[0] - ring[-1]).max() < 1e-3
    at = body_state(body, 8123.0, MU_SUN)[:3]
    assert np.linalg.norm(ring - at, axis=1).min() < body.a_m * 2e-4


def test_the_rows_of_a_tour_end_where_its_legs_do():
    tour = handmade_tour()
    trajectory = impulsive_trajectory(tour)
    assert not trajectory.continuous
    assert [(p.start, p.end) for p in trajectory.phases] == [
        ("11", "12"),
        ("12", "13"),
        ("13", "14"),
    ]
    for leg, phase in zip(tour.legs, trajectory.phases, strict=True):
        end = fly(leg, tour.body(leg.from_id), MU_SUN)
        assert np.abs(phase.states[-1] - end)[:3].max() < 1e3
        assert np.diff(phase.t_mjd2000).max() <= 1.0
        assert phase.mass_kg[0] == leg.m0_kg
        assert phase.mass_kg[-1] == leg.m_final_kg
        # Each impulse is a jump: two rows of one epoch.
        jumps = np.flatnonzero(np.diff(phase.t_mjd2000) == 0.0)
        assert len(jumps) == len(leg.impulses)
        dv = phase.states[jumps + 1, 3:] - phase.states[jumps, 3:]
        assert np.allclose(dv, [impulse.dv_m_s for impulse in leg.impulses], atol=1e-9)


def test_a_tour_without_legs_has_no_rows():
    with pytest.raises(InputError, match="no leg"):
        impulsive_trajectory(handmade_tour(names=("Alpha",)))
