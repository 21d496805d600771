"""Processes and threads for long computations: pools of them, and how many."""

import functools
import math
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import (
    BrokenExecutor,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
)
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, TypeVar, final

from threadpoolctl import threadpool_limits

_Item = TypeVar("_Item")
_Answer = TypeVar("_Answer")

_TRIES: Final = 3
"""How often a call is begun before its workers' deaths are taken for its own doing."""

_DIED: Final = f"worker processes died {_TRIES} times in a row (killed, or out of memory)"
_NEVER_STARTED: Final = (
    "worker processes ended before they began to work; each imports the main program first, so "
    "put what starts them under: if __name__ == '__main__':"
)
# Workers start from a clean process: forking one that has loaded threaded libraries can hang.
_START_METHOD: Final = multiprocessing.get_context(
    "forkserver" if sys.platform != "win32" else "spawn"
)


@final
class WorkersLostError(BrokenExecutor):
    """Worker processes died again and again over the same call, or all as they started."""


@final
class MendingPool(Executor):
    """A process pool that outlives its workers.

    Where a worker dies (killed by hand, or by a system short of memory), the
    pool is made anew and every call that was not finished is begun again, three
    times at most. Calls must not mind being run twice.

    Parameters
    ----------
    workers : int
        Number of processes.

    Attributes
    ----------
    mended : int
        How often the pool was made anew.
    """

    def __init__(self, workers: int) -> None:
        self.mended = 0
        self._workers = workers
        self._lock = threading.Lock()
        self._closed = False
        _leave_if_the_main_program_runs_again()
        self._started = _START_METHOD.Event()
        self._pool = _process_pool(workers, self._started)

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Call `fn` in a worker; the future raises `WorkersLostError` where the pool gives up."""
        call = _Call(functools.partial(fn, *args, **kwargs))
        self._begin(call)
        return call.future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the workers."""
        with self._lock:
            self._closed = True
        self._pool.shutdown(wait=wait, cancel_futures=cancel_futures)

    def abandon(self) -> None:
        """End the workers at once, whatever they are doing."""
        with self._lock:
            self._closed = True
        # Private until Python 3.14 has terminate_workers; without it they end a little later.
        processes = dict(getattr(self._pool, "_processes", None) or {})
        for process in processes.values():
            process.terminate()

    def _begin(self, call: "_Call") -> None:
        # No lock is held while a pool is asked: it tells of its end under a lock of its own.
        while True:
            pool = self._pool
            try:
                inner = pool.submit(call.function)
                break
            except BrokenExecutor:
                self._replace(pool)
        call.inner = inner
        inner.add_done_callback(functools.partial(self._end, call, pool))
        if call.future.cancelled():
            inner.cancel()

    def _replace(self, broken: ProcessPoolExecutor) -> None:
        with self._lock:
            if self._closed:
                raise RuntimeError("the pool was shut down")
            if self._pool is broken:
                self._pool = _process_pool(self._workers, self._started)
                self.mended += 1

    def _end(self, call: "_Call", pool: ProcessPoolExecutor, inner: Future[Any]) -> None:
        if inner.cancelled():
            call.future.cancel()
            call.future.set_running_or_notify_cancel()
            return
        error = inner.exception()
        if isinstance(error, BrokenExecutor) and not call.future.cancelled():
            call.tries += 1
            try:
                self._replace(pool)
                if call.tries < _TRIES and self._started.is_set():
                    self._begin(call)
                    return
                error = WorkersLostError(_DIED if self._started.is_set() else _NEVER_STARTED)
            except RuntimeError as closed:
                error = closed
        if not call.future.set_running_or_notify_cancel():
            return
        if error is None:
            call.future.set_result(inner.result())
        else:
            call.future.set_exception(error)


@final
class _Call:
    """A call, the future that its caller holds, and the one of the present pool."""

    def __init__(self, function: Callable[[], Any]) -> None:
        self.function = function
        self.tries = 0
        self.inner: Future[Any] | None = None
        self.future: Future[Any] = Future()
        self.future.add_done_callback(self._pass_on)

    def _pass_on(self, future: Future[Any]) -> None:
        if future.cancelled() and self.inner is not None:
            self.inner.cancel()


def own_threads() -> int:
    """Return how many threads a computation of this process may use.

    One for each processor that the process may run on, but one alone in a worker process,
    whose siblings use the others.
    """
    return usable_processors() if multiprocessing.parent_process() is None else 1


def usable_processors() -> int:
    """Return how many processors this process may run on: pinned or in a container, not all."""
    if hasattr(os, "sched_getaffinity"):
        return min(len(os.sched_getaffinity(0)), _container_limit())
    return os.cpu_count() or 1


def _container_limit(file: Path = Path("/sys/fs/cgroup/cpu.max")) -> int:
    """Return how many processors' time Linux grants a container, a large number if all."""
    try:
        quota, period = file.read_text(encoding="ascii").split()
        return max(1, math.ceil(int(quota) / int(period)))
    except (OSError, ValueError):
        # No such limit: there is no file, or its first word is "max".
        return sys.maxsize


def default_workers() -> int:
    """Return how many workers there are where the user names no number: one a processor."""
    return usable_processors()


def in_threads(
    work: Callable[[_Item], _Answer], items: Iterable[_Item], threads: int
) -> Iterator[_Answer]:
    """Yield what `work` makes of each item, in order, with few items under way at a time."""
    if threads == 1:
        yield from map(work, items)
        return
    with ThreadPoolExecutor(threads) as pool:
        under_way = []
        for item in items:
            under_way.append(pool.submit(work, item))
            if len(under_way) > 2 * threads:
                yield under_way.pop(0).result()
        for future in under_way:
            yield future.result()


@contextmanager
def worker_pool(workers: int) -> Iterator[MendingPool | None]:
    """Yield a process pool whose workers leave Ctrl-C to this process; None for one worker.

    Parameters
    ----------
    workers : int
        Number of processes, one or more.
    """
    if workers == 1:
        yield None
        return
    pool = MendingPool(workers)
    try:
        yield pool
    except KeyboardInterrupt:
        pool.abandon()
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _process_pool(workers: int, started: Any) -> ProcessPoolExecutor:
    main: Any = sys.modules.get("__main__")
    if getattr(main, "__file__", None) == "<stdin>":
        # Workers would look for a file of this name; without it they import no main program.
        del main.__file__
    return ProcessPoolExecutor(
        workers, mp_context=_START_METHOD, initializer=_prepare_worker, initargs=(started,)
    )


def _leave_if_the_main_program_runs_again() -> None:
    """End a worker whose main program, imported for the second time, asks for workers again.

    multiprocessing would do so with a traceback for each; the first process says it in a line.
    """
    # Private, but as old as multiprocessing; without it the tracebacks are seen.
    if getattr(multiprocessing.current_process(), "_inheriting", False):
        os._exit(1)


def _prepare_worker(started: Any) -> None:
    started.set()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # Workers use all processors already; threads of linear algebra would wait for each other:
    # with two workers on two processors small networks took six times as long.
    os.environ["OMP_NUM_THREADS"] = "1"
    threadpool_limits(1)
    # A worker waits for work for ever, even where its parent was killed.
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
