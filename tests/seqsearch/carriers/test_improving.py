"""What an attempt to improve a crew keeps of it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from seqsearch.carriers import improving
from seqsearch.carriers.crew import Crew
from seqsearch.carriers.homing import HomingSettings
from seqsearch.carriers.plans import Plan

PLAN = Plan((1, 2, 3), (1, 1, 2), ((9000.0, 9250.0), (9000.0, 9250.0), (9700.0, 10000.0)))


def _flight(rows, begin):
    itinerary = SimpleNamespace(rows=np.array(rows), t_dep_mjd2000=np.array([begin, begin + 99.0]))
    return SimpleNamespace(itinerary=itinerary)


@pytest.fixture
def crew():
    flights = (
        _flight([1, 10, 11, 2], 9100.0),
        _flight([1, 20, 21, 2], 9200.0),
        _flight([1, 30, 31, 3], 9800.0),
    )
    return Crew(PLAN, flights)


@pytest.fixture
def kept(monkeypatch, crew):
    """Return a function that tells which tours of the crew are kept for a plan."""

    def of(plan, number=0, crew=crew):
        asked = {}

        def find_crew(screen, problem, plan, settings, kept):
            asked.update(plan=plan, kept=kept)
            return replace(crew, plan=plan)

        monkeypatch.setattr(improving, "find_crew", find_crew)
        monkeypatch.setattr(improving, "carrier_of", lambda *_: object())
        monkeypatch.setattr(improving, "variations", lambda *_: iter([plan]))
        rng = np.random.default_rng(0)
        found = improving.replanned(None, None, crew, number, rng, HomingSettings())
        assert found.plan == asked["plan"] == plan
        assert all(flight is crew.flights[k] for k, flight in asked["kept"].items())
        return set(asked["kept"])

    return of


def test_tours_to_orbits_that_stay_are_kept_but_for_one(kept):
    assert kept(replace(PLAN, orbits=(1, 2, 4)), number=0) == {1}
    assert kept(replace(PLAN, orbits=(1, 2, 4)), number=2) == {0, 1}
    assert kept(replace(PLAN, orbits=(1, 5, 3)), number=0) == {2}
    assert kept(replace(PLAN, orbits=(6, 2, 3)), number=0) == set()


def test_tours_outside_of_the_windows_or_to_an_orbits_asteroid_are_not(kept):
    early = ((9150.0, 9400.0), (9150.0, 9400.0), PLAN.windows_mjd2000[2])
    assert kept(replace(PLAN, windows_mjd2000=early), number=2) == {1}
    assert kept(replace(PLAN, orbits=(1, 2, 20)), number=2) == {0}


def test_on_a_course_no_tour_is_kept(kept, crew):
    course = SimpleNamespace(stays=(None, None, None))
    assert kept(PLAN, crew=replace(crew, course=course)) == set()


def test_a_crew_without_a_varied_plan_stays_as_it_is(monkeypatch, crew):
    monkeypatch.setattr(improving, "variations", lambda *_: iter(()))
    rng = np.random.default_rng(0)
    assert improving.replanned(None, None, crew, 0, rng, HomingSettings()) is None
