"""The command ``feasibility``."""

import argparse
import sys
from collections.abc import Sequence
from typing import Final

from feasibility import __version__
from feasibility.commands import (
    assess,
    evaluate,
    generate,
    inspect,
    protocols,
    retrain,
    study,
    train,
)
from feasibility.commands.options import CommandParser
from feasibility.errors import InputError, MissingDependencyError
from feasibility.runtime.interrupts import interrupt_code, interruptible
from feasibility.runtime.terminal import end_output
from feasibility.runtime.warning_lines import warnings_as_lines
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


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return the exit code.

    0: done; 1: a worker process died; 2: input that cannot be used, with one
    line on stderr; 130 after Ctrl-C, 143 after SIGTERM.
    """
    prefer_fast_compilation()
    with interruptible(), warnings_as_lines("feasibility"):
        try:
            options = _parser().parse_args(arguments)
            return int(options.run(options))
        except (InputError, MissingDependencyError) as error:
            print(f"feasibility: {error}", file=sys.stderr)
            return 2
        except KeyboardInterrupt:
            print("feasibility: interrupted", file=sys.stderr)
            return interrupt_code() or 130
        except BrokenPipeError:
            return 0
        finally:
            end_output()


def _parser() -> argparse.ArgumentParser:
    parser = CommandParser(
        prog="feasibility",
        description=_DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"%(prog)s {__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    for command in (generate, inspect, protocols, train, evaluate, assess, retrain, study):
        command.add_parser(commands)
    return parser
