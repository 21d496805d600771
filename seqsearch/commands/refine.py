"""``seqsearch refine``: from impulses to continuous thrust."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Final

from feasibility.runtime.terminal import say_json
from seqsearch.commands.options import add_output

if TYPE_CHECKING:
    from seqsearch.commands.options import Commands

_DESCRIPTION: Final = """\
Refine the best tour of a run from impulses to thrust that is constant over each day and never
more than the engine has, each leg with the least propellant and the mass that the legs before
it leave. Times are kept where they can be.

Writes trajectory.rows, which most competitions take as it is, and trajectory.json, which says
what changed. A run that found or polished a better tour since then has to be refined again.
"""


def add_parser(commands: "Commands") -> None:
    """Add the command's options."""
    refine = commands.add_parser(
        "refine",
        help="from impulses to continuous thrust",
        description=_DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    refine.add_argument("path", metavar="RUN", help="run folder")
    refine.add_argument(
        "--time-price",
        type=float,
        metavar="DAYS",
        help="what a day's delay may cost, in days of full thrust (default: 50); less saves "
        "propellant and spends time",
    )
    add_output(refine)
    refine.set_defaults(run=_refine)


def _refine(options: argparse.Namespace) -> int:
    # Imported here: the leg solver takes a while to load.
    from seqsearch.runs.refining import refine_run

    refined = refine_run(Path(options.path), time_price=options.time_price)
    if options.json:
        say_json({"folder": options.path, "tours": [tour.summary() for tour in refined]})
    return 0
