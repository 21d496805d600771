"""The command ``feasibility assess``."""

import argparse
import tempfile
from pathlib import Path
from typing import Any, Final

from feasibility.commands.options import add_common, one_or_more

_DESCRIPTION: Final = """\
Say whether a model is good enough for your spacecraft: draw legs of it, solve
them, and compare the model's answers with the solver's.

  feasibility assess probe.toml --catalogue asteroids.txt

Half of the legs get a mass near the heaviest possible, as those of good tours
have; balanced accuracy is that of the others. Shares come with intervals that
hold with probability 0.95.

The verdict is "good enough" where at least 95 % of the legs are in the model's
domain, balanced accuracy is at least 0.99, at least 97 % of the legs within
15 % of the boundary are judged rightly, and the interval of the pruner's recall
reaches the recall asked for; "retrain" otherwise, with what falls short; "too
few legs" with less than 50 legs of a class or 100 within 15 % of the boundary;
it then says how many legs are needed.

Exit code: 0 good enough, 3 retrain, 4 too few legs; 2 for input that cannot be
used.

The spacecraft is a TOML file with these keys:

"""


def add_parser(commands: Any) -> None:
    """Add the command to the parser's sub-commands."""
    from feasibility.spacecraft.spacecraft_file import EXAMPLE

    parser = commands.add_parser(
        "assess",
        help="is a model good enough for your spacecraft?",
        description=_DESCRIPTION + EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("spacecraft", metavar="SPACECRAFT.toml", help="the spacecraft")
    parser.add_argument(
        "--catalogue",
        nargs="+",
        default=[],
        metavar="FILE",
        help="asteroid tables, used evenly (default: a synthetic main belt)",
    )
    parser.add_argument("--model", default="default", help="the model (default: the package's)")
    parser.add_argument(
        "--recall", type=float, default=0.99, help="of the pruner that is judged (default: 0.99)"
    )
    parser.add_argument(
        "--legs", type=one_or_more, default=1500, metavar="N", help="legs to solve (default: 1500)"
    )
    add_common(parser, seed="the draws")
    parser.add_argument("--out", metavar="FILE", help="write all figures as JSON")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Do what the command line asks for and return the exit code, which tells the verdict.

    Raises
    ------
    InputError
        Input that cannot be used.
    """
    from feasibility.classifier.classifier import FeasibilityClassifier
    from feasibility.runtime.atomic import write_json
    from feasibility.runtime.provenance import provenance
    from feasibility.spacecraft.assess import EXIT_CODES, assess
    from feasibility.spacecraft.legs import make, parts_of
    from feasibility.spacecraft.spacecraft_file import read_spacecraft

    craft = read_spacecraft(options.spacecraft)
    classifier = FeasibilityClassifier.load(options.model)
    classifier.threshold(options.recall)
    print(f"{craft.name}: solving {options.legs} legs", flush=True)
    parts = parts_of(craft, options.catalogue, options.legs, options.seed, "sample")
    with tempfile.TemporaryDirectory() as folder:
        sample = make(parts, Path(folder), options.workers)
    outcome = assess(classifier, sample, options.recall)
    print(outcome.text(), end="")
    if outcome.verdict == "retrain":
        print(f"  feasibility retrain {options.spacecraft} may help")
    if options.out is not None:
        record = {
            "spacecraft": craft.to_dict(),
            "model": Path(options.model).name,
            "legs": options.legs,
            "seed": options.seed,
            **outcome.to_dict(),
            "provenance": provenance(),
        }
        write_json(Path(options.out), record)
        print(f"wrote {options.out}")
    return EXIT_CODES[outcome.verdict]
