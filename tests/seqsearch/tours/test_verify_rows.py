from dataclasses import replace as replaced

import msgspec
import numpy as np
import pytest

from feasibility import InputError
from seqsearch.refine import refine_tour
from seqsearch.tours.trajectory import Phase, Trajectory
from seqsearch.tours.verify_rows import Tolerances, verify_rows
from tests.helpers.handmade_tours import handmade_tour

USUAL, FINE = Tolerances(), Tolerances(1.0, 1e-3)


@pytest.fixture(scope="module")
def tour():
    return handmade_tour()


@pytest.fixture(scope="module")
def flown(tour):
    return refine_tour(tour).trajectory


def _failed(tour, trajectory, tolerances=USUAL, **rules):
    bodies = {str(body.id): body for body in tour.bodies}
    rules = msgspec.structs.replace(tour.rules, **rules)
    outcome = verify_rows(trajectory, bodies, rules, tolerances)
    return [check.name for check in outcome.checks if not check.passed]


def _changed(trajectory, k, start=None, end=None, **columns):
    """Return a trajectory with other columns, or names, in a phase; each given by a function."""
    phases = list(trajectory.phases)
    old = phases[k]
    kept = {name: getattr(old, name) for name in ("t_mjd2000", "states", "mass_kg", "thrust_n")}
    for name, change in columns.items():
        column = kept[name].copy()
        change(column)
        kept[name] = column
    phases[k] = Phase(start or old.start, end or old.end, **kept)
    return replaced(trajectory, phases=tuple(phases))


def _add(where, value):
    def change(column):
        column[where] += value

    return change


def _times(where, factor):
    def change(column):
        column[where] *= factor

    return change


def test_what_was_refined_passes(tour, flown):
    assert _failed(tour, flown, FINE) == []


@pytest.mark.parametrize(
    ("columns", "failed"),
    [
        ({"states": _add((7, 0), 2e3)}, "motion from each row to the next"),
        ({"states": _add((7, 4), 0.01)}, "motion from each row to the next"),
        ({"states": _add((-1, 1), 2e6)}, "position at each arrival"),
        ({"states": _add((-1, 5), 2.0)}, "velocity at each arrival"),
        ({"states": _add((0, 1), 2e6)}, "position at each departure"),
        ({"states": _add((0, 5), 2.0)}, "velocity at each departure"),
        ({"thrust_n": _times(slice(None), 1.01)}, "thrust"),
        ({"thrust_n": _times(slice(0, 9), -1.0)}, "position at each arrival"),
        ({"thrust_n": _times(slice(0, 9), 0.5)}, "mass flow is thrust over exhaust velocity"),
        ({"mass_kg": _add(5, 0.5)}, "mass flow is thrust over exhaust velocity"),
        ({"mass_kg": _add(slice(None), 5.0)}, "mass at the first departure"),
        ({"t_mjd2000": _add(slice(None), -200.0)}, "first departure in the window"),
        ({"t_mjd2000": _add(slice(None), 1.0)}, "position at each departure"),
    ],
)
def test_each_kind_of_tampering_fails(tour, flown, columns, failed):
    assert failed in _failed(tour, _changed(flown, 0, **columns))


@pytest.mark.parametrize(
    ("rules", "failed"),
    [
        ({"min_stay_days": 36.0}, "stays"),
        ({"max_duration_days": 300.0}, "duration"),
        ({"first_departure_mjd2000": (7900.0, 7950.0)}, "first departure in the window"),
        ({"start_ids": (12,)}, "start body allowed"),
        ({"m_dry_kg": 1999.0}, "final mass"),
        ({"m0_kg": 2001.0}, "mass at the first departure"),
        ({"thrust_n": 0.29}, "thrust"),
        ({"isp_s": 3100.0}, "mass flow is thrust over exhaust velocity"),
    ],
)
def test_each_rule_is_checked(tour, flown, rules, failed):
    assert failed in _failed(tour, flown, **rules)


def test_small_jumps_in_every_row_do_not_add_up_unseen(tour, flown):
    # Each row is 0.9 km off the motion, which one row may be: together they are 100 km.
    def drift(states):
        states[:, 0] += 900.0 * np.arange(len(states))

    failed = _failed(tour, _changed(flown, 0, states=drift), Tolerances(50.0, 1.0))
    assert "position at each arrival" in failed


def test_bodies_out_of_order_or_met_twice_fail(tour, flown):
    assert "phases join" in _failed(tour, _changed(flown, 1, start="14"))
    assert "no body twice" in _failed(tour, _changed(flown, 1, end="11"))


def test_mass_that_changes_between_phases_fails(tour, flown):
    for change in (5.0, -5.0):
        other = _changed(flown, 1, mass_kg=_add(slice(None), change))
        assert "mass from phase to phase" in _failed(tour, other)


def test_impulses_fail(tour, flown):
    old = flown.phases[0]
    twice = np.sort(np.append(np.arange(len(old)), 10))
    columns = (old.t_mjd2000, old.states, old.mass_kg, old.thrust_n)
    doubled = Phase(old.start, old.end, *(column[twice] for column in columns))
    trajectory = Trajectory((doubled, *flown.phases[1:]), continuous=True)
    assert _failed(tour, trajectory) == []
    jumped = _changed(trajectory, 0, states=_add((11, 3), 10.0))
    assert "motion from each row to the next" in _failed(tour, jumped)


def test_a_stranger_among_the_bodies_is_refused(tour, flown):
    with pytest.raises(InputError, match="no body 'MARS'"):
        _failed(tour, _changed(flown, 2, end="MARS"))
