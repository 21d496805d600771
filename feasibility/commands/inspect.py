"""The command ``feasibility inspect``."""

import argparse
from pathlib import Path
from typing import Any, Final

from feasibility.commands.options import zero_or_more

_DESCRIPTION: Final = """\
Count the legs of a dataset, their labels and the solver's time, and draw the
histogram of the margin log(m*/m0) (also as margin.png in the folder). With
--resolve, solve some legs again with the reference solver and compare.
"""


def add_parser(commands: Any) -> None:
    """Add the command to the parser's sub-commands."""
    parser = commands.add_parser(
        "inspect",
        help="describe a dataset",
        description=_DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("folder", metavar="DIR", help="folder of the dataset")
    parser.add_argument(
        "--resolve",
        type=zero_or_more,
        default=0,
        metavar="N",
        help="solve N random legs again with the reference solver (about 0.3 s a leg)",
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Do what the command line asks for and return the exit code.

    Raises
    ------
    InputError
        The dataset cannot be read, or the picture not be written.
    """
    from feasibility.dataset.inspection import inspect_dataset

    print(inspect_dataset(Path(options.folder), resolve=options.resolve))
    return 0
