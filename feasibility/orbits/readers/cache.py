"""Large tables in a compact form in the user's cache folder.

A table that took seconds to read is written as arrays to the folder ``tables`` in
``$XDG_CACHE_HOME/seqsearch`` or ``~/.cache/seqsearch``, under a digest of its content: the
next time it comes from there, wherever the file is then. What is damaged is read anew, and where
nothing can be written nothing is.
"""

import hashlib
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, final

import numpy as np

from feasibility.errors import InputError
from feasibility.orbits.readers.bodies import BodyTable, LeftOut
from feasibility.runtime.atomic import atomic_path
from feasibility.runtime.text_column import TextColumn

VERSION: Final = 1
"""Of what readers make of files: to be raised when one of them learns to read more."""

LEAST_BYTES: Final = 1 << 22
"""Files below 4 MiB are read in less than a second."""

_MOST_TABLES: Final = 8


def cache_folder() -> Path | None:
    """Return the folder of this program's caches, None for a user without a home."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    try:
        root = Path(base) if Path(base).is_absolute() else Path.home() / ".cache"
    except RuntimeError:
        return None
    return root / "seqsearch"


@final
@dataclass
class CachedTable:
    """A table from the cache, or a place for one that is read.

    Attributes
    ----------
    table : BodyTable or None
        None where the cache does not have it; what is put here is kept.
    """

    table: BodyTable | None = None


@contextmanager
def cached_table(data: bytes, units: dict[str, str]) -> Iterator[CachedTable]:
    """Yield what the cache has of a file's content, and keep what was read in its place.

    Parameters
    ----------
    data : bytes
        The file as it is on disk.
    units : dict of str to str
        Units that the user told.
    """
    folder = cache_folder()
    if len(data) < LEAST_BYTES or folder is None:
        yield CachedTable()
        return
    told = json.dumps([VERSION, sorted(units.items())]).encode()
    digest = hashlib.blake2b(data, digest_size=20, key=hashlib.sha256(told).digest()).hexdigest()
    path = folder / "tables" / f"{digest}.npz"
    cached = CachedTable(_loaded(path))
    before = cached.table
    yield cached
    if before is None and cached.table is not None:
        _keep(path, cached.table)


def _loaded(path: Path) -> BodyTable | None:
    try:
        with np.load(path, allow_pickle=False) as arrays:
            meta = json.loads(bytes(arrays["meta"]))
            table = _table(meta, arrays)
        # Which tables are in use is seen by the time.
        os.utime(path)
    except FileNotFoundError:
        return None
    except Exception:
        # Damage comes as any error of zipfile, numpy, zlib or json; none is the user's.
        with suppress(OSError):
            path.unlink()
        return None
    return table


def _table(meta: dict[str, Any], arrays: Any) -> BodyTable:
    table = BodyTable(
        meta["label"],
        arrays["ids"],
        TextColumn(arrays["name_data"], arrays["name_ends"]),
        arrays["orbits"],
        {name: arrays[f"extra/{name}"] for name in meta["extra"]},
        tuple(LeftOut(reason, count, tuple(names)) for reason, count, names in meta["left_out"]),
        tuple(meta["notes"]),
    )
    n = len(table.ids)
    columns = [table.ids, table.names, *table.extra.values()]
    if table.orbits.shape != (n, 7) or any(len(column) != n for column in columns):
        raise ValueError(meta["label"])
    return table


def _keep(path: Path, table: BodyTable) -> None:
    names = table.names if isinstance(table.names, TextColumn) else TextColumn.of(table.names)
    meta = {
        "label": table.label,
        "extra": list(table.extra),
        "left_out": [(part.reason, part.count, part.names) for part in table.left_out],
        "notes": table.notes,
    }
    columns: dict[str, Any] = {
        "meta": np.frombuffer(json.dumps(meta).encode(), np.uint8),
        "ids": table.ids,
        "name_data": names.data,
        "name_ends": names.ends,
        "orbits": table.orbits,
        **{f"extra/{name}": column for name, column in table.extra.items()},
    }
    # A cache that cannot be written is no fault of the user's.
    with suppress(InputError, OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        with atomic_path(path) as temporary, temporary.open("wb") as stream:
            np.savez(stream, **columns)
        _forget_old(path.parent)


def _forget_old(folder: Path) -> None:
    tables = sorted(folder.glob("*.npz"), key=lambda file: file.stat().st_mtime, reverse=True)
    for file in tables[_MOST_TABLES:]:
        file.unlink()
