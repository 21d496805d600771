"""A running Dask cluster as an executor: lost workers are survived, and nothing waits for ever."""

import functools
import hashlib
import importlib
import importlib.util
import logging
import os
import pickle
import threading
import time
import uuid
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future
from concurrent.futures import wait as wait_for
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, final

from feasibility.errors import InputError, MissingDependencyError
from feasibility.runtime.workers import MendingPool, WorkersLostError, worker_pool

_CONNECT_S: Final = 5.0
"""How long to wait for a scheduler's answer."""

_FIRST_WORKER_S: Final = 10.0
"""How long to wait for a first worker."""

_PATIENCE_S: Final = 30.0
"""How long a cluster may be without any worker: Dask's nannies need some seconds to start one."""

_LOOK_EVERY_S: Final = 1.0


@final
@dataclass(frozen=True)
class _Expected:
    """Packages that a worker must have, each with the digest of its sources."""

    digests: tuple[tuple[str, str], ...]


@final
@dataclass(frozen=True)
class SharedValue:
    """A value that the workers of a cluster hold; stands for it among a call's arguments."""

    handle: Any


@final
@dataclass(frozen=True)
class _Place:
    """Where among a call's arguments a shared value belongs."""

    number: int


@final
class ClusterExecutor(Executor):
    """Calls functions on the workers of a Dask cluster.

    Where a worker is lost, Dask gives its calls to another one, so calls must not mind being
    run twice. Functions and arguments travel pickled; each worker checks that its packages
    have the sources of those here.

    Parameters
    ----------
    client : distributed.Client
        Connected to the scheduler.
    address : str
        The scheduler's, for messages.
    packages : sequence of str
        Packages whose sources must be the same everywhere.
    patience_s : float, optional
        How long the cluster may be without any worker before waiting calls are given up;
        default: half a minute.

    Attributes
    ----------
    mended : int
        Workers that were lost so far.
    threads : int
        Calls that the workers can run at the same time.
    """

    def __init__(
        self,
        client: Any,
        address: str,
        packages: Sequence[str],
        *,
        patience_s: float | None = None,
    ) -> None:
        self.mended = 0
        self._address = address
        self._patience_s = _PATIENCE_S if patience_s is None else patience_s
        self._client = client
        self._killed = importlib.import_module("distributed").KilledWorker
        self._expected = _Expected(tuple((name, source_digest(name)) for name in packages))
        self._check_workers()
        there = client.nthreads()
        self.threads = max(1, sum(there.values()))
        self._known = set(there)
        # Each call is one of its own, even where its arguments are another's.
        self._executor = client.get_executor(pure=False)
        self._lock = threading.Lock()
        self._pending: set[Future[Any]] = set()
        self._ended: Exception | None = None
        self._closed = threading.Event()
        threading.Thread(target=self._watch, daemon=True).start()

    def share(self, value: Any) -> SharedValue:
        """Send a value to the cluster once; calls take what is returned among their arguments.

        It is the result of a task, so that Dask makes it anew where all its holders are lost.
        """
        return SharedValue(self._client.submit(_itself, value, key=_key(_itself), pure=False))

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Call `fn` in a worker; the future raises `WorkersLostError` where none is left."""
        handles, places = [], []
        for argument in args:
            if isinstance(argument, SharedValue):
                handles.append(argument.handle)
                argument = _Place(len(handles) - 1)
            places.append(argument)
        packed = pickle.dumps((fn, places, kwargs))
        future: Future[Any] = Future()
        with self._lock:
            if self._ended is not None:
                raise self._ended
            self._pending.add(future)
        try:
            inner = self._executor.submit(_call, self._expected, packed, *handles, key=_key(fn))
        except RuntimeError:
            # Dask's word for a client that could not connect again.
            raise WorkersLostError(self._gone()) from None
        future.add_done_callback(functools.partial(self._forget, inner))
        inner.add_done_callback(functools.partial(self._end, future))
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Take no more calls; the cluster goes on."""
        pending = self._close(RuntimeError("the executor was shut down"))
        if cancel_futures:
            for future in pending:
                future.cancel()
        elif wait:
            wait_for(pending)

    def abandon(self) -> None:
        """Take no more calls and withdraw those that have not begun."""
        self.shutdown(wait=False, cancel_futures=True)

    def _check_workers(self) -> None:
        """Raise InputError where a worker has other sources, or does not know them."""
        answers = self._client.run(_fault, self._expected, on_error="return")
        for worker, fault in answers.items():
            if isinstance(fault, BaseException):
                names = " and ".join(name for name, _ in self._expected.digests)
                fault = f"cannot load {names} as they are here ({_one_line(fault)})"
            if fault is not None:
                raise InputError(f"--scheduler {self._address}: worker {worker} {fault}")

    def _forget(self, inner: Future[Any], future: Future[Any]) -> None:
        if self._claim(future) and future.cancelled():
            # Those who wait for several futures wake up at this.
            future.set_running_or_notify_cancel()
            inner.cancel()

    def _end(self, future: Future[Any], inner: Future[Any]) -> None:
        error = WorkersLostError(self._gone()) if inner.cancelled() else inner.exception()
        if isinstance(error, self._killed):
            error = WorkersLostError(
                f"workers of {self._address} died again and again over the same call "
                "(killed, or out of memory)"
            )
        if error is not None:
            self._fail(future, error)
        elif self._claim(future) and future.set_running_or_notify_cancel():
            future.set_result(inner.result())

    def _fail(self, future: Future[Any], error: BaseException) -> None:
        if self._claim(future) and future.set_running_or_notify_cancel():
            future.set_exception(error)

    def _claim(self, future: Future[Any]) -> bool:
        """Tell whether a call is still under way, and end it: one thread may say how."""
        with self._lock:
            under_way = future in self._pending
            self._pending.discard(future)
            return under_way

    def _gone(self) -> str:
        return f"the Dask scheduler {self._address} is gone"

    def _watch(self) -> None:
        """Give up where no worker has been there for too long."""
        seen = time.monotonic()
        while not self._closed.wait(_LOOK_EVERY_S):
            try:
                there = set(self._client.nthreads())
            except Exception:
                # A cluster that does not answer has no workers.
                there = set()
            self.mended += len(self._known - there)
            self._known = there
            if there or not self._pending:
                seen = time.monotonic()
            elif time.monotonic() - seen > self._patience_s:
                lost = WorkersLostError(
                    f"all workers of the Dask scheduler {self._address} are lost"
                )
                for future in self._close(lost):
                    self._fail(future, lost)

    def _close(self, reason: Exception) -> list[Future[Any]]:
        """Refuse calls from now on and return those under way."""
        self._closed.set()
        with self._lock:
            self._ended = self._ended or reason
            return list(self._pending)


@contextmanager
def cluster(address: str, packages: Sequence[str]) -> Iterator[ClusterExecutor]:
    """Yield an executor on a running Dask cluster.

    Parameters
    ----------
    address : str
        The scheduler's, such as ``"tcp://host:8786"``.
    packages : sequence of str
        Packages whose sources must be the same on all workers.

    Raises
    ------
    InputError
        No scheduler there, no worker, or a worker with other sources.
    MissingDependencyError
        Dask is not installed.
    """
    client = _connected(address)
    try:
        executor = ClusterExecutor(client, address, packages)
        try:
            yield executor
        finally:
            executor.abandon()
    finally:
        client.close()


@contextmanager
def crew(
    workers: int, scheduler: str | None, packages: Sequence[str]
) -> Iterator[MendingPool | ClusterExecutor | None]:
    """Yield who works: a cluster if a scheduler's address is given, else processes here.

    Parameters
    ----------
    workers : int
        Number of processes; None is yielded for one. Of no meaning with a scheduler.
    scheduler : str or None
        Address of a Dask scheduler.
    packages : sequence of str
        Packages whose sources must be the same on all workers of a cluster.
    """
    if scheduler is None:
        with worker_pool(workers) as pool:
            yield pool
    else:
        with cluster(scheduler, packages) as executor:
            yield executor


def shared(executor: Executor, value: Any) -> Any:
    """Return what stands for a value among the arguments of many calls of an executor.

    A cluster gets the value once; other executors get it with each call.
    """
    return executor.share(value) if isinstance(executor, ClusterExecutor) else value


def source_digest(package: str) -> str:
    """Return a digest of a package's Python files and their paths within it.

    Raises
    ------
    InputError
        There is no such package.
    """
    spec = importlib.util.find_spec(package)
    if spec is None or spec.origin is None:
        raise InputError(f"package {package} is not installed")
    root = Path(spec.origin).parent
    digest = hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        digest.update(path.relative_to(root).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _connected(address: str) -> Any:
    try:
        distributed: Any = importlib.import_module("distributed")
    except ImportError:
        raise MissingDependencyError(
            "--scheduler needs dask, which is not installed; pip install 'seqsearch[dask]'"
        ) from None
    # What goes wrong is said in one line, by this module.
    for name in [*logging.root.manager.loggerDict]:
        if name.partition(".")[0] == "distributed":
            logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        client = distributed.Client(address, timeout=_CONNECT_S, set_as_default=False)
    except (OSError, ValueError) as error:
        raise InputError(
            f"--scheduler {address}: no Dask scheduler there ({_one_line(error)})"
        ) from None
    try:
        client.wait_for_workers(1, timeout=_FIRST_WORKER_S)
    except Exception as error:
        client.close()
        raise InputError(
            f"--scheduler {address}: has no worker; start one with: dask worker {address}"
        ) from error
    return client


@functools.cache
def _fault(expected: _Expected) -> str | None:
    """Return how the sources of this process, a worker's, differ from what is expected."""
    # The solver's kernels are to be compiled as our own programs compile them.
    os.environ.setdefault("NUMBA_OPT", "1")
    for name, digest in expected.digests:
        if source_digest(name) != digest:
            version = getattr(importlib.import_module(name), "__version__", "of no version")
            return f"has another {name} ({version}) than this machine; expected the same sources"
    return None


def _call(expected: _Expected, packed: bytes, *values: Any) -> Any:
    """Run a call, in a worker."""
    if fault := _fault(expected):
        raise InputError(f"--scheduler: a worker {fault}")
    try:
        function, places, kwargs = pickle.loads(packed)
    except ImportError as error:
        raise InputError(
            f"--scheduler: a worker lacks what this machine has ({_one_line(error)})"
        ) from error
    arguments = [values[place.number] if isinstance(place, _Place) else place for place in places]
    return function(*arguments, **kwargs)


def _itself(value: Any) -> Any:
    return value


def _key(function: Callable[..., Any]) -> str:
    """Return a name for a task, after which Dask groups tasks."""
    name = getattr(function, "__name__", "call").strip("_")
    return f"{name}-{uuid.uuid4().hex}"


def _one_line(error: BaseException) -> str:
    return (str(error) or type(error).__name__).partition("\n")[0]
