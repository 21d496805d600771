"""`pack` and `unpack`: what nets learn from, in a file a third as large as the datasets.

For a training on a machine to which little can be copied. States are kept in single precision,
10 km and a few mm/s, which changes log m* by less than 1e-5.
"""

import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.margin.views import LegView
from feasibility.dataset import Dataset
from feasibility.dataset.splits import pairs_of_bodies
from feasibility.errors import InputError
from feasibility.learning.margin.examples import legs_of
from feasibility.legs import Legs
from feasibility.runtime.atomic import atomic_path

_Array = NDArray[np.float64]

_COLUMNS: Final = ("tof_days", "m0", "thrust", "isp", "vinf_dep", "vinf_arr")


@final
@dataclass(frozen=True, eq=False)
class PackedLegs:
    """Solved legs of one sort; n of them.

    Attributes
    ----------
    legs : Legs
        The legs, without dry masses, bodies and epochs.
    m_star : (n,) float64, kg
        Their largest initial masses, NaN where unknown.
    pairs : (n,) int64
        Number of the unordered pair of bodies.
    dataset : (n,) int64
        Which dataset a leg is from, in the order in which they were packed.
    """

    legs: Legs
    m_star: _Array
    pairs: NDArray[np.int64]
    dataset: NDArray[np.int64]


def pack(datasets: Sequence[Dataset], view: LegView, path: Path) -> int:
    """Write the legs of one sort to a file and return how many there are.

    Raises
    ------
    InputError
        No leg is of the sort, or the file cannot be written.
    """
    some = legs_of(datasets, view)
    if not some:
        raise InputError("packed legs: no leg of this sort in the datasets")
    states, columns, sources = [], [], []
    for number, dataset in enumerate(some):
        legs, n = dataset.legs, len(dataset)
        states.append(np.concatenate([legs.rv_dep, legs.rv_arr], axis=1))
        values = [getattr(legs, name) for name in _COLUMNS] + [dataset.columns["m_star_kg"]]
        columns.append(np.column_stack([np.broadcast_to(value, n) for value in values]))
        sources.append(np.full(n, number))
    table = np.column_stack([np.concatenate(states), np.concatenate(columns)])
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(
            file,
            planes=_planes(table.astype(np.float32)),
            pairs=np.concatenate(pairs_of_bodies(some)).astype(np.int32),
            dataset=np.concatenate(sources).astype(np.int8),
        )
    return len(table)


def unpack(path: Path) -> PackedLegs:
    """Return the legs of a file that `pack` wrote.

    Raises
    ------
    InputError
        The file cannot be read or is something else.
    """
    try:
        with np.load(path) as file:
            planes, pairs, dataset = (file[name] for name in ("planes", "pairs", "dataset"))
    except (OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
        raise InputError(
            f"{path}: not a file of packed legs ({type(error).__name__}); expected one that "
            "pack wrote"
        ) from None
    table = _table(planes).astype(np.float64)
    columns = dict(zip(_COLUMNS, table[:, 12:-1].T, strict=True))
    legs = Legs(rv_dep=table[:, :6], rv_arr=table[:, 6:12], m_dry=0.0, **columns)
    return PackedLegs(legs, table[:, -1], pairs.astype(np.int64), dataset.astype(np.int64))


def _planes(table: NDArray[np.float32]) -> NDArray[Any]:
    """Return the bytes column by column, first bytes first: these compress better."""
    columns = np.ascontiguousarray(table.T)
    return columns.view(np.uint8).reshape(*columns.shape, 4).transpose(0, 2, 1)


def _table(planes: NDArray[Any]) -> NDArray[np.float32]:
    columns = np.ascontiguousarray(planes.transpose(0, 2, 1))
    return columns.view(np.float32)[..., 0].T
