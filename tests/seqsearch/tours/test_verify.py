"""Verification: a good tour passes, and every kind of tampering is found."""

import msgspec
import numpy as np
import pytest

from feasibility.orbits import synthetic_main_belt
from seqsearch import search, verify_tour
from seqsearch.tours.tour_files import read_tour, to_csv, to_json
from seqsearch.tours.verify import body_state
from tests.helpers.problems import small_problem, small_settings


@pytest.fixture(scope="module")
def problem():
    return small_problem()


@pytest.fixture(scope="module")
def tour(problem):
    result = search(problem, settings=small_settings(), rng=np.random.default_rng(4))
    assert result.tour.n_asteroids >= 3
    return result.tour


def _failed(tour, catalogue=None):
    return {check.name for check in verify_tour(tour, catalogue).checks if not check.passed}


def _change_leg(tour, k, **changes):
    legs = list(tour.legs)
    legs[k] = msgspec.structs.replace(legs[k], **changes)
    return msgspec.structs.replace(tour, legs=tuple(legs))


def _change_impulse(tour, k, i, **changes):
    impulses = list(tour.legs[k].impulses)
    impulses[i] = msgspec.structs.replace(impulses[i], **changes)
    return _change_leg(tour, k, impulses=tuple(impulses))


def _change_rules(tour, **changes):
    return msgspec.structs.replace(tour, rules=msgspec.structs.replace(tour.rules, **changes))


def test_a_found_tour_passes(tour, problem):
    verification = verify_tour(tour, problem.catalogue)
    assert verification.passed, verification.table()
    assert "position at each arrival" in verification.table()


def test_bodies_are_where_the_catalogue_says(tour, problem):
    rows = problem.catalogue.rows_of([body.id for body in tour.bodies])
    for body, row in zip(tour.bodies, rows, strict=True):
        for t in (0.0, 7671.5, 20000.0):
            state = body_state(body, t, tour.rules.mu_m3_s2)
            expected = problem.catalogue.states_at([row], [t])[0]
            assert np.allclose(state[:3], expected[:3], rtol=0, atol=10.0)
            assert np.allclose(state[3:], expected[3:], rtol=0, atol=1e-6)


def test_a_missed_arrival_is_found(tour):
    dv = np.add(tour.legs[0].impulses[3].dv_m_s, [0.0, 30.0, 0.0])
    failed = _failed(_change_impulse(tour, 0, 3, dv_m_s=tuple(dv)))
    assert {"position at each arrival", "velocity at each arrival"} <= failed
    assert "impulses are thrust x time x throttle / mass" in failed


def test_a_shifted_epoch_is_found(tour):
    # Leaving or arriving a day earlier is ballistic with the body itself: only the model breaks.
    shifted = _change_leg(tour, 0, t_dep_mjd2000=tour.legs[0].t_dep_mjd2000 - 1.0)
    assert _failed(shifted) == {"impulses at segment centres"}
    late = _change_impulse(tour, 0, 0, t_mjd2000=tour.legs[0].impulses[0].t_mjd2000 + 1.0)
    assert {"impulses at segment centres", "position at each arrival"} <= _failed(late)


def test_a_short_stay_is_found(tour):
    first = tour.legs[0]
    late = tour.legs[1].t_dep_mjd2000 - 10.0 - first.t_dep_mjd2000
    assert "stays" in _failed(_change_leg(tour, 0, tof_days=late))


def test_too_much_thrust_is_found(tour):
    throttle = tuple(np.add(tour.legs[0].impulses[0].throttle, [3.0, 0.0, 0.0]))
    assert "throttles" in _failed(_change_impulse(tour, 0, 0, throttle=throttle))


def test_free_propellant_is_found(tour):
    mass = tour.legs[0].impulses[0].mass_after_kg + 5.0
    failed = _failed(_change_impulse(tour, 0, 0, mass_after_kg=mass))
    assert {"mass continuous along the tour", "rocket equation at each impulse"} <= failed
    lighter = _change_leg(tour, 1, m0_kg=tour.legs[1].m0_kg - 5.0)
    assert "mass continuous along the tour" in _failed(lighter)


def test_rules_that_the_tour_breaks_are_found(tour):
    assert "final mass" in _failed(_change_rules(tour, m_dry_kg=1990.0))
    assert "duration" in _failed(_change_rules(tour, max_duration_days=100.0))
    assert "first departure in the window" in _failed(
        _change_rules(tour, first_departure_mjd2000=(0.0, 1.0))
    )
    assert "start body allowed" in _failed(_change_rules(tour, start_ids=(-5,)))
    assert "stays" in _failed(_change_rules(tour, min_stay_days=31.0))


def test_a_body_twice_and_a_broken_chain_are_found(tour):
    bodies = (*tour.bodies[:-1], tour.bodies[0])
    failed = _failed(msgspec.structs.replace(tour, bodies=bodies))
    assert {"no body twice", "legs join the bodies in order"} <= failed


def test_elements_of_another_table_are_found(tour):
    other = synthetic_main_belt(1500, np.random.default_rng(99))
    assert _failed(tour, other) == {"elements as in the table"}


def test_tours_survive_a_round_trip(tour, tmp_path):
    path = tmp_path / "sequence.json"
    path.write_text(to_json(tour))
    assert read_tour(path) == tour
    rows = to_csv(tour).strip().split("\n")
    assert len(rows) == 1 + len(tour.legs)
    assert all(row.count(",") == rows[0].count(",") for row in rows)
