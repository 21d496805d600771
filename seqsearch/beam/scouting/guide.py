"""Guides: `NoGuide` leaves a beam free, `ItineraryGuide` keeps it to given itineraries."""

from typing import Final, Protocol, final

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


class Guide(Protocol):
    """Tells a pass which hops it may look at.

    Attributes
    ----------
    free : bool
        Whether all hops are allowed, those included of which no predictor knows anything.
    """

    @property
    def free(self) -> bool: ...  # noqa: D102

    def allows(
        self, nodes: Nodes, parent: NDArray[np.intp], target: NDArray[np.intp]
    ) -> NDArray[np.bool_]:
        """Return (n,) whether hops from the nodes at positions `parent` to `target` may be flown.

        Both are (n,); targets are catalogue rows.
        """
        ...

    def settings(self, settings: SearchSettings) -> SearchSettings:
        """Return the settings with which the pass is run."""
        ...


@final
class NoGuide:
    """Leaves a beam free; a `Guide`."""

    free = True

    def allows(
        self,
        nodes: Nodes,  # noqa: ARG002
        parent: NDArray[np.intp],
        target: NDArray[np.intp],  # noqa: ARG002
    ) -> NDArray[np.bool_]:
        """Allow all hops."""
        return np.ones(len(parent), dtype=np.bool_)

    def settings(self, settings: SearchSettings) -> SearchSettings:
        """Return the settings as they are."""
        return settings


@final
class ItineraryGuide:
    """Tells which hops belong to one of some itineraries, whatever their epochs; a `Guide`.

    Parameters
    ----------
    itineraries : Nodes
        Their ends.
    """

    free = False

    def __init__(self, itineraries: Nodes) -> None:
        self._count = len(itineraries)
        self._next: dict[tuple[int, ...], set[int]] = {}
        for depth, visited in zip(
            itineraries.depth.tolist(), itineraries.visited.tolist(), strict=True
        ):
            for rank in range(depth):
                self._next.setdefault(tuple(visited[: rank + 1]), set()).add(visited[rank + 1])

    def allows(
        self, nodes: Nodes, parent: NDArray[np.intp], target: NDArray[np.intp]
    ) -> NDArray[np.bool_]:
        """Return (n,) whether the hops are part of an itinerary."""
        onward = [
            self._next.get(tuple(visited[: depth + 1]), set())
            for depth, visited in zip(nodes.depth.tolist(), nodes.visited.tolist(), strict=True)
        ]
        pairs = zip(parent.tolist(), target.tolist(), strict=True)
        return np.fromiter((t in onward[p] for p, t in pairs), dtype=np.bool_, count=len(parent))

    def settings(self, settings: SearchSettings) -> SearchSettings:
        """Return the settings of a pass that flies each itinerary in variants."""
        width = max(_LEAST_VARIANTS, _VARIANTS * self._count)
        return settings.with_(
            beam_width=width,
            flight_time_stretches=STRETCHES,
            frontier={
                "max_per_parent": width,
                "max_per_cell": width,
                "max_start_share": 1.0,
                "cell_days": _VARIANT_DAYS,
            },
        )


def guide_to(itineraries: Nodes | None) -> Guide:
    """Return what keeps a pass to itineraries, given by their ends; None for a free pass."""
    return NoGuide() if itineraries is None else ItineraryGuide(itineraries)


def starts_of(itineraries: Nodes) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Return catalogue rows and epochs (k,) at which itineraries start, each pair once."""
    pairs = np.column_stack([itineraries.visited[:, 0], itineraries.t_first_mjd2000])
    pairs = np.unique(pairs, axis=0)
    return pairs[:, 0].astype(np.intp), pairs[:, 1]
