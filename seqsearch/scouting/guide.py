"""`Guide`: keeps a beam to given itineraries."""

from typing import final

import numpy as np
from numpy.typing import NDArray

from seqsearch.nodes import Nodes


@final
class Guide:
    """Tells which hops belong to one of some itineraries, whatever their epochs.

    Parameters
    ----------
    itineraries : Nodes
        Their ends.
    """

    def __init__(self, itineraries: Nodes) -> None:
        self._ways: dict[tuple[int, ...], set[int]] = {}
        for depth, visited in zip(
            itineraries.depth.tolist(), itineraries.visited.tolist(), strict=True
        ):
            for rank in range(depth):
                self._ways.setdefault(tuple(visited[: rank + 1]), set()).add(visited[rank + 1])

    def allows(
        self, nodes: Nodes, parent: NDArray[np.intp], target: NDArray[np.intp]
    ) -> NDArray[np.bool_]:
        """Return (n,) whether hops from the nodes at positions `parent` (n,) to `target` (n,) do.

        Targets are catalogue rows.
        """
        ways = [
            self._ways.get(tuple(visited[: depth + 1]), set())
            for depth, visited in zip(nodes.depth.tolist(), nodes.visited.tolist(), strict=True)
        ]
        pairs = zip(parent.tolist(), target.tolist(), strict=True)
        return np.fromiter((t in ways[p] for p, t in pairs), dtype=np.bool_, count=len(parent))


def starts_of(itineraries: Nodes) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Return catalogue rows and epochs (k,) at which itineraries start, each pair once."""
    pairs = np.column_stack([itineraries.visited[:, 0], itineraries.t_first_mjd2000])
    pairs = np.unique(pairs, axis=0)
    return pairs[:, 0].astype(np.intp), pairs[:, 1]
