"""A crew's asteroids: which probes stay at those of the mother ship's orbits."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from seqsearch.carriers.crew import WAIT_DAYS, Crew
from seqsearch.carriers.plans import Plan


def crew_of(*durations, orbits=(1, 2), ends=None):
    ends = ends or (len(orbits) - 1,) * len(durations)
    flights = tuple(
        SimpleNamespace(
            itinerary=SimpleNamespace(
                rows=np.array([1, 10 * k, 10 * k + 1, orbits[end]]), duration_days=days
            )
        )
        for k, (days, end) in enumerate(zip(durations, ends, strict=True), 1)
    )
    flights = tuple(
        SimpleNamespace(itinerary=_Sized(flight.itinerary), mass=np.array([801.0]))
        for flight in flights
    )
    return Crew(Plan(orbits, ends, ((9000.0, 9900.0),) * len(durations)), flights)


class _Sized:
    def __init__(self, itinerary):
        self.rows, self.duration_days = itinerary.rows, itinerary.duration_days

    def __len__(self):
        return len(self.rows) - 1


def test_a_probe_with_time_left_stays_at_the_orbits_asteroid_which_then_counts():
    crew = crew_of(2191.5, 2191.5 - WAIT_DAYS, 2191.0)
    assert crew.waits() in ((1, None), (None, 1))
    assert crew.visits() == 3 * 2 + 1


def test_both_asteroids_count_where_there_is_time_for_both():
    assert crew_of(2191.0, 2100.0, 2191.0).waits() == (1, 1)
    assert crew_of(2150.0, 2160.0, 2191.0).visits() == 3 * 2 + 2
    assert crew_of(2191.0, 2191.0, 2191.0).visits() == 3 * 2


def test_one_orbit_has_one_asteroid_that_counts_once():
    crew = crew_of(2100.0, 2000.0, 2191.0, orbits=(1,))
    assert crew.visits() == 3 * 2 + 1
    assert len(crew.waits()) == 1


def test_three_orbits_have_three_asteroids_for_probes_that_end_there():
    crew = crew_of(2150.0, 2100.0, 2150.0, orbits=(1, 2, 3), ends=(1, 2, 2))
    first, second, third = crew.waits()
    assert second == 0
    assert {first, third} <= {1, 2}
    assert crew.visits() == 3 * 2 + 3
    # Only the first probe ends on the second orbit, and it has no time.
    late = crew_of(2191.0, 2100.0, 2100.0, orbits=(1, 2, 3), ends=(1, 2, 2))
    assert late.waits()[1] is None
    assert late.visits() == 3 * 2 + 2


def test_closed_bodies_are_those_of_the_other_probes():
    assert crew_of(2000.0, 2000.0).closed(0) == (20, 21)
    assert crew_of(2000.0, 2000.0).closed() == (10, 11, 20, 21)


def test_more_days_are_worth_more_and_all_of_them_less_than_a_visit():
    # No stays: on a course that provides for none.
    course = SimpleNamespace(stays=(None, None))

    def worth(*durations):
        return replace(crew_of(*durations), course=course).worth()

    assert (
        worth(1900.0, 2191.0, 2191.0)
        > worth(1950.0, 2191.0, 2191.0)
        > worth(2191.0, 2191.0, 2191.0)
    )
    assert worth(2000.0, 2191.0, 2191.0) > worth(2100.0, 2091.0, 2191.0)
    assert worth(500.0, 500.0, 500.0) < 3 * 2 + 1
