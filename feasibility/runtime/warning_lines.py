"""Warnings of a command as one line each, as its errors are."""

import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TextIO


@contextmanager
def warnings_as_lines(program: str) -> Iterator[None]:
    """Print warnings for users as ``program: warning: ...`` on stderr, each text once.

    Parameters
    ----------
    program : str
        Name of the command.
    """
    told: set[str] = set()

    def show(
        message: Warning | str,
        category: type[Warning],
        filename: str,
        lineno: int,
        file: TextIO | None = None,
        line: str | None = None,
    ) -> None:
        text = str(message)
        if category is not UserWarning:
            text = warnings.formatwarning(message, category, filename, lineno, line).rstrip()
        else:
            text = f"{program}: warning: {text}"
        if text not in told:
            told.add(text)
            print(text, file=file or sys.stderr)

    with warnings.catch_warnings():
        warnings.simplefilter("always", UserWarning)
        warnings.showwarning = show
        yield
