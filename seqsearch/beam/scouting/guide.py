"""`Guide`: keeps a beam to given itineraries."""

from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from seqsearch.beam.scouting.scout import STRETCHES
from seqsearch.core.nodes import Nodes
from seqsearch.settings import SearchSettings

_VARIANTS: Final = 4
_LEAST_VARIANTS: Final = 200
_VARIANT_DAYS: Final = 5.0
"""Nodes of a guided pass for each itinerary, and for all together: the same bodies, some days
apart and with other masses. The last legs may lack a day or a kilogram in one variant and not in
another: with 3 nodes an itinerary, 20 days apart, a predicted 15th asteroid was not reached."""


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


def guided(settings: SearchSettings, itineraries: int) -> SearchSettings:
    """Return the settings of a pass that keeps to so many itineraries, in variants."""
    width = max(_LEAST_VARIANTS, _VARIANTS * itineraries)
    return settings.with_(
        beam_width=width,
        max_per_parent=width,
        max_per_cell=width,
        max_start_share=1.0,
        cell_days=_VARIANT_DAYS,
        flight_time_stretches=STRETCHES,
    )


def starts_of(itineraries: Nodes) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Return catalogue rows and epochs (k,) at which itineraries start, each pair once."""
    pairs = np.column_stack([itineraries.visited[:, 0], itineraries.t_first_mjd2000])
    pairs = np.unique(pairs, axis=0)
    return pairs[:, 0].astype(np.intp), pairs[:, 1]
