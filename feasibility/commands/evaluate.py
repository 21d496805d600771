"""The command ``feasibility evaluate``."""

import argparse
import warnings
from pathlib import Path
from typing import Any, Final

from feasibility.errors import InputError

_DESCRIPTION: Final = """\
Judge a trained model on the labelled legs of datasets that it was not trained
on: accuracy, precision, recall, F1 and F10 (the paper's equations 11 to 14),
AUC, balanced accuracy, log loss, calibration error, accuracy within 15 % and
5 % of the boundary, what it would prune at several recalls, processor time
and, of a margin model, the errors of log(m*/m0) and of the final mass. Beside
it stand what closed forms say of the same legs, each with its best Lambert
branch: the Lambert delta-v, MIMA and MIMA2; and the public network
neural_lowthrust where it is installed.

A dataset whose legs the model has learned from is warned about.

With --out, all is written as metrics.json and metrics.md, with plots of the
ROC curves, of the reliability and of the margins; of several datasets one
folder each, and evaluation.json and evaluation.md for all together.

  feasibility evaluate table1.seqmodel data/table1-test --out reports/table1
  feasibility evaluate default data/search data/nea --out reports/default
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
    parser.add_argument(
        "--alone", action="store_true", help="judge the model alone, without the others"
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Do what the command line asks for and return the exit code.

    Raises
    ------
    InputError
        Input that cannot be used.
    """
    from feasibility.classifier.classifier import FeasibilityClassifier
    from feasibility.dataset import read_dataset
    from feasibility.evaluation.evaluate import by_family, evaluate
    from feasibility.evaluation.peers import known_peers
    from feasibility.evaluation.training_legs import trained_on
    from feasibility.runtime.atomic import write_json, write_text

    classifier = FeasibilityClassifier.load(options.model)
    folders = [Path(dataset) for dataset in options.dataset]
    names = [folder.resolve().name for folder in folders]
    if len(set(names)) < len(names):
        raise InputError(f"{' '.join(options.dataset)}: expected datasets of different names")
    peers, missing = ([], None) if options.alone else known_peers()
    model = Path(options.model).name
    evaluations = {}
    for folder, name in zip(folders, names, strict=True):
        dataset = read_dataset(folder)
        if trained_on(classifier.artefact, dataset.metadata):
            warnings.warn(
                f"{folder}: the model was trained on legs of the same protocol, catalogue and "
                "seed; its figures are too good, expected a dataset of another --seed",
                stacklevel=2,
            )
        evaluation = evaluations[name] = evaluate(classifier, dataset, peers)
        if len(folders) > 1:
            print(f"## {name}\n")
        print(evaluation.table())
        if options.out is not None:
            out = Path(options.out)
            target = out / name if len(folders) > 1 else out
            for path in evaluation.write(target, f"{model} on {name}"):
                print(f"wrote {path}")
    if len(folders) > 1:
        table = by_family(evaluations)
        print(f"## all\n\n{table}")
        if options.out is not None:
            whole = {name: evaluation.to_dict() for name, evaluation in evaluations.items()}
            write_json(Path(options.out) / "evaluation.json", whole)
            parts = [f"## {name}\n\n{one.table()}" for name, one in evaluations.items()]
            text = "\n".join([f"# {model}\n\n{table}", *parts])
            write_text(Path(options.out) / "evaluation.md", text)
    if missing is not None:
        print(missing)
    return 0
