"""SPICE through spiceypy: one thread at a time, files opened and closed, errors in one line.

SPICE keeps global state. Nothing here loads a kernel into it: files are opened as plain DAF
files and evaluated by handle, so that kernels which a user has loaded, and their order, stay as
they are.
"""

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from feasibility.errors import InputError, MissingDependencyError

_ONE_AT_A_TIME: Final = threading.RLock()
"""SPICE is not thread-safe."""

_LONGEST_PATH: Final = 250
"""Characters; SPICE cuts file names at 255."""


@contextmanager
def spice() -> Iterator[Any]:
    """Yield spiceypy to one thread at a time.

    Raises
    ------
    MissingDependencyError
        It is not installed.
    """
    with _ONE_AT_A_TIME:
        yield _spiceypy()


@contextmanager
def opened(path: Path) -> Iterator[int]:
    """Yield the handle of an SPK file, which is closed again at the end.

    Raises
    ------
    InputError
        SPICE cannot read it, here or in what is done with the handle.
    """
    spiceypy = _spiceypy()
    name = str(path)
    if len(name) > _LONGEST_PATH:
        name = os.path.relpath(path)
    try:
        handle = spiceypy.dafopr(name)
        try:
            yield handle
        finally:
            spiceypy.dafcls(handle)
    except spiceypy.utils.exceptions.SpiceyError as error:
        raise InputError(f"{path}: damaged, or no SPK kernel ({_reason(error)})") from None


def states_in_segment(
    path: Path, handle: int, descriptor: NDArray[np.float64], epochs: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the states that a segment has, relative to its centre and in its frame.

    Parameters
    ----------
    path : Path
        The kernel, for messages.
    handle : int
        Of the opened kernel.
    descriptor : (5,) float64
        Of the segment.
    epochs : (k,) float64
        Seconds of TDB past J2000.

    Returns
    -------
    NDArray
        (k, 6) float64, km and km/s.

    Raises
    ------
    InputError
        SPICE cannot evaluate the segment.
    """
    with spice() as spiceypy:
        try:
            _, states, _ = spiceypy.cyice.spkpvn_v(
                handle, np.ascontiguousarray(descriptor), np.ascontiguousarray(epochs)
            )
        except spiceypy.utils.exceptions.SpiceyError as error:
            raise InputError(f"{path}: damaged ({_reason(error)})") from None
    return np.asarray(states, dtype=np.float64).reshape(-1, 6)


def _spiceypy() -> Any:
    # Imported here: only those who read kernels pay for it.
    try:
        import spiceypy
        import spiceypy.cyice
    except ImportError:
        raise MissingDependencyError(
            "spiceypy is not installed, and SPK kernels need it: pip install spiceypy"
        ) from None
    return spiceypy


def _reason(error: Any) -> str:
    """Return what SPICE says, on one line."""
    text = str(getattr(error, "short", "") or error)
    return " ".join(text.split())[:120]
