"""Polishing of tours that have to end at a body."""

import numpy as np
import pytest

from feasibility import FeasibilityClassifier
from seqsearch import search, verify_tour
from seqsearch.core.ending import ending_of, fixed_start
from seqsearch.polish import PolishSettings, distinct_tours, polish
from seqsearch.polish.extension import Extender, Extension
from seqsearch.polish.flight import fly
from seqsearch.polish.itinerary import Itinerary
from tests.helpers.ended_problems import BODY, MOTHER, round_trip
from tests.helpers.problems import small_settings


@pytest.fixture(scope="module")
def problem():
    return round_trip(BODY)


@pytest.fixture(scope="module")
def searched(problem):
    return search(problem, settings=small_settings(start_epochs=12))


@pytest.fixture(scope="module")
def predictor():
    return FeasibilityClassifier.load()


def test_both_ends_stay_where_they_are(problem, searched, predictor):
    settings = PolishSettings(rounds=2, moves_per_round=3)
    tours = [searched.tour, *distinct_tours(problem, searched.tree, 2)]
    result = polish(problem, tours, predictor=predictor, settings=settings)
    ids = [body.id for body in result.tour.bodies]
    assert ids[0] == ids[-1] == MOTHER
    better = (result.tour.n_asteroids, -result.tour.duration_days)
    assert better >= (searched.tour.n_asteroids, -searched.tour.duration_days)
    assert verify_tour(result.tour).passed


@pytest.mark.parametrize("at_start", [False, True])
def test_new_bodies_come_between_the_ends(problem, searched, predictor, at_start):
    flight = fly(problem, Itinerary.from_tour(problem, searched.tour))
    rows = flight.itinerary.rows
    last = len(rows) - 1
    # In so thin a belt one is exchanged at the start, and one comes on top at the end.
    extension = Extension(2, last, 1, 0) if at_start else Extension(0, last - 1, 0, 1)
    nothing = np.zeros(0, dtype=np.intp)
    found = Extender(problem, predictor).extend(flight, extension, avoid=nothing)
    assert found
    for itinerary in found:
        new = itinerary.rows
        assert len(new) == len(rows) + (not at_start)
        assert new[0] == fixed_start(problem)
        assert new[-1] == ending_of(problem).row
        assert len(set(new[:-1])) == len(new) - 1
        kept = (new[2:], rows[2:]) if at_start else (new[:-2], rows[:-1])
        np.testing.assert_array_equal(*kept)


def test_a_tour_without_its_last_leg_gets_one(problem, searched, predictor):
    whole = Itinerary.from_tour(problem, searched.tour)
    part = whole.part(0, len(whole.rows) - 2)
    ended = part.ended(problem, ending_of(problem), predictor, searched.tour.m_final_kg)
    np.testing.assert_array_equal(ended.rows, whole.rows)
    assert whole.ended(problem, ending_of(problem), predictor, 900.0) is whole
