"""``seqsearch polish``: improve a run's tour."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Final

from seqsearch.commands.options import (
    add_catalogue,
    add_output,
    add_workers,
    print_result,
    seconds,
)

if TYPE_CHECKING:
    from seqsearch.commands.options import Commands

_DESCRIPTION: Final = """\
Make the best tours of a run shorter in time and, with what that frees, longer in asteroids.

All epochs and stays of a tour are optimised together; then other bodies are tried at its
ends, and more of them, each time with all epochs anew. sequence.json is replaced if the
result is better, and sequence.search.json keeps what the search found; polish.json says
what was gained. The same seed gives the same tour with any number of workers, unless a
time limit cuts the work short.
"""


def add_parser(commands: "Commands") -> None:
    """Add the command's options."""
    polish = commands.add_parser(
        "polish",
        help="improve a run's tour",
        description=_DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    polish.add_argument("path", metavar="RUN", help="run folder")
    polish.add_argument(
        "--time-limit", metavar="T", help="stop after 90s, 10min, 1h (default: after some rounds)"
    )
    polish.add_argument("--seed", type=int, default=0, help="seed of the moves (default: 0)")
    add_catalogue(polish)
    add_workers(polish)
    add_output(polish)
    polish.set_defaults(run=_polish)


def _polish(options: argparse.Namespace) -> int:
    from seqsearch.runs.polishing import polish_run

    code = polish_run(
        Path(options.path),
        time_limit_s=seconds(options.time_limit),
        seed=options.seed,
        workers=options.workers,
        scheduler=options.scheduler,
        catalogue=options.catalogue,
    )
    return print_result(options, Path(options.path), code)
