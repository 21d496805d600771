"""Beam selection: the best nodes of a rank, kept diverse."""

import numpy as np
from numpy.typing import NDArray

from seqsearch.core.nodes import Nodes
from seqsearch.settings import FrontierSettings


def select(
    scores: NDArray[np.float64],
    nodes: Nodes,
    settings: FrontierSettings,
    width: int,
    spare: float = 1.0,
) -> NDArray[np.intp]:
    """Return the positions of the nodes that go on, best first.

    Walks the nodes from the best score (ties in input order) and takes each
    that does not exceed a cap: `max_per_parent` children of one parent,
    `max_per_cell` nodes at one body within one epoch cell, `max_start_share` of
    the beam width from one start body (or an equal share for each, if the nodes come
    from few), and one node with
    the same set of bodies at the same place within the same cell: orders of
    visit that differ only in the middle lead to the same futures.

    Parameters
    ----------
    scores : (n,) float64
        Smaller is better.
    nodes : Nodes
        The n nodes.
    settings : FrontierSettings
        The caps.
    width : int
        Beam width.
    spare : float
        Factor on the width and the caps, rounded up.

    Returns
    -------
    (k,) intp
        At most `width` times `spare` positions.
    """
    start = _numbered(nodes.visited[:, :1])
    share = max(settings.max_start_share, 1.0 / (1 + start.max(initial=0)))
    caps = (
        width,
        settings.max_per_parent,
        settings.max_per_cell,
        width * share,
    )
    most, per_parent, per_cell, per_start = (int(np.ceil(cap * spare)) for cap in caps)
    # Cells, and sets of bodies, become numbers once; the walk itself is over plain integers.
    epoch = np.floor(nodes.t_arr_mjd2000 / settings.cell_days).astype(np.int64)
    cell = _numbered(np.column_stack([nodes.row, epoch]))
    kind = _numbered(np.column_stack([cell, np.sort(nodes.visited, axis=1)]))
    parent = _numbered(nodes.parent_id[:, None])
    of_parent, of_cell, of_kind, of_start = ([0] * len(nodes) for _ in range(4))
    taken: list[int] = []
    order = np.argsort(scores, kind="stable")
    walk = zip(
        order.tolist(),
        parent[order].tolist(),
        cell[order].tolist(),
        kind[order].tolist(),
        start[order].tolist(),
        strict=True,
    )
    for i, p, c, k, s in walk:
        if (
            of_kind[k]
            or of_parent[p] >= per_parent
            or of_cell[c] >= per_cell
            or of_start[s] >= per_start
        ):
            continue
        of_parent[p] += 1
        of_cell[c] += 1
        of_kind[k] += 1
        of_start[s] += 1
        taken.append(i)
        if len(taken) == most:
            break
    return np.asarray(taken, dtype=np.intp)


def _numbered(keys: NDArray[np.int64]) -> NDArray[np.intp]:
    """Return (n,) the same number, 0 to n - 1, for equal rows of (n, k) keys."""
    if len(keys) == 0:
        return np.zeros(0, dtype=np.intp)
    order = np.lexsort(keys.T)
    new = np.any(np.diff(keys[order], axis=0) != 0, axis=1)
    number = np.empty(len(keys), dtype=np.intp)
    number[order] = np.concatenate([[0], np.cumsum(new)])
    return number
