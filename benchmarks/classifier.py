"""Check a margin model against the reference legs and the published tours.

Run from the root of the checkout, with the folder `shared` beside it:

    python benchmarks/classifier.py [--model FILE] [--recall 0.99]

The reference legs have masses m* found with many starts; the tours were flown, up to
the 1 % that dates rounded to the day cost. Nothing here was used for training.
"""

import argparse
import csv
from pathlib import Path

import numpy as np
from reference_legs import FAMILIES, read_reference, read_tour

from feasibility import ClassifierPruner, FeasibilityClassifier, Legs, Mima2Pruner, MimaPruner
from feasibility.constants import mjd_to_mjd2000

GTOC12_THRUST_N, GTOC12_ISP_S = 0.6, 4000.0


def read_antipodes(path: Path) -> Legs:
    """Return the legs of two GTOC12 ships; states in km and km/s."""
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))

    def columns(names: list[str]) -> np.ndarray:
        return np.array([[float(row[name]) for name in names] for row in rows])

    def states(end: str) -> np.ndarray:
        return 1e3 * columns([f"{a}{end}_km" for a in "xyz"] + [f"v{a}{end}_kms" for a in "xyz"])

    (t0, t1), m0 = columns(["t0_mjd", "t1_mjd"]).T, columns(["m0_kg"])[:, 0]
    legs = Legs(
        states("0"),
        states("1"),
        t1 - t0,
        m0,
        GTOC12_THRUST_N,
        GTOC12_ISP_S,
        0.0,
        t_dep_mjd2000=[mjd_to_mjd2000(t) for t in t0],
        dep_id=[int(row["from_id"]) for row in rows],
        arr_id=[int(row["to_id"]) for row in rows],
    )
    # Legs from or to the Earth (id 0) have a free velocity there.
    return legs.take((legs.dep_id != 0) & (legs.arr_id != 0))


def balanced(truth: np.ndarray, answer: np.ndarray) -> float:
    return 0.5 * float(answer[truth].mean() + (~answer[~truth]).mean())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--model", default="default", help="model file (default: the package's)")
    parser.add_argument("--recall", type=float, default=0.99, help="of the pruner (default 0.99)")
    parser.add_argument("--shared", type=Path, default=Path("../shared"), help="data folder")
    options = parser.parse_args()
    classifier = FeasibilityClassifier.load(options.model)
    pruner = ClassifierPruner(classifier, recall=options.recall)
    print(
        f"balanced accuracy; error of log m* within 0.5 of the boundary; recall {options.recall}"
    )
    for family in FAMILIES:
        legs, reference = read_reference(options.shared / "legs" / f"reference_{family}.npz")
        truth = reference >= legs.m0
        solved = reference > 0
        log_margin = np.log(np.where(solved, reference, 1e-9) / legs.m0)
        near = np.abs(np.expm1(log_margin)) < 0.15
        answer = classifier.feasible_probability(legs) >= 0.5
        error = np.abs(np.log(classifier.margin(legs)) - log_margin)
        print(
            f"{family:<8} {len(legs):>5} legs: model {balanced(truth, answer):.4f}, "
            f"within 15 % {(answer == truth)[near].mean():.4f}, "
            f"median error {np.median(error[np.abs(log_margin) < 0.5]):.5f}, "
            f"in domain {classifier.in_domain(legs).mean():.4f}, "
            f"pruner's recall {pruner.keep(legs)[truth].mean():.4f}; "
            f"MIMA {balanced(truth, MimaPruner().keep(legs)):.4f}, "
            f"MIMA2 {balanced(truth, Mima2Pruner().keep(legs)):.4f}"
        )
    tours = {
        "GTOC7, JPL": read_tour(
            options.shared / "legs" / "gtoc7_jpl_36.csv",
            options.shared / "gtoc" / "official" / "GTOC7-DATA.txt",
        ),
        "GTOC12, Antipodes": read_antipodes(options.shared / "legs" / "gtoc12_antipodes_legs.csv"),
    }
    for name, legs in tours.items():
        kept, margin = pruner.keep(legs), classifier.margin(legs)
        print(
            f"{name}: {kept.sum()} of {len(legs)} legs kept; m*/m0 by the model "
            f"{margin.min():.4f} to {margin.max():.2f}, median {np.median(margin):.3f}"
        )
        for row in np.flatnonzero(~kept):
            print(f"  pruned: leg {row}, {legs.tof_days[row]:.1f} d, m*/m0 {margin[row]:.4f}")


if __name__ == "__main__":
    main()
