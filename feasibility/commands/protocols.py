"""The command ``feasibility protocols``."""

import argparse
from typing import Any

from feasibility.errors import InputError


def add_parser(commands: Any) -> None:
    """Add the command to the parser's sub-commands."""
    parser = commands.add_parser(
        "protocols",
        help="show the built-in protocols",
        description="List the built-in protocols, or print one as TOML.",
    )
    parser.add_argument("name", nargs="?", help="print this one as TOML")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Do what the command line asks for and return the exit code.

    Raises
    ------
    InputError
        No built-in protocol has that name.
    """
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
