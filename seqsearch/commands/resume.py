"""``seqsearch resume``: go on with a run."""

import argparse
import re
from pathlib import Path
from typing import TYPE_CHECKING, Final

from feasibility import InputError
from seqsearch.commands.options import add_catalogue, add_limits, add_output, print_result, seconds

if TYPE_CHECKING:
    from seqsearch.commands.options import Commands

_DESCRIPTION: Final = """\
Go on with a run that was interrupted, killed or stopped by a limit.

The run goes on after the last rank that it finished. With the same limits it ends with
the same tour as if it had never stopped. Limits count what earlier sessions used: a run
that has used up its limit needs a larger one.
"""


def add_parser(commands: "Commands") -> None:
    """Add the command's options."""
    resume = commands.add_parser(
        "resume",
        help="go on with a run",
        description=_DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    resume.add_argument("path", metavar="RUN", help="run folder")
    resume.add_argument(
        "--from-rank",
        metavar="PASS:RANK",
        help="go on after this rank, such as 2:5, and drop what came later; 0:0 is the beginning",
    )
    add_catalogue(resume)
    add_limits(resume)
    add_output(resume)
    resume.set_defaults(run=_resume)


def _resume(options: argparse.Namespace) -> int:
    from seqsearch.budget import Limits
    from seqsearch.runs.carrier_run import is_carrier_search, resume_carrier
    from seqsearch.runs.resuming import resume_search

    path = Path(options.path)
    if is_carrier_search(path):
        if options.from_rank is not None or options.max_solves is not None:
            raise InputError(f"{path}: a carrier's run has neither ranks nor a number of solves")
        limits = Limits(
            time_limit_s=seconds(options.time_limit),
            workers=options.workers,
            scheduler=options.scheduler,
        )
        code = resume_carrier(path, limits, options.catalogue)
        return print_result(options, path, code)
    code = resume_search(
        Path(options.path),
        after=None if options.from_rank is None else parse_rank(options.from_rank),
        time_limit_s=seconds(options.time_limit),
        max_solves=options.max_solves,
        workers=options.workers,
        scheduler=options.scheduler,
        catalogue=options.catalogue,
    )
    return print_result(options, Path(options.path), code)


def parse_rank(text: str) -> tuple[int, int]:
    """Return pass and rank from a text such as ``2:5``.

    Raises
    ------
    InputError
        Anything else.
    """
    match = re.fullmatch(r"([0-9]+):([0-9]+)", text.strip())
    if match is None:
        raise InputError(f"--from-rank {text!r}: expected PASS:RANK, such as 2:5")
    return int(match[1]), int(match[2])
