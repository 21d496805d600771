"""The command ``feasibility``."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from feasibility.commands import assess, evaluate, retrain, study, train
from feasibility.errors import InputError, MissingDependencyError
from feasibility.sims_flanagan.fast.compilation import prefer_fast_compilation

_DESCRIPTION: Final = """\
Know whether a low-thrust leg can be flown: make the data, look at it, train and
judge classifiers, repeat the experiments of the paper.

  feasibility generate search --legs 20000 --out data/search
  feasibility inspect data/search
  feasibility protocols table1            print a protocol, to make your own
  feasibility train data/search --model margin --out mine.seqmodel
  feasibility evaluate mine.seqmodel data/search
  feasibility assess probe.toml           good enough for my spacecraft?
  feasibility retrain probe.toml --out probe.seqmodel
"""

_GENERATE: Final = """\
Draw legs and label each with its maximum initial mass m*: the leg can be flown
with every initial mass up to m*. The result is a folder of Parquet files with
a metadata.json that says how it was made and what each column means.

The rows depend on the protocol, the catalogue and the seed alone, not on the
number of workers; a larger dataset begins with the rows of a smaller one.
Run the command again to go on after an interruption, or with more --legs to
enlarge a dataset.
"""

_INSPECT: Final = """\
Count the legs of a dataset, their labels and the solver's time, and draw the
histogram of the margin log(m*/m0) (also as margin.png in the folder). With
--resolve, solve some legs again with the reference solver and compare.
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return the exit code.

    0: done; 1: a worker process died; 2: input that cannot be used, with one
    line on stderr; 130: interrupted.
    """
    prefer_fast_compilation()
    parsed = _parser().parse_args(arguments)
    try:
        return int(parsed.run(parsed))
    except (InputError, MissingDependencyError) as error:
        print(f"feasibility: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("feasibility: interrupted", file=sys.stderr)
        return 130


def _parser() -> argparse.ArgumentParser:
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(
        prog="feasibility", description=_DESCRIPTION, formatter_class=raw
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    generate = commands.add_parser(
        "generate",
        help="draw and label legs",
        description=_GENERATE,
        formatter_class=raw,
    )
    generate.add_argument("protocol", help="name of a built-in protocol, or a TOML file")
    generate.add_argument("--legs", type=int, required=True, metavar="N", help="rows in all")
    generate.add_argument("--out", required=True, metavar="DIR", help="folder of the dataset")
    generate.add_argument("--seed", type=int, default=0, help="seed of the draws (default: 0)")
    generate.add_argument("--workers", type=int, help="processes (default: one a core)")
    generate.add_argument(
        "--catalogue", metavar="FILE", help="asteroid table (default: a synthetic main belt)"
    )
    generate.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="use a running Dask cluster, such as tcp://host:8786, instead of own processes",
    )
    generate.set_defaults(run=_generate)

    inspect = commands.add_parser(
        "inspect", help="describe a dataset", description=_INSPECT, formatter_class=raw
    )
    inspect.add_argument("folder", metavar="DIR", help="folder of the dataset")
    inspect.add_argument(
        "--resolve",
        type=int,
        default=0,
        metavar="N",
        help="solve N random legs again with the reference solver (about 0.3 s a leg)",
    )
    inspect.set_defaults(run=_inspect)

    protocols = commands.add_parser(
        "protocols",
        help="show the built-in protocols",
        description="List the built-in protocols, or print one as TOML.",
    )
    protocols.add_argument("name", nargs="?", help="print this one as TOML")
    protocols.set_defaults(run=_protocols)
    train.add_parser(commands)
    evaluate.add_parser(commands)
    assess.add_parser(commands)
    retrain.add_parser(commands)
    study.add_parser(commands)
    return parser


def _generate(options: argparse.Namespace) -> int:
    from feasibility.commands.generate import run_generate

    return run_generate(
        options.protocol,
        legs=options.legs,
        out=Path(options.out),
        seed=options.seed,
        workers=options.workers,
        catalogue=options.catalogue,
        scheduler=options.scheduler,
    )


def _inspect(options: argparse.Namespace) -> int:
    from feasibility.dataset.inspection import inspect_dataset

    print(inspect_dataset(Path(options.folder), resolve=options.resolve))
    return 0


def _protocols(options: argparse.Namespace) -> int:
    from feasibility.dataset import builtin_protocols, read_protocol

    texts = builtin_protocols()
    if options.name is None:
        for name in texts:
            print(f"{name:<10} {read_protocol(name).description}")
        return 0
    if options.name not in texts:
        raise InputError(f"{options.name}: no such protocol; known are {', '.join(texts)}")
    print(texts[options.name], end="")
    return 0
