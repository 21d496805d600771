"""Files of a dataset: Parquet shards and ``metadata.json``, each complete or absent."""

import hashlib
import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from feasibility.dataset.columns import ADDED, COLUMNS
from feasibility.errors import InputError, MissingDependencyError
from feasibility.runtime.atomic import atomic_path, write_json

FORMAT: Final = 1
"""Version of the layout; readers refuse others."""

METADATA: Final = "metadata.json"
"""Name of the file that describes a dataset."""

CHECKSUMS: Final = "sha256"
"""Entry ``checksums`` of the metadata: every part carries a checksum. Older datasets have none."""

_DIGEST: Final = "sha256"
"""Where a part's schema and the metadata have their own checksum."""

_MAX_SHARDS: Final = 1_000_000
_LONGEST_REASON: Final = 200
_MAX_ROWS: Final = 10_000_000
"""Of one shard."""


def shard_path(folder: Path, shard: int) -> Path:
    """Return the path of one shard."""
    return folder / f"part-{shard:05d}.parquet"


def shard_sizes(legs: int, legs_per_shard: int) -> list[int]:
    """Return the number of rows of each shard; the last may be shorter."""
    full, rest = divmod(legs, legs_per_shard)
    return [legs_per_shard] * full + ([rest] if rest else [])


def write_shard(path: Path, columns: Mapping[str, NDArray[Any]]) -> None:
    """Write one shard atomically, with a checksum of its name and numbers.

    Raises
    ------
    InputError
        The folder cannot be written to or the disk is full.
    MissingDependencyError
        pyarrow is not installed.
    """
    pa, parquet = _pyarrow()
    typed = {
        column.name: np.asarray(columns[column.name], dtype=column.dtype) for column in COLUMNS
    }
    digest = _shard_digest(path, typed)
    table = pa.table(typed).replace_schema_metadata({_DIGEST: digest})
    # Serialised in memory first: then a full disk is met in one plain write.
    buffer = pa.BufferOutputStream()
    parquet.write_table(table, buffer, compression="zstd")
    with atomic_path(path) as temporary:
        temporary.write_bytes(buffer.getvalue())


def read_shard(path: Path, rows: int, *, checksums: bool = False) -> dict[str, NDArray[Any]]:
    """Read one shard.

    Parameters
    ----------
    path : Path
        The file.
    rows : int
        Expected number of rows.
    checksums : bool
        Whether a shard without a checksum is refused.

    Raises
    ------
    InputError
        The file is damaged, or has other columns, another number of rows or other numbers than
        were written.
    MissingDependencyError
        pyarrow is not installed.
    """
    _, parquet = _pyarrow()
    try:
        # Not by read_table, which takes folders such as "seed=1" for columns.
        with parquet.ParquetFile(path) as file:
            _check_shape(path, file.schema_arrow.names, file.metadata.num_rows, rows)
            table = file.read()
        digest = (table.schema.metadata or {}).get(_DIGEST.encode())
        columns = {
            column.name: table.column(column.name).to_numpy().astype(column.dtype)
            for column in COLUMNS
            if column.name in table.column_names
        }
    except InputError:
        raise
    except Exception as error:  # a damaged file makes pyarrow raise nearly anything
        reason = next(iter(str(error).splitlines()), type(error).__name__)[:_LONGEST_REASON]
        raise InputError(f"{path}: not a readable Parquet file ({reason})") from None
    if digest is None and checksums:
        raise InputError(f"{path}: has no checksum; expected one as the other parts have")
    if digest is not None and digest.decode("ascii", "replace") != _shard_digest(path, columns):
        raise InputError(
            f"{path}: does not match its checksum: damaged or changed; remove the file, and "
            "feasibility generate with the same settings makes it again"
        )
    return columns | {name: np.zeros(rows) for name in ADDED if name not in columns}


def _check_shape(path: Path, names: list[str], found: int, rows: int) -> None:
    expected = [column.name for column in COLUMNS]
    if names not in (expected, expected[: -len(ADDED)]):
        other = sorted(set(expected) ^ set(names))
        raise InputError(f"{path}: other columns than expected ({', '.join(other) or 'order'})")
    if found != rows:
        raise InputError(f"{path}: {found} rows, expected {rows}")


def _shard_digest(path: Path, columns: Mapping[str, NDArray[Any]]) -> str:
    """Return the checksum of a shard: of its name, so that shards cannot be swapped, and rows."""
    digest = hashlib.sha256(path.name.encode())
    for column in COLUMNS:
        if column.name not in columns:
            continue
        values = np.ascontiguousarray(columns[column.name])
        digest.update(f"{column.name} {values.dtype.str} {len(values)}".encode())
        digest.update(values.tobytes())
    return digest.hexdigest()


def has_shard(path: Path, rows: int) -> bool:
    """Return whether a shard is there with the expected rows and an intact footer."""
    pa, parquet = _pyarrow()
    try:
        return bool(parquet.read_metadata(path).num_rows == rows)
    except (OSError, pa.ArrowException):
        return False


def write_metadata(folder: Path, metadata: Mapping[str, Any]) -> None:
    """Write ``metadata.json`` atomically, with the format and the columns.

    Raises
    ------
    InputError
        The folder cannot be written to or the disk is full.
    """
    columns = [asdict(column) for column in COLUMNS]
    record = {"format": FORMAT, **metadata, "columns": columns}
    write_json(folder / METADATA, record | {_DIGEST: _record_digest(record)})


def _record_digest(record: Mapping[str, Any]) -> str:
    """Return the checksum of metadata, less the one that they have."""
    bare = {key: value for key, value in record.items() if key != _DIGEST}
    # Once through JSON: tuples are lists there.
    text = json.dumps(json.loads(json.dumps(bare)), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def names_only(metadata: Mapping[str, Any]) -> dict[str, Any]:
    """Return metadata in which a catalogue file is told by its name, without its folder."""
    plain = dict(metadata)
    table = plain.get("protocol", {}).get("catalogue", {})
    if table.get("file") is not None:
        name = Path(table["file"]).name
        plain["protocol"] = plain["protocol"] | {"catalogue": table | {"file": name}}
        plain["catalogue"] = plain["catalogue"] | {"source": name}
    return plain


def read_metadata(folder: Path) -> dict[str, Any]:
    """Read ``metadata.json``.

    Raises
    ------
    InputError
        No such file, not JSON, of another format version, changed, or without what readers need.
    """
    path = folder / METADATA
    try:
        metadata = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(
            f"{path}: no such file; expected a folder of feasibility generate"
        ) from None
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"{path}: cannot be read as JSON ({error})") from None
    version = metadata.get("format") if isinstance(metadata, dict) else None
    if version != FORMAT:
        raise InputError(f"{path}: format {version}, expected {FORMAT}; generate the dataset anew")
    if _DIGEST in metadata and metadata[_DIGEST] != _record_digest(metadata):
        raise InputError(f"{path}: does not match its checksum: damaged or changed")
    _check_metadata(path, metadata)
    # Older versions wrote the folder of the catalogue too.
    return names_only(metadata)


def _check_metadata(path: Path, metadata: Mapping[str, Any]) -> None:
    """Check what readers rely on: older datasets have no checksum.

    Raises
    ------
    InputError
        An entry is missing or of another type or range.
    """
    tables = {"": metadata}
    for name in ("protocol", "catalogue"):
        if not isinstance(metadata.get(name), dict):
            raise InputError(f"{path}: no table {name!r}, expected one")
        tables[f"{name}."] = metadata[name]
    for table, key, kind in (
        ("", "legs", int),
        ("", "seed", int),
        ("protocol.", "legs_per_shard", int),
        ("protocol.", "name", str),
        ("protocol.", "label", str),
        ("catalogue.", "bodies", int),
        ("catalogue.", "source", str),
    ):
        value = tables[table].get(key)
        if not isinstance(value, kind) or isinstance(value, bool):
            raise InputError(f"{path}: {table}{key} is {value!r:.40}, expected {_TYPES[kind]}")
    legs, per_shard = metadata["legs"], metadata["protocol"]["legs_per_shard"]
    if not (legs >= 1 and 1 <= per_shard <= _MAX_ROWS and legs <= _MAX_SHARDS * per_shard):
        raise InputError(
            f"{path}: {legs} legs in parts of {per_shard}, expected at most {_MAX_SHARDS} parts"
        )
    if metadata["protocol"]["label"] not in ("margin", "convergence"):
        raise InputError(f"{path}: protocol.label, expected 'margin' or 'convergence'")


_TYPES: Final = {int: "a whole number", str: "a text"}


def remove_leftovers(folder: Path) -> None:
    """Remove temporary files of a run that was killed while it wrote."""
    for path in [*folder.glob(".part-*.parquet.*"), *folder.glob(f".{METADATA}.*")]:
        with suppress(OSError):
            path.unlink()


def _pyarrow() -> tuple[Any, Any]:
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError:
        raise MissingDependencyError(
            "datasets need pyarrow, which is not installed; pip install 'seqsearch[data]'"
        ) from None
    return pyarrow, parquet
