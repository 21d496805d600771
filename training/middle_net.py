"""Give a margin model a new middle net for legs with free ends; its other nets stay.

Run from the root of the checkout: python training/middle_net.py MODEL DATASET... --out FILE

The same training of the same legs as in training/default_model.py, where it is a part of the
whole: with the seed of the model's own training for free ends the same legs are left out.
"""

import argparse
from pathlib import Path

from feasibility.classifier.artefact import Artefact
from feasibility.classifier.margin.views import FREE_ENDS
from feasibility.dataset import read_dataset
from feasibility.learning.margin.examples import MarginExamples, legs_of
from feasibility.learning.margin.fit import MarginRecipe
from feasibility.learning.margin.fit_view import add_middle


def main() -> None:
    """Read the command line, train and save."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("model", type=Path, help="model file")
    parser.add_argument("datasets", nargs="+", help="folders of datasets")
    parser.add_argument("--out", type=Path, required=True, help="file to be written")
    parser.add_argument("--seed", type=int, default=1, help="seed (default 1)")
    parser.add_argument("--threads", type=int, default=1, help="threads (default 1)")
    options = parser.parse_args()
    legs = legs_of([read_dataset(folder) for folder in options.datasets], FREE_ENDS)
    examples = MarginExamples.of(legs, FREE_ENDS)
    recipe = MarginRecipe(learning_rate=2.5e-3, seed=options.seed, threads=options.threads)
    add_middle(Artefact.load(options.model), examples, FREE_ENDS, recipe).save(options.out)


if __name__ == "__main__":
    main()
