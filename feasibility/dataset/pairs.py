"""Numbers of the pairs of bodies of several datasets, for splits that keep a pair together."""

import json
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from feasibility.dataset import Dataset


def pairs_of_bodies(datasets: Sequence[Dataset]) -> list[NDArray[np.int64]]:
    """Return for each dataset (n,) the numbers of the unordered pairs of bodies.

    A pair is told by its ids within a catalogue, so that datasets from one catalogue share pairs.
    Drawn orbits (negative ids) are pairs of their own.
    """
    ends = []
    catalogues: dict[str, int] = {}
    offset = 0
    for dataset in datasets:
        key = json.dumps(dataset.metadata["catalogue"], sort_keys=True)
        number = catalogues.setdefault(key, len(catalogues))
        dep_id, arr_id = dataset.columns["dep_id"], dataset.columns["arr_id"]
        drawn = (dep_id < 0) | (arr_id < 0)
        ends.append(
            np.column_stack(
                [
                    np.where(drawn, -1, number),
                    np.where(drawn, offset + np.arange(len(dataset)), np.minimum(dep_id, arr_id)),
                    np.where(drawn, 0, np.maximum(dep_id, arr_id)),
                ]
            )
        )
        offset += len(dataset)
    _, numbers = np.unique(np.concatenate(ends), axis=0, return_inverse=True)
    lengths = np.cumsum([len(dataset) for dataset in datasets])
    return np.split(numbers.reshape(-1).astype(np.int64), lengths[:-1])
