"""Files of a dataset: Parquet shards and ``metadata.json``, each complete or absent."""

import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from feasibility.dataset.columns import COLUMNS
from feasibility.errors import InputError, MissingDependencyError
from feasibility.runtime.atomic import atomic_path, write_json

FORMAT: Final = 1
"""Version of the layout; readers refuse others."""

METADATA: Final = "metadata.json"
"""Name of the file that describes a dataset."""


def shard_path(folder: Path, shard: int) -> Path:
    """Return the path of one shard."""
    return folder / f"part-{shard:05d}.parquet"


def shard_sizes(legs: int, legs_per_shard: int) -> list[int]:
    """Return the number of rows of each shard; the last may be shorter."""
    full, rest = divmod(legs, legs_per_shard)
    return [legs_per_shard] * full + ([rest] if rest else [])


def write_shard(path: Path, columns: Mapping[str, NDArray[Any]]) -> None:
    """Write one shard atomically.

    Raises
    ------
    InputError
        The folder cannot be written to or the disk is full.
    MissingDependencyError
        pyarrow is not installed.
    """
    pa, parquet = _pyarrow()
    table = pa.table(
        {column.name: np.asarray(columns[column.name], dtype=column.dtype) for column in COLUMNS}
    )
    # Serialised in memory first: then a full disk is met in one plain write.
    buffer = pa.BufferOutputStream()
    parquet.write_table(table, buffer, compression="zstd")
    with atomic_path(path) as temporary:
        temporary.write_bytes(buffer.getvalue())


def read_shard(path: Path, rows: int) -> dict[str, NDArray[Any]]:
    """Read one shard.

    Parameters
    ----------
    path : Path
        The file.
    rows : int
        Expected number of rows.

    Raises
    ------
    InputError
        The file is damaged, or has other columns or another number of rows.
    MissingDependencyError
        pyarrow is not installed.
    """
    pa, parquet = _pyarrow()
    try:
        table = parquet.read_table(path)
    except (OSError, pa.ArrowException) as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"{path}: not a readable Parquet file ({reason})") from None
    expected = [column.name for column in COLUMNS]
    if table.column_names != expected:
        other = sorted(set(expected) ^ set(table.column_names))
        raise InputError(f"{path}: other columns than expected ({', '.join(other) or 'order'})")
    if table.num_rows != rows:
        raise InputError(f"{path}: {table.num_rows} rows, expected {rows}")
    return {
        column.name: table.column(column.name).to_numpy().astype(column.dtype)
        for column in COLUMNS
    }


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
    write_json(folder / METADATA, record)


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
        No such file, not JSON, or of another format version.
    """
    path = folder / METADATA
    try:
        metadata = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(
            f"{path}: no such file; expected a folder of feasibility generate"
        ) from None
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read as JSON ({error})") from None
    version = metadata.get("format") if isinstance(metadata, dict) else None
    if version != FORMAT:
        raise InputError(f"{path}: format {version}, expected {FORMAT}; generate the dataset anew")
    # Older versions wrote the folder of the catalogue too.
    return names_only(metadata)


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
