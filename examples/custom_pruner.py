"""Write a pruner of one's own, check it against the contract, and search with it.

Run with: python examples/custom_pruner.py
"""

import argparse
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from feasibility import AllOf, Legs, Mima2Pruner, Spacecraft, check_pruner
from feasibility.constants import mjd_to_mjd2000
from feasibility.orbits import synthetic_main_belt
from seqsearch import RendezvousProblem, SearchSettings, search


@dataclass(frozen=True)
class NearlyCoplanar:
    """Keeps legs whose two orbital planes differ by at most `max_angle_deg`."""

    max_angle_deg: float

    def keep(self, legs: Legs, /) -> NDArray[np.bool_]:
        """Return (n,) bool, True where the leg survives."""
        poles = [np.cross(rv[:, :3], rv[:, 3:]) for rv in (legs.rv_dep, legs.rv_arr)]
        unit = [pole / np.linalg.norm(pole, axis=1, keepdims=True) for pole in poles]
        cosine = np.einsum("ij,ij->i", *unit)
        return cosine >= np.cos(np.radians(self.max_angle_deg))


def main() -> None:
    """Check the pruner, then compare a search with and without it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bodies", type=int, default=3000, help="asteroids in the belt")
    parser.add_argument("--days", type=float, default=600.0, help="longest duration of the tour")
    options = parser.parse_args()

    mine = NearlyCoplanar(max_angle_deg=3.0)
    check_pruner(mine)
    print("NearlyCoplanar keeps the contract")

    problem = RendezvousProblem(
        name="example",
        catalogue=synthetic_main_belt(options.bodies, np.random.default_rng(1)),
        spacecraft=Spacecraft(m_dry=800.0, thrust=0.3, isp=3000.0),
        m0=2000.0,
        first_departure_mjd2000=(mjd_to_mjd2000(59215.0), mjd_to_mjd2000(59600.0)),
        max_duration_days=options.days,
        min_stay_days=30.0,
    )
    settings = SearchSettings(beam_width=10, starts=20, solves_per_rank=300)
    for pruner in (Mima2Pruner(0.97), AllOf(mine, Mima2Pruner(0.97))):
        result = search(problem, pruner=pruner, settings=settings, rng=np.random.default_rng(1))
        print(f"{pruner}: {result.tour.summary()}")
        for record in result.counters:
            print(f"  rank {record.rank}: {record.proposed} proposed, pruned {record.pruned}")


if __name__ == "__main__":
    main()
