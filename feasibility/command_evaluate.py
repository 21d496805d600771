"""The command ``feasibility evaluate``."""

import argparse
from pathlib import Path
from typing import Any, Final

_DESCRIPTION: Final = """\
Judge a trained model on the labelled legs of a dataset that it was not trained
on: accuracy, precision, recall, F1, F10, AUC, balanced accuracy, log loss,
calibration error, accuracy near the boundary, and what it would prune at
several recalls. With --out, write them as metrics.json and metrics.md, with
plots of the ROC curve and of the reliability.

  feasibility evaluate table1.seqmodel data/table1-test --out reports/table1
"""


def add_parser(commands: Any) -> None:
    """Add the command to the parser's sub-commands."""
    parser = commands.add_parser(
        "evaluate",
        help="judge a trained model",
        description=_DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("model", metavar="MODEL", help="a .seqmodel file")
    parser.add_argument("dataset", metavar="DATASET", help="folder of a dataset")
    parser.add_argument("--out", metavar="DIR", help="folder for tables and plots")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Do what the command line asks for and return the exit code."""
    from feasibility.classifier import FeasibilityClassifier
    from feasibility.dataset import read_dataset
    from feasibility.learning.evaluate import evaluate

    classifier = FeasibilityClassifier.load(options.model)
    evaluation = evaluate(classifier, read_dataset(options.dataset))
    print(evaluation.table(), end="")
    if options.out is not None:
        title = f"{Path(options.model).name} on {Path(options.dataset).name}"
        for path in evaluation.write(Path(options.out), title):
            print(f"wrote {path}")
    return 0
