"""Beam selection: the best nodes of a rank, kept diverse."""

from collections.abc import Hashable

import numpy as np
from numpy.typing import NDArray

from seqsearch.nodes import Nodes
from seqsearch.settings import SearchSettings


def select(
    scores: NDArray[np.float64],
    nodes: Nodes,
    settings: SearchSettings,
) -> NDArray[np.intp]:
    """Return the positions of the nodes that go on, best first.

    Walks the nodes from the best score (ties in input order) and takes each
    that does not exceed a cap: `max_per_parent` children of one parent,
    `max_per_cell` nodes at one body within one epoch cell, and one node with
    the same set of bodies at the same place within the same cell: orders of
    visit that differ only in the middle lead to the same futures.

    Parameters
    ----------
    scores : (n,) float64
        Smaller is better.
    nodes : Nodes
        The n nodes.
    settings : SearchSettings
        `beam_width` and the caps.

    Returns
    -------
    (k,) intp
        At most `beam_width` positions.
    """
    cell = np.floor(nodes.t_arr_mjd2000 / settings.cell_days).astype(np.int64)
    taken: list[int] = []
    counts: dict[Hashable, int] = {}
    for i in np.argsort(scores, kind="stable"):
        by_parent = ("parent", int(nodes.parent_id[i]))
        by_cell = ("cell", int(nodes.row[i]), int(cell[i]))
        by_set = ("set", int(nodes.row[i]), int(cell[i]), tuple(np.sort(nodes.visited[i])))
        if (
            counts.get(by_parent, 0) >= settings.max_per_parent
            or counts.get(by_cell, 0) >= settings.max_per_cell
            or by_set in counts
        ):
            continue
        for key in (by_parent, by_cell, by_set):
            counts[key] = counts.get(key, 0) + 1
        taken.append(int(i))
        if len(taken) == settings.beam_width:
            break
    return np.asarray(taken, dtype=np.intp)
