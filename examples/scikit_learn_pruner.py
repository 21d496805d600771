"""A scikit-learn model as a pruner of our search: label legs, fit, wrap, check, search.

Run with: python examples/scikit_learn_pruner.py [--legs N]
"""

import argparse
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import HistGradientBoostingClassifier

from feasibility import Legs, check_pruner, max_initial_mass
from feasibility.classifier.margin.features import log_acceleration, margin_features
from feasibility.orbits import OrbitalNeighbours
from seqsearch import Problem, SearchSettings, load_problem, search, verify_tour


def inputs(legs: Legs) -> NDArray[np.float64]:
    """Return (n, k) inputs that fit any spacecraft; NaN where an orbit is not bound."""
    X, hint = margin_features(legs)
    return np.column_stack([X, log_acceleration(legs, legs.m0) - hint])


def draw(problem: Problem, n: int, rng: np.random.Generator) -> Legs:
    """Return n legs such as the search will propose: between neighbours, with any mass."""
    belt, craft = problem.catalogue, problem.spacecraft
    epoch = float(rng.uniform(*problem.first_departure_mjd2000))
    body = rng.integers(len(belt), size=n)
    near = OrbitalNeighbours(belt).query(body, np.full(n, epoch), 60)
    target = near[np.arange(n), rng.integers(60, size=n)]
    tof = rng.uniform(60.0, 300.0, n)
    return Legs(
        rv_dep=belt.states_at(body, np.full(n, epoch)),
        rv_arr=belt.states_at(target, epoch + tof),
        tof_days=tof,
        m0=rng.uniform(craft.m_dry, problem.m0, n),
        thrust=craft.thrust,
        isp=craft.isp,
        m_dry=craft.m_dry,
    )


@dataclass(frozen=True)
class ModelPruner:
    """Keeps a leg that the model thinks likely enough to be flyable."""

    model: HistGradientBoostingClassifier
    threshold: float
    name = "boosted-trees"

    def keep(self, legs: Legs, /) -> NDArray[np.bool_]:
        """Return (n,) bool, True where the leg survives; what is not known survives."""
        X = inputs(legs)
        known = np.isfinite(X).all(axis=1)
        kept: NDArray[np.bool_] = np.asarray(~known)
        if known.any():
            kept[known] = self.model.predict_proba(X[known])[:, 1] >= self.threshold
        return kept


def main() -> None:
    """Train on freshly solved legs, then search with the model."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--legs", type=int, default=4000, help="legs to label and learn from")
    options = parser.parse_args()
    problem = replace(load_problem("demo"), max_duration_days=500.0)

    legs = draw(problem, options.legs, np.random.default_rng(5))
    flyable = max_initial_mass(legs, method="fast") >= legs.m0
    X = inputs(legs)
    train, test = np.array_split(np.arange(len(legs)), [len(legs) * 3 // 4])
    model = HistGradientBoostingClassifier(max_iter=100, random_state=0)
    model.fit(X[train], flyable[train])
    right = model.predict(X[test]) == flyable[test]
    print(
        f"{flyable.mean():.0%} of {len(legs)} legs are flyable; model right on {right.mean():.1%}"
    )

    positive = np.sort(model.predict_proba(X[test][flyable[test]])[:, 1])
    pruner = ModelPruner(model, threshold=float(positive[len(positive) // 50]))  # recall 98 %
    check_pruner(pruner)
    settings = SearchSettings(beam_width=10, starts=20, solves_per_rank=300)
    result = search(problem, pruner=pruner, settings=settings)
    for record in result.counters:
        share = record.feasible / max(record.optimised, 1)
        print(f"rank {record.rank}: {record.proposed} proposed, {record.pruned} pruned, "
              f"{record.optimised} optimised, {share:.0%} of them flyable")  # fmt: skip
    print(result.tour.summary())
    print("verified" if verify_tour(result.tour).passed else "NOT verified")


if __name__ == "__main__":
    main()
