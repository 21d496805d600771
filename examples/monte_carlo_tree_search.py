"""A Monte Carlo tree search of one's own with the default classifier plugged in.

Nothing of `seqsearch` is used. The tree grows on what the classifier says of legs, at a
few microseconds each; the leg solver only flies the tour that came out best.
Run with: python examples/monte_carlo_tree_search.py [ITERATIONS]
"""

import math
import sys
from dataclasses import dataclass

import numpy as np

from feasibility import ClassifierPruner, FeasibilityClassifier, Legs, Spacecraft, optimise
from feasibility.constants import mjd_to_mjd2000
from feasibility.orbits import OrbitalNeighbours, orbital_metric, synthetic_main_belt

CRAFT = Spacecraft(m_dry=800.0, thrust=0.3, isp=3000.0)
TOF_DAYS = np.arange(80.0, 241.0, 20.0)
STAY_DAYS = 30.0
START, DURATION_DAYS = mjd_to_mjd2000(59215.0), 1000.0


@dataclass
class Node:
    """A visit: `path` holds the bodies up to this one, `legs` how it was reached."""

    path: tuple[int, ...]
    epoch: float
    mass: float
    legs: tuple[Legs, ...] = ()
    parent: "Node | None" = None
    children: "list[Node] | None" = None
    visits: int = 0
    total: float = 0.0


def main() -> None:
    """Grow the tree, then fly the best tour."""
    iterations = int(sys.argv[1]) if len(sys.argv) > 1 else 150
    belt = synthetic_main_belt(5000, np.random.default_rng(1))
    neighbours = OrbitalNeighbours(belt)
    classifier = FeasibilityClassifier.load("default")
    pruner = ClassifierPruner(classifier, recall=0.95)
    rng = np.random.default_rng(0)
    points = orbital_metric(belt.states(START), 180.0)
    eighth = neighbours.query(np.arange(len(belt)), START, 8)[:, -1]
    crowded = int(np.argmin(np.linalg.norm(points - points[eighth], axis=1)))

    def ways_on(node: Node) -> list[Node]:
        near = neighbours.query([node.path[-1]], [node.epoch], 40)[0]
        near = near[~np.isin(near, node.path)]
        tofs = TOF_DAYS[node.epoch + TOF_DAYS <= START + DURATION_DAYS]
        target, tof = (grid.ravel() for grid in np.meshgrid(near, tofs, indexing="ij"))
        legs = Legs(
            rv_dep=belt.states_at(np.full(len(tof), node.path[-1]), node.epoch),
            rv_arr=belt.states_at(target, node.epoch + tof),
            tof_days=tof, m0=node.mass, thrust=CRAFT.thrust, isp=CRAFT.isp, m_dry=CRAFT.m_dry,
        )  # fmt: skip
        kept = np.flatnonzero(pruner.keep(legs))
        kept = kept[np.unique(target[kept], return_index=True)[1]]  # the shortest of each target
        kept = kept[np.argsort(tof[kept], kind="stable")][:8]
        mass = classifier.final_mass(legs.take(kept))
        return [
            Node((*node.path, int(target[i])), node.epoch + tof[i] + STAY_DAYS, float(m),
                 (*node.legs, legs.take(np.array([i]))), node)
            for i, m in zip(kept, mass, strict=True) if m > CRAFT.m_dry
        ]  # fmt: skip

    root = best = Node((crowded,), START, 2000.0)
    for _ in range(iterations):
        node = root
        while node.children and all(child.visits for child in node.children):
            bonus = 0.7 * math.log(node.visits) ** 0.5  # upper confidence bounds
            node = max(node.children, key=lambda c: c.total / c.visits + bonus / c.visits**0.5)
        if node.children is None:
            node.children = ways_on(node)
        if fresh := [child for child in node.children if not child.visits]:
            node = fresh[int(rng.integers(len(fresh)))]
        end = node
        while ways := ways_on(end):  # a random way down
            end = ways[int(rng.integers(min(3, len(ways))))]
        best = max(best, end, key=lambda n: (len(n.path), -n.epoch))
        up: Node | None = node
        while up is not None:
            up.visits, up.total, up = up.visits + 1, up.total + len(end.path) / 8, up.parent

    mass, flown = root.mass, 0
    for leg in best.legs:
        solution = optimise(leg.with_m0(mass), method="fast")
        if not solution.converged[0]:
            break
        print(f"  {leg.tof_days[0]:.0f} days, {mass:.0f} -> {solution.m_final[0]:.0f} kg")
        mass, flown = float(solution.m_final[0]), flown + 1
    print(f"{flown} of {len(best.legs)} planned legs flown, {root.visits} iterations")


if __name__ == "__main__":
    main()
