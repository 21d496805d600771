"""Polishing: timetables against brute force, extensions, and tours that only get better."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from feasibility import FeasibilityClassifier, InputError, optimise
from feasibility.orbits import synthetic_main_belt
from feasibility.sims_flanagan import solve_max_initial_mass
from seqsearch import search, verify_tour
from seqsearch.polish import ExtensionSettings, PolishSettings, distinct_tours, polish
from seqsearch.polish.extension import Extender, Extension
from seqsearch.polish.flight import fly, tangents
from seqsearch.polish.itinerary import Itinerary
from seqsearch.polish.retiming import merit_days, retime
from tests.helpers.problems import small_problem, small_settings

QUICK = PolishSettings(
    rounds=1,
    moves_per_round=3,
    growth_share=0.4,
    extension=ExtensionSettings(width=4, neighbours=15, predicted=3, results=2),
)
# The belt of the tests is a third as dense as the official table: legs are long.
BROAD = ExtensionSettings(
    neighbours=80, predicted=12, tofs_days=(80.0, 110.0, 140.0, 170.0, 200.0, 240.0, 290.0, 350.0)
)


@pytest.fixture(scope="module")
def problem():
    # Dense enough for tours of five.
    belt = synthetic_main_belt(6000, np.random.default_rng(3))
    return small_problem(catalogue=belt, max_duration_days=900.0)


@pytest.fixture(scope="module")
def searched(problem):
    settings = small_settings(beam_width=8, solves_per_rank=100, pruner="default:0.99")
    return search(problem, settings=settings, rng=np.random.default_rng(5))


@pytest.fixture(scope="module")
def itinerary(problem, searched):
    return Itinerary.from_tour(problem, searched.tour)


@pytest.fixture(scope="module")
def predictor():
    return FeasibilityClassifier.load("default")


def _shortest_by_brute_force(problem, rows, begin, tofs_1, tofs_2):
    """Least duration of a tour of two legs over a grid of epochs, by the leg solver alone."""
    best = np.inf
    for t in begin:
        legs = [
            Itinerary(rows[:2], np.array([t]), np.array([tof])).legs(problem, problem.m0)
            for tof in tofs_1
        ]
        for one, tof_1 in zip(legs, tofs_1, strict=True):
            heaviest = solve_max_initial_mass(one)
            left = optimise(one, guess=heaviest)
            if not left.converged[0]:
                continue
            departure = t + tof_1 + problem.min_stay_days
            second = type(one).concatenate(
                [
                    Itinerary(rows[1:3], np.array([departure]), np.array([tof])).legs(
                        problem, left.m_final[0]
                    )
                    for tof in tofs_2
                ]
            )
            flyable = solve_max_initial_mass(second).m0 >= left.m_final[0]
            if flyable.any():
                best = min(best, tof_1 + problem.min_stay_days + tofs_2[np.argmax(flyable)])
    return best


def test_retiming_two_legs_is_as_good_as_brute_force(problem, itinerary):
    start = itinerary.part(0, 2)
    t = start.t_dep_mjd2000[0]
    narrow = replace(problem, first_departure_mjd2000=(t - 10.0, t + 10.0))
    found = retime(narrow, start).flight
    tofs_1 = found.itinerary.tof_days[0] + np.arange(-8.0, 17.0, 4.0)
    tofs_2 = found.itinerary.tof_days[1] + np.arange(-24.0, 33.0, 4.0)
    begin = np.linspace(t - 10.0, t + 10.0, 6)
    brute = _shortest_by_brute_force(narrow, start.rows, begin, tofs_1, tofs_2)
    assert np.isfinite(brute)
    assert found.keeps_rules(narrow)
    assert found.itinerary.duration_days <= brute + 0.1


def test_retiming_shortens_a_tour_of_the_search_and_keeps_the_rules(problem, itinerary):
    before = fly(problem, itinerary)
    after = retime(problem, itinerary)
    assert after.merit_days < merit_days(problem, before) - 1.0
    assert after.flight.keeps_rules(problem)
    assert np.array_equal(after.flight.itinerary.rows, itinerary.rows)


def test_retiming_buys_missing_propellant_with_time(problem, itinerary):
    shortest = retime(problem, itinerary).flight
    scarce = float(shortest.mass[-1]) + 15.0
    craft = replace(problem.spacecraft, m_dry=scarce)
    thrifty = retime(replace(problem, spacecraft=craft, max_duration_days=5000.0), itinerary)
    assert thrifty.flight.mass[-1] >= scarce
    assert thrifty.flight.itinerary.duration_days > shortest.itinerary.duration_days


def test_tangents_foretell_a_shifted_flight(problem, itinerary):
    flight = retime(problem, itinerary).flight
    model = tangents(problem, flight)
    base = flight.itinerary
    # A later and longer first leg, the others as they were: only it changes, but for its mass.
    for dt, dtof in ((1.0, 0.0), (0.0, 1.0), (-1.0, 2.0)):
        moved = fly(
            problem,
            replace(base, t_dep_mjd2000=base.t_dep_mjd2000 + dt, tof_days=base.tof_days + dtof),
        )
        expected = model.m_star_t * dt + model.m_star_tof * dtof
        assert np.log(moved.m_star / flight.m_star) == pytest.approx(expected, abs=1.5e-3)


@pytest.mark.parametrize(("before", "after"), [(0, 1), (0, 2), (1, 0), (2, 0)])
def test_extensions_keep_what_is_kept_and_repeat_nothing(
    problem, itinerary, predictor, before, after
):
    flight = fly(problem, itinerary)
    last = itinerary.n_asteroids - 1
    extension = Extension(1 if before else 0, last if before else last - 1, before, after)
    kept = itinerary.part(extension.first, extension.last)
    extender = Extender(problem, predictor, BROAD)
    avoid = np.setdiff1d(itinerary.rows, kept.rows)
    found = extender.extend(flight, extension, avoid=avoid)
    assert found
    for new in found:
        assert new.n_asteroids == kept.n_asteroids + before + after == len(set(new.rows))
        assert not np.isin(new.rows, avoid).any()
        old = new.part(before, before + len(kept))
        assert np.array_equal(old.rows, kept.rows)
        assert np.array_equal(old.t_dep_mjd2000, kept.t_dep_mjd2000)
        stays = new.t_dep_mjd2000[1:] - new.t_arr_mjd2000[:-1]
        assert (stays >= problem.min_stay_days - 1e-9).all()


def test_a_new_start_is_one_that_the_problem_allows(problem, itinerary, predictor):
    starts = tuple(int(body) for body in problem.catalogue.ids[::2])
    halved = replace(problem, start_ids=starts)
    flight = fly(problem, itinerary)
    extender = Extender(halved, predictor, BROAD)
    extension = Extension(0, itinerary.n_asteroids - 1, 1, 0)
    found = extender.extend(flight, extension, avoid=np.zeros(0, dtype=np.intp))
    assert found
    assert np.isin([new.rows[0] for new in found], halved.start_rows()).all()


def test_polished_tours_verify_and_are_never_worse(problem, searched, predictor):
    tours = distinct_tours(problem, searched.tree, 3)
    best = max(tours, key=lambda tour: (tour.n_asteroids, -tour.duration_days))
    result = polish(
        problem, tours, predictor=predictor, rng=np.random.default_rng(2), settings=QUICK
    )
    assert verify_tour(result.tour).passed
    assert (result.tour.n_asteroids, -result.tour.duration_days) > (
        best.n_asteroids,
        -best.duration_days,
    )
    keys = [(step.n_asteroids, -step.duration_days) for step in result.steps]
    assert keys == sorted(keys)
    assert result.moves == 3
    assert result.steps[0].duration_days == best.duration_days


def test_the_same_seed_polishes_the_same_with_any_executor(problem, searched, predictor):
    def run(seed, executor):
        return polish(
            problem,
            searched.tour,
            predictor=predictor,
            rng=np.random.default_rng(seed),
            executor=executor,
            settings=QUICK,
        )

    with ThreadPoolExecutor(2) as executor:
        parallel = run(3, executor)
    alone = run(3, None)
    assert parallel.tour == alone.tour
    assert [replace(step, seconds=0.0) for step in parallel.steps] == [
        replace(step, seconds=0.0) for step in alone.steps
    ]


def test_without_time_the_best_given_tour_comes_back(problem, searched, predictor):
    result = polish(problem, searched.tour, predictor=predictor, time_limit_s=1e-9)
    assert result.tour == searched.tour
    assert result.stopped == "time limit"
    with pytest.raises(InputError, match="no tour"):
        polish(problem, [], predictor=predictor)


def test_distinct_tours_are_the_best_and_differ(problem, searched):
    tours = distinct_tours(problem, searched.tree, 4)
    assert tours[0].n_asteroids == searched.tour.n_asteroids
    assert [t.n_asteroids for t in tours] == sorted([t.n_asteroids for t in tours], reverse=True)
    bodies = [{body.id for body in tour.bodies} for tour in tours]
    assert len(tours) > 1
    for i, mine in enumerate(bodies):
        for other in bodies[:i]:
            assert len(mine & other) <= 0.7 * len(mine)
