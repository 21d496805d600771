"""Go on with the default model's margins on near-Earth neighbours, and meet it half-way.

Run from the root of the checkout, with the folder `shared` beside it; it goes on where it was
interrupted:

    python training/near_earth.py --out data/default --model better.seqmodel

Legs of `LEGS` are made as `default_model.py` makes them: the family `nearby`, and some of each
older one, so that nothing is forgotten. Fine-tuning on them alone gains on `nearby` and loses a
little elsewhere. The mean of the weights before and after loses nothing (Wortsman et al. 2022,
"Robust fine-tuning of zero-shot models"); one half was chosen beforehand, not by a test.
Calibration and thresholds are those of the mean. Nets for final masses and free ends are kept.
`--hard N` adds N of the family `nearby` of which the model before is most unsure; not part of the
default model.
"""

import argparse
import sys
from dataclasses import replace
from pathlib import Path
from typing import Final

from default_model import HARD_FACTOR, HARD_SEED, TRAINING_SEED, generate, protocol

from feasibility import FeasibilityClassifier
from feasibility.classifier.artefact import Artefact
from feasibility.dataset import read_dataset
from feasibility.learning.margin.hard_examples import harder
from feasibility.learning.margin.train import MarginRecipe, train_margin

LEGS: Final = {
    "nearby": 40_000,
    "nea": 30_000,
    "search": 25_000,
    "table1": 20_000,
    "general": 25_000,
    "craft2900": 6_000,
}
"""Family: legs, the first of those with which the default model would be made from nothing."""

_WEIGHTS: Final = ("model/weight", "model/bias", "quick/weight", "quick/bias")


def half_way(before: Artefact, after: Artefact) -> Artefact:
    """Return `after` with the mean weights of both; their standardisation is the same."""
    arrays = {
        name: (0.5 * (before.arrays[name] + array)).astype(array.dtype)
        if name.startswith(_WEIGHTS)
        else array
        for name, array in after.arrays.items()
    }
    return replace(after, arrays=arrays)


def main() -> int:
    """Make legs, fine-tune, meet half-way, calibrate; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("data/default"), help="folder of legs")
    parser.add_argument("--start", default="default", help="model to go on from")
    parser.add_argument("--model", type=Path, required=True, help="file of the new model")
    parser.add_argument("--hard", type=int, default=0, help="doubtful legs (default 0)")
    parser.add_argument("--workers", type=int, default=2, help="processes (default 2)")
    parser.add_argument("--shared", type=Path, default=Path("../shared"), help="data folder")
    options = parser.parse_args()
    datasets = []
    for family, legs in LEGS.items():
        folder = options.out / "train" / family
        made = protocol(family, options.shared / "gtoc" / "official")
        generate(made, legs, folder, TRAINING_SEED, options.workers)
        datasets.append(read_dataset(folder))
    hard = []
    if options.hard:
        folder = options.out / "hard" / "nearby"
        made = protocol("nearby", options.shared / "gtoc" / "official")
        made = harder(made, Path(options.start), HARD_FACTOR)
        generate(made, options.hard, folder, HARD_SEED, options.workers)
        hard.append(read_dataset(folder))
    start = FeasibilityClassifier.load(options.start).artefact
    recipe = MarginRecipe(epochs=16, learning_rate=4e-4, batch=1024, seed=1, threads=2)
    checkpoint = options.model.with_name(f"{options.model.name}.checkpoint")
    tuned = train_margin(
        [*datasets, *hard], recipe, start=start, checkpoint=checkpoint, on_epoch=print
    )
    mean = half_way(start, tuned)
    train_margin(datasets, replace(recipe, epochs=0), start=mean).save(options.model)
    checkpoint.unlink(missing_ok=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
