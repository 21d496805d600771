"""Generation of a dataset: shards in parallel, resumable, the same rows for any workers."""

import os
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, final

from feasibility.dataset.labels import ShardTask, file_sha256, load_catalogue, make_shard
from feasibility.dataset.protocol import Protocol
from feasibility.dataset.samplers.draws import Columns
from feasibility.dataset.storage import (
    CHECKSUMS,
    METADATA,
    has_shard,
    names_only,
    read_metadata,
    remove_leftovers,
    shard_path,
    shard_sizes,
    write_metadata,
    write_shard,
)
from feasibility.errors import InputError
from feasibility.runtime.locks import folder_lock
from feasibility.runtime.provenance import provenance

_RECIPE: Final = ("protocol", "seed", "catalogue")
"""Parts of the metadata that decide the rows."""


@final
@dataclass(frozen=True)
class Generation:
    """A dataset that is to be made or completed; `begin` checks and makes one.

    Attributes
    ----------
    folder : Path
        The dataset's folder.
    tasks : tuple of ShardTask
        Shards that are not there yet.
    legs : int
        Rows of the whole dataset.
    """

    folder: Path
    tasks: tuple[ShardTask, ...]
    legs: int

    @property
    def legs_missing(self) -> int:
        """Rows that are not there yet."""
        return sum(task.rows for task in self.tasks)

    def run(
        self,
        executor: Executor | None = None,
        *,
        in_flight: int = 4,
        on_shard: Callable[[int], None] = lambda _: None,
    ) -> None:
        """Make the missing shards and write each as it is finished.

        Parameters
        ----------
        executor : Executor, optional
            Where shards are made; in this process if not given. It only
            computes: this process does all the writing.
        in_flight : int
            Most shards that are handed to the executor at a time.
        on_shard : callable
            Called with the number of new rows after each shard.

        Raises
        ------
        InputError
            The folder cannot be written to or is in use by another process, the disk is full,
            or the catalogue cannot be used by a worker. Shards written before are intact.
        """
        if not self.tasks:
            return
        with folder_lock(self.folder):
            for task, columns in _results(self.tasks, executor, in_flight):
                write_shard(shard_path(self.folder, task.shard), columns)
                on_shard(task.rows)


def begin(protocol: Protocol, legs: int, folder: Path, *, seed: int = 0) -> Generation:
    """Check everything, make the folder and say what is to be done.

    A folder of the same protocol, seed and catalogue is completed, with as
    many legs as asked for or more than it was begun with.

    Parameters
    ----------
    protocol : Protocol
        How to draw and label.
    legs : int
        Rows of the whole dataset.
    folder : Path
        Where it is, or will be.
    seed : int
        Leg k depends on the protocol, the seed and k alone.

    Raises
    ------
    InputError
        A number out of range, a catalogue that cannot be used, a folder that holds something
        else, was begun with other settings, is in use by another process, or cannot be written.
    MissingDependencyError
        pyarrow is not installed.
    """
    if legs < 1:
        raise InputError(f"--legs {legs}: expected one or more")
    if seed < 0:
        raise InputError(f"--seed {seed}: expected zero or more")
    sha256 = file_sha256(protocol.catalogue)
    catalogue = load_catalogue(protocol.catalogue, sha256)
    recipe = {
        "protocol": protocol.to_dict(),
        "seed": seed,
        "catalogue": {"source": catalogue.source, "bodies": len(catalogue), "sha256": sha256},
    }
    # The digest tells the file; its folder is this machine's affair.
    recipe = names_only(recipe)
    _make_folder(folder)
    with folder_lock(folder):
        return _begun(folder, protocol, legs, recipe, ShardTask(protocol, seed, 0, 0, sha256))


def _begun(
    folder: Path, protocol: Protocol, legs: int, recipe: Mapping[str, Any], first: ShardTask
) -> Generation:
    """Return what is to be done in a folder that this process holds."""
    known = _known_dataset(folder, recipe, legs)
    # What older versions wrote has no checksums, and may be completed.
    checksums = {} if known is not None and "checksums" not in known else {"checksums": CHECKSUMS}
    sessions = [] if known is None else list(known["sessions"])
    record = {
        "legs": legs,
        "legs_per_shard": protocol.legs_per_shard,
        **checksums,
        **recipe,
        "sessions": [*sessions, provenance()],
    }
    sizes = shard_sizes(legs, protocol.legs_per_shard)
    tasks = tuple(
        replace(first, shard=shard, rows=rows)
        for shard, rows in enumerate(sizes)
        if not has_shard(shard_path(folder, shard), rows)
    )
    if tasks or known is None:
        write_metadata(folder, record)
    return Generation(folder=folder, tasks=tasks, legs=legs)


def _make_folder(folder: Path) -> None:
    """Make the folder, or check that it is empty or holds a dataset, and can be written to."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        empty = not any(path.name[0] != "." for path in folder.iterdir())
    except OSError as error:
        raise InputError(f"{folder}: cannot be used as a folder ({error.strerror})") from None
    if not os.access(folder, os.W_OK | os.X_OK):
        raise InputError(f"{folder}: cannot be written to")
    if not empty and not (folder / METADATA).exists():
        raise InputError(f"{folder}: is not empty and holds no dataset; choose another --out")


def _known_dataset(folder: Path, recipe: Mapping[str, Any], legs: int) -> dict[str, Any] | None:
    """Return the metadata of a dataset begun with the same settings, None in an empty folder."""
    if not (folder / METADATA).exists():
        return None
    known = read_metadata(folder)
    for key in _RECIPE:
        _check_same(folder, key, known.get(key), recipe[key])
    if legs < known["legs"]:
        raise InputError(
            f"{folder}: was begun with --legs {known['legs']}, expected no fewer, got {legs}"
        )
    remove_leftovers(folder)
    return known


def _check_same(folder: Path, key: str, old: Any, new: Any) -> None:
    if isinstance(old, dict) and isinstance(new, dict):
        for name in {**old, **new}:
            _check_same(folder, f"{key}.{name}", old.get(name), new.get(name))
        return
    # JSON has lists where Python has tuples.
    if old != (list(new) if isinstance(new, tuple) else new):
        raise InputError(
            f"{folder}: was begun with {key} = {old}, now {new}; expected the same settings, "
            "or another --out"
        )


def _results(
    tasks: tuple[ShardTask, ...], executor: Executor | None, in_flight: int
) -> Iterator[tuple[ShardTask, Columns]]:
    """Yield each task with its columns, in any order, a bounded number at work."""
    if executor is None:
        for task in tasks:
            yield task, make_shard(task)
        return
    waiting = iter(tasks)
    running: dict[Future[Columns], ShardTask] = {}
    try:
        while True:
            for task in waiting:
                running[executor.submit(make_shard, task)] = task
                if len(running) >= in_flight:
                    break
            if not running:
                return
            done, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in done:
                yield running.pop(future), future.result()
    finally:
        for future in running:
            future.cancel()
