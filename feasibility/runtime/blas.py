"""Linear algebra on one thread: where the caller's threads share the work already.

The matrices of our nets are small. BLAS libraries would split each product over all processors,
whose threads then wait for each other: 7 to 30 times slower where other programs run too.
"""

import functools
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, final

from threadpoolctl import ThreadpoolController


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Hold numpy's linear algebra to one thread, in all threads of this process meanwhile.

    May be entered again, also from several threads; what was set before returns when the
    last has left.
    """
    _hold.enter()
    try:
        yield
    finally:
        _hold.leave()


@final
class _Hold:
    """Counts who is inside, and remembers what was set before the first came in."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._inside = 0
        self._before: list[tuple[Any, int]] = []

    def enter(self) -> None:
        with self._lock:
            self._inside += 1
            if self._inside == 1:
                threads = [(library, library.get_num_threads()) for library in _libraries()]
                self._before = [(library, n) for library, n in threads if n != 1]
                for library, _ in self._before:
                    library.set_num_threads(1)

    def leave(self) -> None:
        with self._lock:
            self._inside -= 1
            if self._inside == 0:
                for library, n in self._before:
                    library.set_num_threads(n)


@functools.cache
def _libraries() -> list[Any]:
    """Return the BLAS libraries of this process; looking for them takes a millisecond."""
    controllers: list[Any] = ThreadpoolController().select(user_api="blas").lib_controllers
    return controllers


_hold = _Hold()
