"""How many legs the margin model needs: accuracy on fresh legs against the size of training.

Run from the root of the checkout after training/default_model.py, whose legs it takes. Each size
is a random part of all families together, split and trained as always; the last one is the
default model itself. Goes on where it was interrupted:

    python training/learning_curve.py [--data data/default] [--sizes 3000 10000 ...]

Writes learning-curve.json and learning-curve.png, and prints the table of
docs/results/classifier.md.
"""

import argparse
import json
import sys
import time
from pathlib import Path

import numpy as np

from feasibility import FeasibilityClassifier
from feasibility.classifier.margin.views import RENDEZVOUS
from feasibility.dataset import Dataset, read_dataset
from feasibility.evaluation.evaluate import evaluate
from feasibility.evaluation.tables import markdown_table
from feasibility.learning.margin.examples import legs_of
from feasibility.learning.margin.train import MarginRecipe, train_margin
from feasibility.runtime.atomic import atomic_path, write_text

TESTS = ("search", "table1", "nea")
SHOWN = {
    "search": ("accuracy", "accuracy_within_15_percent", "accuracy_within_5_percent"),
    "table1": ("balanced_accuracy", "accuracy_within_15_percent", "accuracy_within_5_percent"),
    "nea": ("balanced_accuracy", "accuracy_within_15_percent", "accuracy_within_5_percent"),
}
# Legs and accuracy of the paper's network, as read from its Fig. 3 and section 5.
PAPER = {20_000: 0.87, 30_000: 0.91, 400_000: 0.979}
# About as many steps for every size, so that it is the legs that are wanting and not the training.
STEPS = 16_000
SMALLEST_BATCH, LARGEST_BATCH = 128, 1024


def recipe(legs: int, threads: int) -> MarginRecipe:
    """Return how to train on a number of legs: smaller batches and more epochs for fewer legs."""
    learned = int(0.85 * legs)
    batch = int(np.clip(learned // 100, SMALLEST_BATCH, LARGEST_BATCH))
    steps = STEPS if batch == LARGEST_BATCH else STEPS // 2
    epochs = int(np.clip(round(steps * batch / learned), 20, 60))
    return MarginRecipe(batch=batch, epochs=epochs, seed=1, device="cpu", threads=threads)


def parts(datasets: list[Dataset], legs: int) -> list[Dataset]:
    """Return a number of legs of all datasets, each in proportion."""
    rng = np.random.default_rng([1, legs])
    total = sum(len(dataset) for dataset in datasets)
    return [
        dataset.take(rng.choice(len(dataset), round(legs * len(dataset) / total), replace=False))
        for dataset in datasets
    ]


def measures(classifier: FeasibilityClassifier, tests: dict[str, Dataset]) -> dict[str, object]:
    """Return the metrics on every test."""
    return {name: evaluate(classifier, dataset).metrics for name, dataset in tests.items()}


def table(curve: dict[int, dict[str, dict[str, float]]]) -> str:
    """Return the figures as Markdown."""
    tests = [
        name
        for shown in ("search", "table1, balanced", "nea, balanced")
        for name in (shown, "within 15 %", "within 5 %")
    ]
    headers = ["legs", *tests[:3], "error of log m*", *tests[3:]]
    rows = []
    for legs, metrics in sorted(curve.items()):
        cells = [f"{metrics[test][name]:.4f}" for test in TESTS for name in SHOWN[test]]
        cells.insert(3, f"{metrics['search']['median_log_margin_error_near']:.5f}")
        rows.append([str(legs), *cells])
    return markdown_table(headers, rows)


def draw(curve: dict[int, dict[str, dict[str, float]]], path: Path) -> None:
    """Write the picture: shares of wrong answers, with the paper's beside."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7, 4.5), layout="constrained")
    axes = figure.subplots()
    sizes = sorted(curve)
    for test, style in (("search", "o-"), ("table1", "s-"), ("nea", "^-")):
        name = SHOWN[test][0]
        wrong = [1.0 - curve[legs][test][name] for legs in sizes]
        axes.loglog(sizes, wrong, style, label=f"{test}, {name.replace('_', ' ')}")
    near = [1.0 - curve[legs]["search"]["accuracy_within_15_percent"] for legs in sizes]
    axes.loglog(sizes, near, "o:", color="C0", label="search, within 15 % of the boundary")
    axes.loglog(list(PAPER), [1 - a for a in PAPER.values()], "kx--", label="paper, Fig. 3")
    axes.set(xlabel="legs for training", ylabel="wrong answers on fresh legs (share)")
    axes.grid(which="both", alpha=0.3)
    axes.set_ylim(top=1.0)
    axes.legend(fontsize="small", ncols=2, loc="upper left")
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=130, format="png")


def main() -> int:
    """Do everything and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=Path("data/default"), help="folder")
    parser.add_argument("--out", type=Path, help="folder of the results (default: the data's)")
    parser.add_argument("--sizes", type=int, nargs="+", default=[3_000, 10_000, 30_000, 100_000])
    parser.add_argument("--threads", type=int, default=2, help="of the training (default 2)")
    options = parser.parse_args()
    out = options.out or options.data
    folders = sorted((options.data / "train").iterdir())
    # Legs with free ends have nets of their own, which play no part in these tests.
    datasets = legs_of([read_dataset(folder) for folder in folders], RENDEZVOUS)
    tests = {name: read_dataset(options.data / "test" / name) for name in TESTS}
    record = out / "learning-curve.json"
    known = json.loads(record.read_text()) if record.exists() else {}
    whole = sum(len(dataset) for dataset in datasets)
    for legs in [*(size for size in options.sizes if size < whole), whole]:
        if str(legs) in known:
            continue
        clock = time.process_time()
        if legs == whole:
            classifier = FeasibilityClassifier.load()
        else:
            model = train_margin(parts(datasets, legs), recipe(legs, options.threads))
            classifier = FeasibilityClassifier(model)
        known[str(legs)] = measures(classifier, tests)
        write_text(record, json.dumps(known, indent=1) + "\n")
        print(f"{legs} legs: {time.process_time() - clock:.0f} s of processor time", flush=True)
    curve = {int(legs): metrics for legs, metrics in known.items()}
    draw(curve, record.with_suffix(".png"))
    print(table(curve))
    return 0


if __name__ == "__main__":
    sys.exit(main())
