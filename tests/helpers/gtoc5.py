"""A small GTOC5 that several tests share: sixty bodies near the Earth."""

import numpy as np

from feasibility import Spacecraft
from feasibility.constants import AU, mjd_to_mjd2000
from feasibility.orbits import Catalogue
from seqsearch import RendezvousProblem
from seqsearch.problems.gtoc5.problem import Gtoc5Problem
from seqsearch.problems.gtoc5.rules import Gtoc5Rules


def near_earth_bodies(n=60):
    """Return bodies on orbits like the Earth's, a little apart in every element."""
    rng = np.random.default_rng(11)
    angles = rng.uniform(0.0, 2 * np.pi, (n, 3))
    elements = np.column_stack(
        [
            AU * rng.uniform(0.97, 1.06, n),
            rng.uniform(0.0, 0.06, n),
            np.radians(rng.uniform(0.0, 1.5, n)),
            angles,
        ]
    )
    return Catalogue(
        ids=np.arange(1, n + 1),
        names=[f"body {k}" for k in range(1, n + 1)],
        epoch_mjd2000=8000.0,
        elements=elements,
        source="near the Earth",
    )


def toy_problem(**changes):
    """Return a GTOC5 of seconds: two and a half years, a light spacecraft."""
    values = {
        "name": "toy",
        "catalogue": near_earth_bodies(),
        "spacecraft": Spacecraft(m_dry=500.0, thrust=0.3, isp=3000.0),
        "m0": 1200.0,
        "first_departure_mjd2000": (mjd_to_mjd2000(59000.0), mjd_to_mjd2000(60000.0)),
        "max_duration_days": 900.0,
        "min_stay_days": 0.0,
    }
    return Gtoc5Problem(base=RendezvousProblem(**(values | changes)), rules=Gtoc5Rules())
