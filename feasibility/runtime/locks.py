"""Locks on folders: one process at a time writes to a run or a dataset."""

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from feasibility.errors import InputError
from feasibility.runtime.atomic import remove_stale

LOCK: Final = ".lock"
"""Name of the file that is locked; it holds the number of the process."""


@contextmanager
def folder_lock(folder: Path) -> Iterator[None]:
    """Hold a folder for this process, and remove what dead ones left half-written in it.

    The system releases the lock of a process that dies, however it does.

    Parameters
    ----------
    folder : Path
        The folder; it has to be there.

    Raises
    ------
    InputError
        Another process holds it, or the folder cannot be written to.
    """
    file = folder / LOCK
    try:
        descriptor = os.open(file, os.O_RDWR | os.O_CREAT, 0o644)
    except OSError as error:
        raise InputError(f"{folder}: cannot be written to ({error.strerror})") from None
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            holder = os.pread(descriptor, 20, 0).decode("ascii", "replace").strip()
            raise InputError(
                f"{folder}: in use by another process ({holder or 'number unknown'}); "
                "wait for it, or end it"
            ) from None
        os.ftruncate(descriptor, 0)
        os.pwrite(descriptor, f"{os.getpid()}\n".encode(), 0)
        remove_stale(folder)
        yield
    finally:
        os.close(descriptor)
