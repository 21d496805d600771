"""Linear algebra on one thread: where the caller's threads share the work already.

The matrices of our nets are small. BLAS libraries would split each product over all processors,
whose threads then wait for each other: 7 to 30 times slower where other programs run too.
"""

import functools
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from threadpoolctl import ThreadpoolController

_lock = threading.Lock()
_inside = 0
_before: list[tuple[Any, int]] = []


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Hold numpy's linear algebra to one thread, in all threads of this process meanwhile.

    May be entered again, also from several threads; what was set before returns when the
    last has left.
    """
    global _inside
    with _lock:
        _inside += 1
        if _inside == 1:
            for library in _libraries():
                threads = library.get_num_threads()
                if threads != 1:
                    _before.append((library, threads))
                    library.set_num_threads(1)
    try:
        yield
    finally:
        with _lock:
            _inside -= 1
            if _inside == 0:
                while _before:
                    library, threads = _before.pop()
                    library.set_num_threads(threads)


@functools.cache
def _libraries() -> list[Any]:
    """Return the BLAS libraries of this process; looking for them takes a millisecond."""
    controllers: list[Any] = ThreadpoolController().select(user_api="blas").lib_controllers
    return controllers
