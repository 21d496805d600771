"""Small problems that several tests share."""

from dataclasses import replace
from typing import Any

import numpy as np

from feasibility import Spacecraft
from feasibility.constants import mjd_to_mjd2000
from feasibility.orbits import synthetic_main_belt
from seqsearch import RendezvousProblem, SearchSettings

GTOC7_TABLE = "gtoc/official/GTOC7-DATA.txt"


def small_problem(**changes: Any) -> RendezvousProblem:
    """Return a problem of seconds: 1500 bodies, two years."""
    problem = RendezvousProblem(
        name="small",
        catalogue=synthetic_main_belt(1500, np.random.default_rng(3)),
        spacecraft=Spacecraft(m_dry=800.0, thrust=0.3, isp=3000.0),
        m0=2000.0,
        first_departure_mjd2000=(mjd_to_mjd2000(59215.0), mjd_to_mjd2000(60000.0)),
        max_duration_days=730.0,
        min_stay_days=30.0,
    )
    return replace(problem, **changes)


def small_settings(**changes: Any) -> SearchSettings:
    """Return settings of seconds: a beam of six."""
    values: dict[str, Any] = {
        "pruner": "lambert:1.3,mima2:0.97",
        "beam_width": 6,
        "starts": 12,
        "start_epochs": 4,
        "neighbours": 25,
        "tof_days_step": 30.0,
        "solves_per_rank": 150,
    }
    return SearchSettings().with_(**(values | changes))
