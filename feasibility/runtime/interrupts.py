"""Signals of a program: it ends once, tidily, and says how by its exit code."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Final

_CODES: Final = {signal.SIGINT: 130, signal.SIGTERM: 143}

_received: list[int] = []


class Interrupted(KeyboardInterrupt):
    """Ctrl-C, or a request to terminate."""


@contextmanager
def interruptible() -> Iterator[None]:
    """Raise `Interrupted` at the first Ctrl-C or SIGTERM and ignore those that follow.

    What is in progress is to be ended and saved then, which a second signal must not disturb.
    """
    _received.clear()
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, _interrupt) for number in _CODES}
    try:
        yield
    finally:
        for number, handler in before.items():
            # An interrupted program is about to end; a signal on the way out must not change how.
            signal.signal(number, signal.SIG_IGN if _received else handler)


def interrupt_code() -> int:
    """Return the exit code that tells of the signal that was received, 0 for none."""
    return _CODES[signal.Signals(_received[0])] if _received else 0


def _interrupt(number: int, _frame: FrameType | None) -> None:
    if not _received:
        _received.append(number)
        raise Interrupted
