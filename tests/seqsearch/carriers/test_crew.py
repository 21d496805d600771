"""A crew's asteroids: which probes stay at those of the mother ship's orbits."""

from types import SimpleNamespace

import numpy as np

from seqsearch.carriers.crew import WAIT_DAYS, Crew
from seqsearch.carriers.plans import Plan


def crew_of(*durations, second=2):
    flights = tuple(
        SimpleNamespace(
            itinerary=SimpleNamespace(
                rows=np.array([1, 10 * k, 10 * k + 1, second]), duration_days=days
            )
        )
        for k, days in enumerate(durations, 1)
    )
    flights = tuple(
        SimpleNamespace(itinerary=_Sized(flight.itinerary), mass=np.array([801.0]))
        for flight in flights
    )
    return Crew(Plan(1, second, 9000.0, 0.0), flights)


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
    crew = crew_of(2100.0, 2000.0, 2191.0, second=1)
    assert crew.visits() == 3 * 2 + 1
    assert crew.waits()[1] is None


def test_closed_bodies_are_those_of_the_other_probes():
    assert crew_of(2000.0, 2000.0).closed(0) == (20, 21)
    assert crew_of(2000.0, 2000.0).closed() == (10, 11, 20, 21)
