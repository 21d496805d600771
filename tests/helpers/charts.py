"""A small dense belt and the chart of its legs, for tests of carriers."""

import functools
from dataclasses import dataclass

import numpy as np

from feasibility import FeasibilityClassifier, Legs
from feasibility.legs import Spacecraft
from feasibility.orbits import synthetic_main_belt
from feasibility.orbits.neighbours import orbital_metric
from seqsearch.carriers.leg_chart import STEP_DAYS, ChartMaker, LegChart
from seqsearch.problems.rendezvous import RendezvousProblem

CRAFT = Spacecraft(m_dry=800.0, thrust=0.3, isp=3000.0)
M0 = 2000.0
T0 = 8000.0
INTERVALS = 26
DURATION_DAYS = 1500.0


@dataclass(frozen=True)
class World:
    """Everything that a beam over a chart needs."""

    problem: RendezvousProblem
    predictor: FeasibilityClassifier
    maker: ChartMaker
    chart: LegChart


@functools.cache
def charted() -> World:
    """Return the thousand bodies that are nearest to one of a belt, with their chart."""
    belt = synthetic_main_belt(16_000, np.random.default_rng(5))
    points = orbital_metric(belt.states(T0 + 0.5 * INTERVALS * STEP_DAYS), 150.0)
    a = belt.elements[:, 0]
    middle = int(np.argmin(np.abs(a - np.median(a))))
    away = np.linalg.norm(points - points[middle], axis=1)
    catalogue = belt.select(np.sort(np.argsort(away)[:1000]))
    predictor = FeasibilityClassifier.load("default")
    problem = RendezvousProblem(
        name="belt",
        catalogue=catalogue,
        spacecraft=CRAFT,
        m0=M0,
        first_departure_mjd2000=(T0, T0 + 200.0),
        max_duration_days=DURATION_DAYS,
        min_stay_days=30.0,
    )
    rows = np.arange(len(catalogue))
    maker = ChartMaker(catalogue, rows, CRAFT, M0, predictor, T0)
    parts = [maker.part(k) for k in range(INTERVALS + 1)]
    return World(problem, predictor, maker, LegChart.of_parts(rows, T0, parts))


def known_legs(world: World, source, target, t_dep, tof) -> Legs:
    """Return the legs between bodies of the chart, for a full spacecraft."""
    catalogue, rows = world.problem.catalogue, world.chart.rows
    return Legs(
        rv_dep=catalogue.states_at(rows[source], t_dep),
        rv_arr=catalogue.states_at(rows[target], t_dep + tof),
        tof_days=tof,
        m0=M0,
        thrust=CRAFT.thrust,
        isp=CRAFT.isp,
        m_dry=CRAFT.m_dry,
    )
