"""`Dataset`: labelled legs, read from a folder of Parquet files."""

import functools
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from feasibility.dataset.columns import ARRIVAL_STATE, DEPARTURE_STATE
from feasibility.dataset.storage import (
    CHECKSUMS,
    read_metadata,
    read_shard,
    shard_path,
    shard_sizes,
)
from feasibility.errors import InputError
from feasibility.legs import Legs
from feasibility.sims_flanagan import Status


@final
@dataclass(frozen=True, eq=False, repr=False)
class Dataset:
    """Labelled legs, one row a leg.

    Attributes
    ----------
    columns : mapping of str to (n,) array
        The columns of `feasibility.dataset.COLUMNS`, read-only.
    metadata : mapping
        What ``metadata.json`` says: protocol, seed, units, versions.
    """

    columns: Mapping[str, NDArray[Any]]
    metadata: Mapping[str, Any]

    def __len__(self) -> int:
        return len(self.columns["tof_days"])

    def __repr__(self) -> str:
        return f"Dataset(n={len(self)}, protocol={self.metadata['protocol']['name']!r})"

    @functools.cached_property
    def legs(self) -> Legs:
        """The legs, without their labels."""
        columns = self.columns
        return Legs(
            rv_dep=np.column_stack([columns[column.name] for column in DEPARTURE_STATE]),
            rv_arr=np.column_stack([columns[column.name] for column in ARRIVAL_STATE]),
            tof_days=columns["tof_days"],
            m0=columns["m0_kg"],
            thrust=columns["thrust_n"],
            isp=columns["isp_s"],
            m_dry=columns["m_dry_kg"],
            t_dep_mjd2000=columns["t_dep_mjd2000"],
            dep_id=columns["dep_id"],
            arr_id=columns["arr_id"],
            vinf_dep=columns["vinf_dep_m_s"],
            vinf_arr=columns["vinf_arr_m_s"],
        )

    @property
    def labelled(self) -> NDArray[np.bool_]:
        """(n,) where the label is known: m* was found, or any row of a convergence label."""
        if self.metadata["protocol"]["label"] == "convergence":
            return np.ones(len(self), dtype=np.bool_)
        # inf is a label: such a leg needs no thrust.
        known: NDArray[np.bool_] = ~np.isnan(self.columns["log_margin"])
        return known

    @property
    def flyable(self) -> NDArray[np.bool_]:
        """(n,) whether the leg can be flown, whatever mass is left: what classifiers learn.

        By margin: m0 <= m*. By convergence: the one start converged. False where
        `labelled` is.
        """
        if self.metadata["protocol"]["label"] == "convergence":
            return np.asarray(self.columns["status"] == Status.CONVERGED)
        # A comparison with NaN is false: unlabelled rows are not flyable.
        return np.asarray(self.columns["log_margin"] >= 0.0)

    @property
    def feasible(self) -> NDArray[np.bool_]:
        """(n,) whether the leg is `flyable` and not found to end below the dry mass.

        Of legs labelled by margin the mass at the end is only known where the protocol asks for
        the propellant.
        """
        feasible: NDArray[np.bool_] = self.flyable & (
            self.columns["status"] != Status.BELOW_DRY_MASS
        )
        return feasible

    def check_rendezvous(self, what: str) -> None:
        """Raise InputError where a leg has free ends, of which `what` knows nothing.

        Raises
        ------
        InputError
            A largest excess velocity is above zero.
        """
        free = self.legs.free_ends
        if free.any():
            name = self.metadata["protocol"]["name"]
            raise InputError(
                f"{what}: {free.sum()} legs of protocol {name} have free ends (vinf_dep or "
                "vinf_arr), expected legs from rest to rest"
            )

    def take(self, rows: ArrayLike) -> "Dataset":
        """Return the rows given as indices or as a mask."""
        index = np.asarray(rows)
        if index.size == 0:
            index = index.astype(np.intp)
        return Dataset(_frozen({k: v[index] for k, v in self.columns.items()}), self.metadata)


def read_dataset(folder: str | Path) -> Dataset:
    """Read a dataset that ``feasibility generate`` wrote.

    Parameters
    ----------
    folder : str or Path
        Its folder.

    Raises
    ------
    InputError
        No dataset there, written by another version, a shard missing, damaged or changed.
    MissingDependencyError
        pyarrow is not installed.
    """
    path = Path(folder)
    metadata = read_metadata(path)
    sizes = shard_sizes(metadata["legs"], metadata["protocol"]["legs_per_shard"])
    missing = [shard for shard in range(len(sizes)) if not shard_path(path, shard).exists()]
    if missing:
        raise InputError(
            f"{shard_path(path, missing[0])}: missing, as {len(missing)} of {len(sizes)} are; "
            "feasibility generate with the same settings completes the dataset"
        )
    checksums = metadata.get("checksums") == CHECKSUMS
    shards = [
        read_shard(shard_path(path, shard), rows, checksums=checksums)
        for shard, rows in enumerate(sizes)
    ]
    columns = {name: np.concatenate([part[name] for part in shards]) for name in shards[0]}
    return Dataset(_frozen(columns), metadata)


def _frozen(columns: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    for column in columns.values():
        column.flags.writeable = False
    return columns
