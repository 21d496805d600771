"""Compilation of the numeric kernels: one decorator, one cache, one announcement.

Kernels are compiled on first use and cached on disk beside their source (or in
numba's user cache where that folder is read-only, or else in the temporary folder), so
worker processes and later runs load them in milliseconds. The first compilation in a process that
finds no cache is announced on stderr, because it takes seconds.

Numba looks only at a kernel's own file to see whether its cache is stale, but a
compiled kernel contains the kernels that it calls. Here every kernel's cache
also depends on the text of all kernel files of this package. Each level of optimisation
(NUMBA_OPT) has a cache of its own, because results differ in the last digits.
"""

import functools
import gc
import hashlib
import multiprocessing
import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba.core import event

_F = TypeVar("_F", bound=Callable[..., Any])


def kernel(function: _F) -> _F:
    """Compile a numeric kernel: cached on disk, releases the GIL, IEEE division.

    The kernel works on bare arrays and numbers; it validates nothing.
    """
    return _compiled(function)


def inner_kernel(function: _F) -> _F:
    """Compile as `kernel` does what only other kernels call; it takes less time.

    The wrapper that unpacks Python's arguments is missing, so Python must not call it.
    """
    return _compiled(function, no_cpython_wrapper=True)


def summing_kernel(function: _F) -> _F:
    """Compile a kernel in which sums may be taken in another order, and so as vectors.

    The order is fixed when it is compiled: the same input has the same result.
    """
    return _compiled(function, fastmath={"reassoc", "contract", "nsz"})


def lane_kernel(function: _F) -> _F:
    """Compile as `inner_kernel` what does the same for each of some lanes, as vectors.

    A product and a sum may be one operation. All lanes are treated alike.
    """
    return _compiled(function, fastmath={"contract"}, no_cpython_wrapper=True)


def lane_function(function: _F) -> _F:
    """Compile as `lane_kernel` what its loops call: it becomes a part of them."""
    return _compiled(function, fastmath={"contract"}, no_cpython_wrapper=True, forceinline=True)


@contextmanager
def rare_collections() -> Iterator[None]:
    """Let Python look for garbage more rarely while much is compiled: a tenth less time.

    Numba makes millions of objects that live on; the memory used grows by about 200 MB.
    """
    before = gc.get_threshold()
    gc.set_threshold(200_000, 50, 100)
    try:
        yield
    finally:
        gc.set_threshold(*before)


def _compiled(function: _F, **options: bool | set[str]) -> _F:
    # The wrapper options are missing from numba's type hints.
    njit: Any = numba.njit
    # No cfunc wrapper: nothing calls kernels through C pointers.
    compile_as: Any = njit(nogil=True, error_model="numpy", no_cfunc_wrapper=True, **options)
    compiled: Any = compile_as(function)
    _enable_cache(compiled)
    # Private names of numba, so absence must do no harm; test_kernel_cache would tell.
    cache: Any = getattr(compiled, "_cache", None)
    index: Any = getattr(cache, "_cache_file", None)
    config: Any = numba.config
    if index is not None and hasattr(index, "_source_stamp"):
        base = f"{cache._impl.filename_base}-opt{int(config.OPT)}"
        stamp = (index._source_stamp, _kernel_sources_digest())
        cache._cache_file = type(index)(cache.cache_path, base, stamp)
    typed: _F = compiled
    return typed


def _enable_cache(compiled: Any) -> None:
    """Cache a kernel where numba can write, else in the temporary folder, else not at all."""
    try:
        compiled.enable_caching()
    except RuntimeError:
        # Numba has no folder to write to: a read-only installation and no home.
        folder = _temporary_cache()
        if folder is not None:
            _cache_in(folder, compiled)


def _cache_in(folder: Path, compiled: Any) -> None:
    config: Any = numba.config
    before = config.CACHE_DIR
    config.CACHE_DIR = str(folder)
    try:
        compiled.enable_caching()
    except RuntimeError:
        # The folder has become unusable meanwhile; the kernel works without.
        return
    finally:
        # The caller's own functions are cached where the caller wants them.
        config.CACHE_DIR = before


@functools.cache
def _temporary_cache() -> Path | None:
    """Return a folder of this user alone for compiled kernels, None where there can be none."""
    folder = _private_folder()
    if multiprocessing.parent_process() is None:
        place = f"they are cached in {folder}" if folder else "each process compiles them anew"
        print(
            "no folder for compiled kernels: neither the installation nor the home can be written "
            f"to; {place} (the environment variable NUMBA_CACHE_DIR can name another folder)",
            file=sys.stderr,
            flush=True,
        )
    return folder


def _private_folder() -> Path | None:
    user = os.getuid() if hasattr(os, "getuid") else None
    try:
        folder = Path(tempfile.gettempdir()) / f"feasibility-kernels-{user or 0}"
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return None
    # Compiled kernels are code: nobody else may have put them there.
    if user is not None and (found.st_uid != user or found.st_mode & 0o022):
        return None
    return folder


@functools.cache
def _kernel_sources_digest() -> str:
    """Return a digest of the text of all kernel files."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parents[1].rglob("*kernels.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()


class _Announcer(event.Listener):
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


_register: Any = event.register
_register("numba:compile", _Announcer())
