"""Options that several commands share, and numbers whose range is checked when they are read."""

import argparse
import re
from typing import Final, NoReturn, final

from feasibility.errors import InputError

_OUT_OF_RANGE: Final = re.compile(r"argument (?P<option>--[\w-]+): (?P<fault>\S+: expected .*)")


@final
class CommandParser(argparse.ArgumentParser):
    """A parser that raises InputError, one line, where a number is out of range.

    Other mistakes end as argparse ends them: usage on stderr, exit code 2.
    """

    def error(self, message: str) -> NoReturn:
        """Raise `InputError`, or end the program."""
        fault = _OUT_OF_RANGE.fullmatch(message)
        if fault is not None:
            raise InputError(f"{fault['option']} {fault['fault']}")
        super().error(message)


def one_or_more(text: str) -> int:
    """Return a number of an option, 1 or more; for argparse's ``type``."""
    return _whole_number(text, 1, "one or more")


def zero_or_more(text: str) -> int:
    """Return a number of an option, 0 or more; for argparse's ``type``."""
    return _whole_number(text, 0, "zero or more")


def _whole_number(text: str, least: int, range_in_words: str) -> int:
    try:
        number = int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"invalid int value: {text!r}") from None
    if number < least:
        raise argparse.ArgumentTypeError(f"{text}: expected {range_in_words}")
    return number


def add_common(
    parser: argparse.ArgumentParser, *, seed: str, workers: str | None = "processes"
) -> None:
    """Add ``--seed`` and ``--workers``.

    Parameters
    ----------
    parser : ArgumentParser
        The command's parser.
    seed : str
        What the seed is of, for the help.
    workers : str, optional
        What the workers are, for the help; None for a command without them. The value is None
        where the option is not given.
    """
    parser.add_argument(
        "--seed", type=zero_or_more, default=0, help=f"seed of {seed} (default: 0)"
    )
    if workers is not None:
        parser.add_argument("--workers", type=one_or_more, help=f"{workers} (default: one a core)")
