"""The command ``feasibility evaluate``."""

import argparse
from pathlib import Path
from typing import Any, Final

_DESCRIPTION: Final = """\
Judge a trained model on the labelled legs of a dataset that it was not trained
on: accuracy, precision, recall, F1, F10, AUC, balanced accuracy, log loss,
calibration error, accuracy near the boundary, what it would prune at several
recalls and, of a margin model, the error of log(m*/m0). With --out, write them
as metrics.json and metrics.md, with plots of the ROC curve, of the reliability
and of the margins.

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
    parser.add_argument(
        "model", metavar="MODEL", help='a .seqmodel file, or "default" for the one of the package'
    )
    parser.add_argument("dataset", nargs="+", metavar="DATASET", help="folder of a dataset")
    parser.add_argument(
        "--out", metavar="DIR", help="folder for tables and plots; of several datasets one in each"
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Do what the command line asks for and return the exit code."""
    from feasibility.classifier import FeasibilityClassifier
    from feasibility.dataset import read_dataset
    from feasibility.learning.evaluate import evaluate

    classifier = FeasibilityClassifier.load(options.model)
    folders = [Path(dataset) for dataset in options.dataset]
    for folder in folders:
        evaluation = evaluate(classifier, read_dataset(folder))
        if len(folders) > 1:
            print(f"## {folder.name}\n")
        print(evaluation.table())
        if options.out is not None:
            out = Path(options.out)
            title = f"{Path(options.model).name} on {folder.name}"
            for path in evaluation.write(out / folder.name if len(folders) > 1 else out, title):
                print(f"wrote {path}")
    return 0
