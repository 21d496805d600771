"""Files that are either complete or absent: write to a temporary name, then rename."""

import json
import os
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final

from feasibility.errors import InputError

_SUFFIX: Final = ".tmp"


@contextmanager
def atomic_path(path: Path) -> Iterator[Path]:
    """Yield a temporary path in the same folder; on success it replaces `path`.

    Raises
    ------
    InputError
        The folder cannot be written to or the disk is full; `path` is as before.
    """
    try:
        descriptor, name = tempfile.mkstemp(
            prefix=f".{path.name}.", suffix=_SUFFIX, dir=path.parent
        )
        os.close(descriptor)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror})") from None
    temporary = Path(name)
    try:
        yield temporary
        temporary.chmod(0o644)
        _sync(temporary)
        temporary.replace(path)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror})") from None
    finally:
        with suppress(FileNotFoundError):
            temporary.unlink()


def remove_stale(folder: Path) -> None:
    """Remove temporary files that a killed process left; nobody else may be writing there."""
    for file in folder.glob(f".*{_SUFFIX}"):
        with suppress(OSError):
            file.unlink()


def _sync(path: Path) -> None:
    """Wait until a file is on disk: a rename may get there before what it names."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def write_text(path: Path, text: str) -> None:
    """Write a text file atomically (UTF-8).

    Raises
    ------
    InputError
        As for `atomic_path`.
    """
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_json(path: Path, record: Mapping[str, Any]) -> None:
    """Write a record of plain data as indented JSON, atomically.

    Raises
    ------
    InputError
        As for `atomic_path`.
    """
    write_text(path, json.dumps(record, indent=1) + "\n")
