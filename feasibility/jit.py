"""Compilation of the numeric kernels: one decorator, one announcement.

Kernels are compiled on first use and cached on disk beside their source (or in
numba's user cache where that folder is read-only), so worker processes and
later runs load them in milliseconds. The first compilation in a process that
finds no cache is announced on stderr, because it takes seconds.
"""

import sys
from collections.abc import Callable
from typing import Any, TypeVar

import numba
from numba.core import event

_F = TypeVar("_F", bound=Callable[..., Any])


def kernel(function: _F) -> _F:
    """Compile a numeric kernel: cached on disk, releases the GIL, IEEE division.

    The kernel works on bare arrays and numbers; it validates nothing.
    """
    compiled: _F = numba.njit(cache=True, nogil=True, error_model="numpy")(function)
    return compiled


class _Announcer(event.Listener):  # type: ignore[misc]
    """Says once that kernels are being compiled."""

    def __init__(self) -> None:
        self._said = False

    def on_start(self, ev: Any) -> None:
        dispatcher = ev.data.get("dispatcher")
        if self._said or not getattr(dispatcher, "__module__", "").startswith("feasibility"):
            return
        self._said = True
        print(
            "compiling numeric kernels (first use on this machine, some seconds; then cached)",
            file=sys.stderr,
            flush=True,
        )

    def on_end(self, ev: Any) -> None:
        """Nothing to say at the end: the next line of output is the caller's own."""


event.register("numba:compile", _Announcer())
