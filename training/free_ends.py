"""Go on with the default model's nets for legs with free ends; its other nets stay.

Run from the root of the checkout, with the folder `shared` beside it; it goes on where it was
interrupted:

    python training/free_ends.py --out data/default --model better.seqmodel

Legs of `LEGS` are made as `default_model.py` makes them, and those of `HARD`: the ones of which
the nets before are most unsure, among `HARD_FACTOR` times as many. These are legs whose
acceleration comes near that of the Sun's gravity; one leg in ten, and most of the errors. The net
for the final mass is kept.
"""

import argparse
import sys
from pathlib import Path
from typing import Final

from default_model import FAMILIES, HARD_FACTOR, HARD_SEED, TRAINING_SEED, generate, protocol

from feasibility import FeasibilityClassifier
from feasibility.dataset import read_dataset
from feasibility.learning.margin.hard_examples import harder
from feasibility.learning.margin.train import MarginRecipe, train_free_ends

LEGS: Final = ("launch", "arrival", "launch-flyby", "flyby", "flyby-nea", "free")
"""Families of which as many legs are made as for the default model."""

HARD: Final = {"launch-flyby": 30_000, "flyby": 40_000}
"""Family: legs; those of which most were decided wrongly near the boundary."""


def main() -> int:
    """Make legs, train, save; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("data/default"), help="folder of legs")
    parser.add_argument("--start", default="default", help="model to go on from")
    parser.add_argument("--model", type=Path, required=True, help="file of the new model")
    parser.add_argument("--epochs", type=int, default=24, help="of the training (default 24)")
    parser.add_argument("--workers", type=int, default=2, help="processes (default 2)")
    parser.add_argument("--shared", type=Path, default=Path("../shared"), help="data folder")
    options = parser.parse_args()
    tables = options.shared / "gtoc" / "official"
    datasets = []
    for family in LEGS:
        legs, folder = FAMILIES[family][0], options.out / "train" / family
        generate(protocol(family, tables), legs, folder, TRAINING_SEED, options.workers)
        datasets.append(read_dataset(folder))
    for family, legs in HARD.items():
        folder = options.out / "hard" / family
        made = harder(protocol(family, tables), Path(options.start), HARD_FACTOR)
        generate(made, legs, folder, HARD_SEED, options.workers)
        datasets.append(read_dataset(folder))
    start = FeasibilityClassifier.load(options.start).artefact
    recipe = MarginRecipe(epochs=options.epochs, learning_rate=6e-4, seed=1, threads=2)
    checkpoint = options.model.with_name(f"{options.model.name}.checkpoint")
    trained = train_free_ends(
        start, datasets, recipe, start=start, checkpoint=checkpoint, on_epoch=print
    )
    trained.save(options.model)
    checkpoint.unlink(missing_ok=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
