"""A search of one's own (greedy, a few lines) that uses a `Pruner` on its own candidate legs.

Nothing of `seqsearch` is used: only the legs, the pruner and the leg solver.

Run with: python examples/custom_search.py
"""

import argparse

import numpy as np

from feasibility import Legs, Mima2Pruner, Spacecraft, max_initial_mass, optimise
from feasibility.constants import mjd_to_mjd2000
from feasibility.orbits import OrbitalNeighbours, orbital_metric, synthetic_main_belt

CRAFT = Spacecraft(m_dry=800.0, thrust=0.3, isp=3000.0)
TOF_DAYS = np.arange(90.0, 241.0, 15.0)
STAY_DAYS = 30.0


def main() -> None:
    """From a start asteroid, always fly the shortest leg that the solver confirms."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bodies", type=int, default=5000, help="asteroids in the belt")
    parser.add_argument("--legs", type=int, default=3, help="legs to fly")
    options = parser.parse_args()

    belt = synthetic_main_belt(options.bodies, np.random.default_rng(1))
    neighbours = OrbitalNeighbours(belt)
    pruner = Mima2Pruner()
    epoch, mass = mjd_to_mjd2000(59215.0), 2000.0
    points = orbital_metric(belt.states(epoch), 180.0)
    eighth = neighbours.query(np.arange(len(belt)), epoch, 8)[:, -1]
    here = int(np.argmin(np.linalg.norm(points - points[eighth], axis=1)))  # where it is crowded
    visited = [here]
    for _ in range(options.legs):
        near = neighbours.query([here], [epoch], 100)[0]
        near = near[~np.isin(near, visited)]
        target, tof = (grid.ravel() for grid in np.meshgrid(near, TOF_DAYS, indexing="ij"))
        candidates = Legs(
            rv_dep=belt.states_at([here], epoch),
            rv_arr=belt.states_at(target, epoch + tof),
            tof_days=tof,
            m0=mass,
            thrust=CRAFT.thrust,
            isp=CRAFT.isp,
            m_dry=CRAFT.m_dry,
        )
        kept = np.flatnonzero(pruner.keep(candidates))
        kept = kept[np.argsort(tof[kept], kind="stable")][:40]
        if len(kept) == 0:
            print(f"no flyable leg from {belt.names[here]}: the pruner dropped them all")
            return
        legs = candidates.take(kept)
        flyable = max_initial_mass(legs, method="fast") >= mass
        flown = optimise(legs, method="fast")
        good = np.flatnonzero(flyable & flown.converged)
        print(f"{len(candidates)} candidates, {len(kept)} optimised, {len(good)} flyable")
        if len(good) == 0:
            return
        best = good[0]
        print(
            f"  {belt.names[here]} -> {belt.names[target[kept[best]]]} in "
            f"{tof[kept[best]]:.0f} days, {mass:.0f} -> {flown.m_final[best]:.0f} kg"
        )
        epoch += float(tof[kept[best]]) + STAY_DAYS
        here, mass = int(target[kept[best]]), float(flown.m_final[best])
        visited.append(here)


if __name__ == "__main__":
    main()
