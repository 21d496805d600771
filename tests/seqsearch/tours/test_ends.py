"""Ends that rules ask for, bodies that have to be visited, and bodies without a score."""

import msgspec

from seqsearch.tours.ends import check_ends, visited_twice
from tests.helpers.handmade_tours import handmade_tour

TOUR = handmade_tour()
A, B = TOUR.bodies[0], TOUR.bodies[1]


def _rules(**changes):
    return msgspec.structs.replace(TOUR.rules, **changes)


def _failed(rules, bodies):
    return [check.name for check in check_ends(rules, bodies) if not check.passed]


def test_rules_without_an_end_ask_nothing():
    assert check_ends(TOUR.rules, TOUR.bodies) == []
    assert TOUR.rules.visits(TOUR.bodies) == TOUR.bodies


def test_a_tour_may_end_where_it_began_only_if_it_has_to():
    ids = [A.id, B.id, A.id]
    assert visited_twice(TOUR.rules, ids) == [A.id]
    assert visited_twice(_rules(end_id=A.id), ids) == []
    assert visited_twice(_rules(end_id=B.id), ids) == [A.id]
    assert visited_twice(_rules(end_id=A.id), [A.id, B.id, B.id, A.id]) == [B.id]


def test_the_end_is_checked():
    rules = _rules(end_id=A.id)
    assert _failed(rules, (A, B, A)) == []
    assert _failed(rules, (A, B)) == ["ends at the body asked for"]
    assert _failed(rules, (A,)) == ["ends at the body asked for"]


def test_a_start_that_is_the_end_counts_once():
    assert _rules(end_id=A.id).visits((A, B, A)) == (A, B)


def test_bodies_without_a_score_do_not_count():
    rules = _rules(end_id=A.id, unscored=(A,))
    assert rules.visits((A, B, A)) == (B,)
    assert _rules(unscored=(A,)).visits((A, B)) == (B,)


def test_bodies_that_have_to_be_visited_are_missed():
    assert _failed(_rules(must_visit=(B.id,)), (A, B)) == []
    assert _failed(_rules(must_visit=(B.id,)), (A,)) == ["bodies that have to be visited"]


def test_another_orbit_of_a_body_without_a_score_is_noticed():
    moved = msgspec.structs.replace(A, mean_anomaly_rad=A.mean_anomaly_rad + 1e-6)
    rules = _rules(unscored=(A,))
    assert _failed(rules, (A, B)) == []
    assert _failed(rules, (moved, B)) == ["elements of bodies without a score"]


def test_files_say_nothing_of_ends_that_are_free():
    text = msgspec.json.encode(TOUR.rules).decode()
    assert not any(name in text for name in ("end_id", "must_visit", "unscored"))
