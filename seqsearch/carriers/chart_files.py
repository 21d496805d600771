"""A `LegChart` in a folder, one file an array, read as far as it is looked at."""

from dataclasses import fields
from pathlib import Path
from typing import Final

import numpy as np

from feasibility import InputError
from feasibility.runtime.atomic import atomic_path
from seqsearch.carriers.leg_chart import LegChart

_LAST: Final = "t0_mjd2000"
"""Field that is written last: a folder that has it is complete."""


def write_chart(chart: LegChart, folder: Path) -> None:
    """Write a chart.

    Raises
    ------
    InputError
        It cannot be written.
    """
    folder.mkdir(exist_ok=True)
    names = [field.name for field in fields(chart) if field.name != _LAST]
    for name in (*names, _LAST):
        with atomic_path(folder / f"{name}.npy") as path, path.open("wb") as file:
            np.save(file, np.asarray(getattr(chart, name)))


def has_chart(folder: Path) -> bool:
    """Tell whether a folder has a complete chart."""
    return (folder / f"{_LAST}.npy").is_file()


def read_chart(folder: Path) -> LegChart:
    """Return a chart whose arrays are mapped from their files.

    Raises
    ------
    InputError
        A file is missing or damaged.
    """
    arrays = {}
    for field in fields(LegChart):
        path = folder / f"{field.name}.npy"
        try:
            arrays[field.name] = np.load(path, mmap_mode="r")
        except (OSError, ValueError, EOFError) as error:
            raise InputError(f"{path}: not a chart's file ({error})") from None
    return LegChart(**arrays | {_LAST: float(arrays[_LAST])})
