"""A small dense belt and the curves of its legs, for tests of beams over a chart."""

import functools
from dataclasses import dataclass

import numpy as np

from feasibility import FeasibilityClassifier
from feasibility.orbits import synthetic_main_belt
from feasibility.orbits.neighbours import orbital_metric
from seqsearch.beam.scouting.charted import survey_of
from seqsearch.chart.curves import CurveChart, Survey
from seqsearch.chart.making import make_chart
from seqsearch.problems.rendezvous import RendezvousProblem
from seqsearch.settings import SearchSettings
from tests.helpers.charts import CRAFT

M0 = 1265.0
T0 = 8000.0
SETTINGS = SearchSettings(tof_days_min=40.0, tof_days_max=240.0)


@dataclass(frozen=True)
class Roamed:
    """Everything that a beam over a chart needs."""

    problem: RendezvousProblem
    predictor: FeasibilityClassifier
    survey: Survey
    chart: CurveChart


@functools.cache
def dense_problem() -> RendezvousProblem:
    """Return a problem in the thousand bodies that are nearest to one of a belt."""
    belt = synthetic_main_belt(16_000, np.random.default_rng(5))
    points = orbital_metric(belt.states(T0 + 400.0), 150.0)
    a = belt.elements[:, 0]
    middle = int(np.argmin(np.abs(a - np.median(a))))
    away = np.linalg.norm(points - points[middle], axis=1)
    return RendezvousProblem(
        name="belt",
        catalogue=belt.select(np.sort(np.argsort(away)[:1000])),
        spacecraft=CRAFT,
        m0=2000.0,
        first_departure_mjd2000=(T0, T0 + 80.0),
        max_duration_days=800.0,
        min_stay_days=30.0,
    )


@functools.cache
def roamed() -> Roamed:
    """Return that problem with its chart."""
    problem = dense_problem()
    predictor = FeasibilityClassifier.load("default")
    survey = survey_of(problem, SETTINGS)
    chart = make_chart(survey, predictor)
    assert chart is not None
    return Roamed(problem, predictor, survey, chart)
