"""Which children of a beam's rank go on: kernel of `Roaming` and of beams with an end."""

import numpy as np
from numpy.typing import NDArray

from feasibility.runtime.jit import kernel

_Array = NDArray[np.float64]
_Index = NDArray[np.int32]


@kernel
def choose(
    order: NDArray[np.int64],
    row: _Index,
    parent: _Index,
    arrival: _Array,
    sets: NDArray[np.uint64],
    keys: NDArray[np.uint64],
    start: _Index,
    caps: NDArray[np.int64],
    n_bodies: int,
    cell_days: float,
    mass: _Array,
    mass_step: float,
    taken: NDArray[np.int64],
) -> int:
    """Write the positions of those children that go on, best first, and return how many.

    `caps` are the width, and the most children of one parent, of one body in one cell of epochs,
    and of one start. Of children with the same set of bodies at the same place in the same cell,
    and within the same step of the mass, the best goes on.
    """
    width, per_parent, per_cell, per_start = caps[0], caps[1], caps[2], caps[3]
    of_parent = np.zeros(len(sets), dtype=np.int32)
    of_start = np.zeros(start.max() + 1, dtype=np.int32)
    size = 16
    while size < 4 * width + 16:
        size *= 2
    cell_key = np.zeros(size, dtype=np.uint64)
    cell_count = np.zeros(size, dtype=np.int32)
    set_key = np.zeros(size, dtype=np.uint64)
    mask = np.uint64(size - 1)
    found = 0
    for c in order:
        p = parent[c]
        if of_parent[p] >= per_parent or of_start[start[p]] >= per_start:
            continue
        cell = np.uint64(int(arrival[c] // cell_days) * n_bodies + row[c] + 1)
        a = (cell * np.uint64(11400714819323198485)) >> np.uint64(20) & mask
        while cell_key[a] != np.uint64(0) and cell_key[a] != cell:
            a = (a + np.uint64(1)) & mask
        if cell_count[a] >= per_cell:
            continue
        weight = np.uint64(int(mass[c] // mass_step)) * np.uint64(0x9E3779B97F4A7C15)
        kind = (sets[p] + keys[row[c]]) ^ (cell * np.uint64(14029467366897019727)) ^ weight
        kind |= np.uint64(1)
        b = (kind >> np.uint64(20)) & mask
        while set_key[b] != np.uint64(0) and set_key[b] != kind:
            b = (b + np.uint64(1)) & mask
        if set_key[b] == kind:
            continue
        cell_key[a] = cell
        cell_count[a] += 1
        set_key[b] = kind
        of_parent[p] += 1
        of_start[start[p]] += 1
        taken[found] = c
        found += 1
        if found == width:
            break
    return found
