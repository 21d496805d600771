"""The command ``seqsearch``."""

import argparse
import sys
from collections.abc import Sequence
from importlib import metadata
from typing import Final

from feasibility import InputError, MissingDependencyError
from feasibility.runtime.interrupts import interrupt_code, interruptible
from feasibility.runtime.terminal import end_output
from feasibility.runtime.warning_lines import warnings_as_lines
from feasibility.sims_flanagan.fast.compilation import prefer_fast_compilation
from seqsearch.commands import (
    bodies,
    export,
    fetch,
    fly,
    plot,
    polish,
    problems,
    refine,
    report,
    resume,
    run,
    verify,
)
from seqsearch.commands.options import set_output

_DESCRIPTION: Final = """\
Find asteroid tours for a low-thrust spacecraft.

A beam search proposes legs to near neighbours in a catalogue of asteroids, a
pruner drops those that cannot be flown, and the rest are optimised in the
Sims-Flanagan model.

  seqsearch run demo                      a synthetic belt; needs no file
  seqsearch fly 3673 2764 --problem demo  a sequence of your own
  seqsearch problems                      what else there is
  seqsearch resume runs/demo              go on after an interruption
  seqsearch polish runs/demo              improve its tour
  seqsearch refine runs/demo              from impulses to continuous thrust
  seqsearch verify runs/demo              check the result independently
  seqsearch report runs/demo              look at it in a browser
  seqsearch export runs/demo --to csv --out tour.csv
  seqsearch bodies MPCORB.DAT             what is in an asteroid table
  seqsearch fetch mpcorb                  bodies from those who publish them
"""

_COMMANDS: Final = (
    run,
    fly,
    resume,
    polish,
    refine,
    verify,
    plot,
    report,
    export,
    problems,
    bodies,
    fetch,
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return the exit code.

    0: done (and, for ``verify``, everything holds); 1: verification failed;
    2: input that cannot be used, with one line on stderr; 130 after Ctrl-C, 143 after SIGTERM.
    """
    prefer_fast_compilation()
    parsed = _parser().parse_args(arguments)
    set_output(parsed)
    with interruptible(), warnings_as_lines("seqsearch"):
        try:
            return int(parsed.run(parsed))
        except (InputError, MissingDependencyError) as error:
            print(f"seqsearch: {error}", file=sys.stderr)
            return 2
        except KeyboardInterrupt:
            print("seqsearch: interrupted; what was found is saved", file=sys.stderr)
            return interrupt_code() or 130
        finally:
            end_output()


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="seqsearch",
        description=_DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"seqsearch {_version()}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    for command in _COMMANDS:
        command.add_parser(commands)
    return parser


def _version() -> str:
    try:
        return metadata.version("seqsearch")
    except metadata.PackageNotFoundError:
        return "of a source tree"
