"""Scouting over a chart: when it is done, and that what it finds is in the tree."""

from dataclasses import replace

import numpy as np
import pytest

from feasibility import FeasibilityClassifier
from seqsearch.beam.best_tour import BestTour
from seqsearch.beam.scouting.charted import ChartedPasses, chart_fits
from seqsearch.beam.state import SearchState
from seqsearch.budget import Budget
from seqsearch.core.recording import record_tour
from seqsearch.tours.verify import verify_tour
from tests.helpers.curve_charts import SETTINGS, T0, dense_problem


class Counting:
    """A `Scouting` that counts how often it is asked."""

    active = True

    def __init__(self):
        self.calls = 0

    def guide(self, state, rng):
        self.calls += 1
        return False


@pytest.fixture(scope="module")
def problem():
    return replace(
        dense_problem(), first_departure_mjd2000=(T0, T0 + 40.0), max_duration_days=420.0
    )


def _passes(problem, inner, seconds):
    budget = Budget(seconds)
    return ChartedPasses(
        inner,
        problem,
        FeasibilityClassifier.load("default"),
        SETTINGS,
        best=BestTour(problem, SETTINGS),
        budget=budget,
        executor=None,
        threads=1,
    )


def test_from_the_third_pass_on_tours_over_the_chart_are_flown(problem):
    inner, state = Counting(), SearchState(settings=SETTINGS)
    passes = _passes(problem, inner, 600.0)
    state.pass_number = 2
    assert not passes.guide(state, np.random.default_rng(0))
    assert inner.calls == 1
    state.pass_number = 3
    assert passes.guide(state, np.random.default_rng(0))
    assert inner.calls == 1
    assert state.guide is not None
    assert state.best_key[0] == state.guide.depth.max() >= 2
    assert state.counters[-1].kept >= len(state.guide)
    tour = record_tour(problem, state.tree, state.best_node)
    assert tour.n_asteroids == state.best_key[0] + 1
    assert all(check.passed for check in verify_tour(tour).checks)


def test_without_time_for_a_chart_scouts_are_sent_out(problem):
    inner, state = Counting(), SearchState(settings=SETTINGS, pass_number=3)
    assert not _passes(problem, inner, 1.0).guide(state, np.random.default_rng(0))
    assert inner.calls == 1


def test_charts_are_for_long_limits_many_bodies_and_free_ends(problem):
    assert chart_fits(problem, SETTINGS, Budget(600.0), 1)
    assert not chart_fits(problem, SETTINGS, Budget(None), 1)
    assert not chart_fits(problem, SETTINGS, Budget(1.0), 1)
    ids = problem.catalogue.ids
    assert not chart_fits(replace(problem, end_id=int(ids[0])), SETTINGS, Budget(600.0), 1)
    ordered = replace(problem, sequence=(int(ids[0]), int(ids[1])))
    assert not chart_fits(ordered, SETTINGS, Budget(600.0), 1)
    few = replace(problem, catalogue=problem.catalogue.select(np.arange(900)))
    assert not chart_fits(few, SETTINGS, Budget(600.0), 1)
