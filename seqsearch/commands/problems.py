"""``seqsearch problems``: show the problems that are installed."""

import argparse
from typing import TYPE_CHECKING

from feasibility import InputError
from feasibility.runtime.terminal import say

if TYPE_CHECKING:
    from seqsearch.commands.options import Commands


def add_parser(commands: "Commands") -> None:
    """Add the command's options."""
    problems = commands.add_parser(
        "problems",
        help="show the built-in problems",
        description=(
            "List the built-in problems, or print one as TOML: the starting point for a problem "
            "file of your own."
        ),
    )
    problems.add_argument("name", nargs="?", help="print this one as TOML")
    problems.set_defaults(run=_problems)


def _problems(options: argparse.Namespace) -> int:
    from seqsearch.problems.problem_file import read_config
    from seqsearch.problems.registry import builtin_problems

    texts = builtin_problems()
    if options.name is None:
        for name in texts:
            say(f"{name:<12} {read_config(name).problem.description}")
        return 0
    if options.name not in texts:
        raise InputError(f"{options.name}: no such problem; known are {', '.join(texts)}")
    say(texts[options.name].rstrip("\n"))
    return 0
