"""Pools of worker processes for long computations."""

import multiprocessing
import signal
import sys
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager


@contextmanager
def worker_pool(workers: int) -> Iterator[Executor | None]:
    """Yield a process pool whose workers leave Ctrl-C to this process; None for one worker.

    Parameters
    ----------
    workers : int
        Number of processes, one or more.
    """
    if workers == 1:
        yield None
        return
    # Workers start from a clean process: forking one that has loaded threaded libraries can hang.
    context = multiprocessing.get_context("forkserver" if sys.platform != "win32" else "spawn")
    pool = ProcessPoolExecutor(workers, mp_context=context, initializer=_ignore_interrupts)
    try:
        yield pool
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _ignore_interrupts() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
