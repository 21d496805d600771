"""Small results that are computed once: one JSON file a cell."""

import hashlib
import json
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, as_completed
from pathlib import Path
from typing import Any, final

from feasibility.errors import InputError
from feasibility.runtime.atomic import write_text
from feasibility.runtime.folders import make_folder

Key = dict[str, Any]
"""What a cell's value depends on: plain data, all of it."""


@final
class Cells:
    """The folder of cells of a study.

    A cell is the result of one computation (one model, one size, one seed). It
    is found again by its key, so a study that was interrupted goes on where it
    stopped, and two experiments that ask for the same cell share it.

    Parameters
    ----------
    folder : Path
        Where the cells are; created if absent.
    say : callable
        Told about every cell that is computed.

    Attributes
    ----------
    computed, reused : int
        Cells computed and cells read from the folder since the start.
    used_seconds : dict of Path to float
        How long each cell asked for since the start took to compute, whenever that was.
    """

    def __init__(self, folder: Path, say: Callable[[str], None] = print) -> None:
        make_folder(folder)
        self.folder = folder
        self.say = say
        self.computed = 0
        self.reused = 0
        self.used_seconds: dict[Path, float] = {}

    def get(self, name: str, key: Key, compute: Callable[[], Any]) -> Any:
        """Return the cell's value, computing and saving it if it is not there yet.

        Parameters
        ----------
        name : str
            For people: the beginning of the file name and of the progress line.
        key : dict
            All that the value depends on.
        compute : callable
            Returns the value, as plain data that JSON holds.

        Raises
        ------
        InputError
            The cell's file is damaged, or cannot be written.
        """
        path = self.path(name, key)
        if path.exists():
            self.reused += 1
        else:
            self._write(path, name, key, _timed(compute))
        # Read back, so that a first run sees exactly what a later one will see.
        cell = self._read(path)
        self.used_seconds[path] = float(cell["seconds"])
        return cell["value"]

    def get_many(
        self,
        wanted: Sequence[tuple[str, Key, Callable[[], Any]]],
        executor: Executor | None,
    ) -> list[Any]:
        """Return the values of several cells; those not there are computed by the executor.

        Parameters
        ----------
        wanted : sequence of (name, key, compute)
            As for `get`; for a process pool `compute` has to be picklable.
        executor : Executor, optional
            Where to compute; in this process if not given.

        Raises
        ------
        InputError
            As for `get`.
        """
        if executor is not None:
            missing = [cell for cell in wanted if not self.path(cell[0], cell[1]).exists()]
            running = {
                executor.submit(_timed, compute): (name, key) for name, key, compute in missing
            }
            for future in as_completed(running):
                name, key = running[future]
                self._write(self.path(name, key), name, key, future.result())
            self.reused -= len(missing)
        return [self.get(*cell) for cell in wanted]

    def _write(self, path: Path, name: str, key: Key, timed: tuple[Any, float]) -> None:
        value, seconds = timed
        write_text(path, json.dumps({"key": key, "seconds": seconds, "value": value}) + "\n")
        self.computed += 1
        self.say(f"{name}  {seconds:.1f} s")

    def seconds(self, name: str, key: Key) -> float:
        """Return how long the cell took to compute.

        Raises
        ------
        InputError
            There is no such cell.
        """
        return float(self._read(self.path(name, key))["seconds"])

    def path(self, name: str, key: Key) -> Path:
        """Return the file of a cell, whether or not it exists."""
        text = json.dumps(key, sort_keys=True)
        digest = hashlib.sha256(text.encode()).hexdigest()[:16]
        return self.folder / f"{name}-{digest}.json"

    @staticmethod
    def _read(path: Path) -> dict[str, Any]:
        try:
            cell = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise InputError(f"{path}: expected a cell of a study ({error})") from None
        if not isinstance(cell, dict) or not {"key", "seconds", "value"} <= set(cell):
            raise InputError(f"{path}: expected a cell with key, seconds and value")
        return cell


def _timed(compute: Callable[[], Any]) -> tuple[Any, float]:
    began = time.perf_counter()
    return compute(), time.perf_counter() - began
