"""What a program prints: how much of it, for people or for programs, and to nobody at all."""

import json
import os
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from enum import IntEnum
from typing import Any, Final


class Level(IntEnum):
    """How much is printed; each level includes those before."""

    SILENT = 0
    RESULTS = 1
    PROGRESS = 2
    DETAILS = 3


_level: Final = [Level.PROGRESS]


def set_level(level: Level) -> None:
    """Set how much is printed from now on."""
    _level[0] = level


def shows(level: Level) -> bool:
    """Tell whether what is of a level is printed."""
    return level <= _level[0]


def say(text: str = "", level: Level = Level.RESULTS) -> None:
    """Print a line; where nobody reads it any more, go on without printing."""
    if shows(level):
        _print(text)


def say_json(record: Mapping[str, Any] | Sequence[Any]) -> None:
    """Print a result for programs, whatever the level."""
    _print(json.dumps(record, indent=1))


def end_output() -> None:
    """Write out what was printed; quietly where nobody reads it any more."""
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        _close_stdout()


def _print(text: str) -> None:
    try:
        print(text, flush=True)
    except BrokenPipeError:
        _close_stdout()


def _close_stdout() -> None:
    # Python itself flushes once more at its end, which must not fail either.
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
