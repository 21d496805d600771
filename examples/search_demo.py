"""Search a synthetic main belt for a tour and verify it.

Run with: python examples/search_demo.py [--bodies N] [--beam-width N]
"""

import argparse

import numpy as np

from feasibility import Spacecraft
from feasibility.constants import mjd_to_mjd2000
from feasibility.orbits import synthetic_main_belt
from seqsearch import RendezvousProblem, SearchSettings, search, verify_tour


def main() -> None:
    """Search, print the tour, verify it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bodies", type=int, default=5000, help="asteroids in the belt")
    parser.add_argument("--beam-width", type=int, default=20)
    parser.add_argument("--days", type=float, default=1000.0, help="longest duration of the tour")
    options = parser.parse_args()

    problem = RendezvousProblem(
        name="example",
        catalogue=synthetic_main_belt(options.bodies, np.random.default_rng(1)),
        spacecraft=Spacecraft(m_dry=800.0, thrust=0.3, isp=3000.0),
        m0=2000.0,
        first_departure_mjd2000=(mjd_to_mjd2000(59215.0), mjd_to_mjd2000(60000.0)),
        max_duration_days=options.days,
        min_stay_days=30.0,
    )
    settings = SearchSettings(beam_width=options.beam_width, starts=30, solves_per_rank=600)
    result = search(problem, settings=settings, rng=np.random.default_rng(1))

    print(result.tour.table())
    print(result.tour.summary())
    proposed = sum(record.proposed for record in result.counters)
    optimised = sum(record.optimised for record in result.counters)
    print(f"{proposed} legs proposed, {optimised} optimised")
    print("verified" if verify_tour(result.tour).passed else "NOT verified")


if __name__ == "__main__":
    main()
