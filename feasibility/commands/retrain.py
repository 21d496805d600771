"""The command ``feasibility retrain``."""

import argparse
import time
from pathlib import Path
from typing import Any, Final

from feasibility.commands.options import add_common, one_or_more
from feasibility.errors import InputError
from feasibility.runtime.folders import make_folder
from feasibility.runtime.workers import default_workers

_DESCRIPTION: Final = """\
Make a model for your spacecraft from the default model. `feasibility assess`
says in a minute whether that is worth while.

  feasibility retrain probe.toml --catalogue asteroids.txt --out probe.seqmodel
  seqsearch run mission.toml --pruner probe.seqmodel:0.99

1. Legs of the spacecraft are drawn and solved: near neighbours with flights as
   in a search, random pairs with flights of about the cheapest impulsive one,
   half of all with a mass near the heaviest possible; besides some legs of any
   spacecraft, so that nothing is forgotten.
2. The default model's nets are trained on with them, and its probabilities and
   thresholds fitted anew.
   Where hardly any leg can be flown, or hardly any cannot, a warning says so.
3. Fresh legs judge. The fine-tuned model is saved only if on those of your
   spacecraft it makes no more wrong answers, has no larger log loss and no
   larger error of m* near the boundary than the default model; otherwise the
   default model with its new calibration is, if that is no worse, or else the
   default model as it was. The report says which, and what became of the
   answers for any spacecraft.

Legs, checkpoint and report.json go to the folder OUT.retrain; the same command
goes on where an interrupted one stopped. A leg takes 2 to 9 ms of a core, all
by default 4 to 8 minutes of two; on fewer cores give fewer --legs.

The spacecraft is a TOML file with these keys:

"""


def add_parser(commands: Any) -> None:
    """Add the command to the parser's sub-commands."""
    from feasibility.spacecraft.spacecraft_file import EXAMPLE

    parser = commands.add_parser(
        "retrain",
        help="make a model for your spacecraft",
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
    parser.add_argument("--out", required=True, metavar="MODEL", help="file of the model")
    parser.add_argument("--start", default="default", help="model to go on from (the package's)")
    for name, default, text in (
        ("legs", 60_000, "legs of the spacecraft to learn from"),
        ("test-legs", 6000, "legs of the spacecraft to be judged on"),
        ("general-legs", 12_000, "legs of any spacecraft to learn from"),
        ("general-test-legs", 1500, "legs of any spacecraft to be judged on"),
        ("epochs", 15, "passes of the fine-tuning over the legs"),
    ):
        parser.add_argument(
            f"--{name}", type=one_or_more, default=default, metavar="N", help=f"{text} ({default})"
        )
    add_common(parser, seed="everything", workers="processes of the solver")
    parser.add_argument(
        "--threads", type=one_or_more, help="threads of the training (default: one a core)"
    )
    parser.add_argument(
        "--device", choices=("cpu", "cuda", "auto"), default="auto", help="where it trains (auto)"
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
    from feasibility.runtime.extras import load_extra
    from feasibility.spacecraft.retrain import REPORT, RetrainSettings, retrain
    from feasibility.spacecraft.spacecraft_file import read_spacecraft

    counts = ("legs", "test_legs", "general_legs", "general_test_legs", "epochs")
    craft = read_spacecraft(options.spacecraft)
    out = Path(options.out)
    if not out.parent.is_dir():
        raise InputError(f"--out {out}: no folder {out.parent}")
    start = FeasibilityClassifier.load(options.start).artefact
    # Asked for now rather than after minutes of solving.
    load_extra("torch")
    folder = out.with_name(out.name + ".retrain")
    make_folder(folder)
    settings = RetrainSettings(
        **{name: getattr(options, name) for name in counts},
        seed=options.seed,
        workers=options.workers,
        threads=options.threads or default_workers(),
        device=options.device,
    )
    began = time.perf_counter()

    def say(line: str) -> None:
        print(f"{time.perf_counter() - began:6.0f} s  {line}", flush=True)

    def on_epoch(epoch: Any) -> None:
        say(
            f"epoch {epoch.number:>3}: training loss {epoch.train_loss:.5f}, "
            f"validation loss {epoch.validation_loss:.5f}"
        )

    done = retrain(craft, options.catalogue, start, folder, settings, say=say, on_epoch=on_epoch)
    done.artefact.save(out)
    say(done.verdict())
    print()
    print(done.table())
    print(f"wrote {out} and {folder / REPORT}")
    return 0
