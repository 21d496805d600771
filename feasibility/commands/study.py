"""The command ``feasibility study``."""

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING, Final

from feasibility.commands.options import add_common, one_or_more
from feasibility.errors import InputError
from feasibility.learning.paper.models.precision import PRECISIONS
from feasibility.runtime.workers import default_workers
from feasibility.study import EXPERIMENTS
from feasibility.study.presets import PRESETS, find_preset

if TYPE_CHECKING:
    from feasibility.study.runner import Settings

_DESCRIPTION: Final = """\
Repeat the paper's experiments and set our numbers beside its own.

  feasibility study all --preset quick                      minutes
  feasibility study all --preset laptop --catalogue FILE    some hours on 2 cores
  feasibility study data_size --preset quick                one experiment
  feasibility study report --docs docs/results/study.md             the report as a document

The legs (the paper's Table 1, labelled by the maximum initial mass) are made
first, unless --data names a dataset of the protocol table1. Every experiment
writes its tables (CSV, Markdown) and figures (PNG, SVG) to DIR/NAME, and
report.md gathers them. What was computed is kept in DIR/cells: the same
command goes on where an interrupted one stopped, and repeats nothing.

A preset of your own is a TOML file: base = "laptop" and what differs, such as
legs = 120000 or a table [data_size] with dnn1 = [1000, 10000, 70000].

"""
_ALL: Final = "all"
_REPORT: Final = "report"


def add_parser(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add ``study`` to the command line."""
    about = {
        _ALL: "every experiment below, then the report",
        _REPORT: "gather what is in DIR without running anything",
        **EXPERIMENTS,
    }
    parser = commands.add_parser(
        "study",
        help="repeat the paper's experiments",
        description=_DESCRIPTION
        + "\n".join(f"  {name:<16} {text}" for name, text in about.items()),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "name", choices=tuple(about), metavar="NAME", help="an experiment, all or report"
    )
    parser.add_argument(
        "--preset",
        default="quick",
        help=f"sizes: {', '.join(PRESETS)} (default: quick), or a TOML file",
    )
    parser.add_argument(
        "--out", default="runs/study", metavar="DIR", help="folder of the study (runs/study)"
    )
    parser.add_argument("--data", metavar="DIR", help="dataset of the legs (default: made here)")
    parser.add_argument(
        "--catalogue", metavar="FILE", help="asteroid table (default: a synthetic main belt)"
    )
    add_common(parser, seed="legs and split")
    parser.add_argument(
        "--threads",
        type=one_or_more,
        help="threads of a network (default: one in bfloat16, else one a core)",
    )
    parser.add_argument(
        "--device",
        choices=("cpu", "cuda", "auto"),
        default="cpu",
        help="where networks are trained (default: cpu)",
    )
    parser.add_argument(
        "--precision",
        choices=PRECISIONS,
        default="auto",
        help="of a network's training (default: bfloat16 where the hardware has it, else float32)",
    )
    parser.add_argument(
        "--docs", metavar="FILE", help="write the report to this .md file too, figures beside it"
    )
    parser.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    from feasibility.study.report import write_document, write_report
    from feasibility.study.runner import run_study

    out = Path(options.out)
    if options.name != _REPORT:
        names = tuple(EXPERIMENTS) if options.name == _ALL else (options.name,)
        began = time.perf_counter()

        def say(line: str) -> None:
            print(f"{time.perf_counter() - began:7.0f} s  {line}", flush=True)

        run_study(_settings(options, out), names, say)
    print(f"report: {write_report(out)}")
    if options.docs is not None:
        print(f"document: {write_document(out, Path(options.docs))}")
    return 0


def _settings(options: argparse.Namespace, out: Path) -> "Settings":
    from feasibility.study.runner import Settings

    if options.data is not None and options.catalogue is not None:
        raise InputError(
            "--data and --catalogue: expected one of them; the legs are there already"
        )
    return Settings(
        preset=find_preset(options.preset),
        out=out,
        data=None if options.data is None else Path(options.data),
        catalogue=options.catalogue,
        seed=options.seed,
        workers=options.workers or default_workers(),
        threads=options.threads,
        device=options.device,
        precision=options.precision,
    )
