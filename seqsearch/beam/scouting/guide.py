"""Guides: `NoGuide` leaves a beam free, `ItineraryGuide` keeps it to given itineraries."""

from collections.abc import Iterator
from typing import Final, Protocol, final

import numpy as np
from numpy.typing import NDArray

from seqsearch.beam.scouting.scout import STRETCHES
from seqsearch.core.nodes import Nodes
from seqsearch.settings import SearchSettings

VARIANTS: Final = 4
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

    def legs_left(self, nodes: Nodes) -> int:
        """Return how many more legs the longest itinerary has that goes on from one of n nodes."""
        ...

    def narrowed(self, nodes: Nodes, count: int) -> NDArray[np.bool_]:
        """Keep to some of the best itineraries; return (n,) which of n nodes lead on to them.

        Parameters
        ----------
        nodes : Nodes
            Those that wait; itineraries on which none of them lies do not count.
        count : int
            How many itineraries to keep.
        """
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

    def legs_left(self, nodes: Nodes) -> int:  # noqa: ARG002
        """Return 0: there are no itineraries."""
        return 0

    def narrowed(self, nodes: Nodes, count: int) -> NDArray[np.bool_]:  # noqa: ARG002
        """Return (n,) True."""
        return np.ones(len(nodes), dtype=np.bool_)


@final
class ItineraryGuide:
    """Tells which hops belong to one of some itineraries, whatever their epochs; a `Guide`.

    Parameters
    ----------
    itineraries : Nodes
        Their ends, the best first.
    """

    free = False

    def __init__(self, itineraries: Nodes) -> None:
        self._count = len(itineraries)
        self._itineraries = [
            tuple(visited[: depth + 1])
            for depth, visited in zip(
                itineraries.depth.tolist(), itineraries.visited.tolist(), strict=True
            )
        ]
        self._next = _onward(self._itineraries)

    def allows(
        self, nodes: Nodes, parent: NDArray[np.intp], target: NDArray[np.intp]
    ) -> NDArray[np.bool_]:
        """Return (n,) whether the hops are part of an itinerary."""
        onward = [self._next.get(path, set()) for path in _paths(nodes)]
        pairs = zip(parent.tolist(), target.tolist(), strict=True)
        return np.fromiter((t in onward[p] for p, t in pairs), dtype=np.bool_, count=len(parent))

    def settings(self, settings: SearchSettings) -> SearchSettings:
        """Return the settings of a pass that flies each itinerary in variants."""
        width = max(_LEAST_VARIANTS, VARIANTS * self._count)
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

    def legs_left(self, nodes: Nodes) -> int:
        """Return how many more legs the longest itinerary has that goes on from one of n nodes."""
        return max((len(itinerary) - depth for itinerary, depth in self._alive(nodes)), default=0)

    def narrowed(self, nodes: Nodes, count: int) -> NDArray[np.bool_]:
        """Keep to some of the best itineraries; return (n,) which of n nodes lead on to them."""
        alive = [itinerary for itinerary, _ in self._alive(nodes)]
        if len(alive) > count:
            self._itineraries = alive[:count]
            self._next = _onward(self._itineraries)
        paths = _paths(nodes)
        return np.fromiter(
            (path in self._next for path in paths), dtype=np.bool_, count=len(paths)
        )

    def _alive(self, nodes: Nodes) -> Iterator[tuple[tuple[int, ...], int]]:
        """Yield the itineraries on which a node lies, and how many bodies of them it has."""
        paths = set(_paths(nodes))
        lengths = sorted({len(path) for path in paths}, reverse=True)
        for itinerary in self._itineraries:
            for length in lengths:
                if length < len(itinerary) and itinerary[:length] in paths:
                    yield itinerary, length
                    break


def _onward(itineraries: list[tuple[int, ...]]) -> dict[tuple[int, ...], set[int]]:
    """Return the bodies that come next on some itineraries, by the bodies visited before."""
    following: dict[tuple[int, ...], set[int]] = {}
    for itinerary in itineraries:
        for rank in range(1, len(itinerary)):
            following.setdefault(itinerary[:rank], set()).add(itinerary[rank])
    return following


def _paths(nodes: Nodes) -> list[tuple[int, ...]]:
    """Return the bodies that each of some nodes has visited, in order."""
    return [
        tuple(visited[: depth + 1])
        for depth, visited in zip(nodes.depth.tolist(), nodes.visited.tolist(), strict=True)
    ]


def guide_to(itineraries: Nodes | None) -> Guide:
    """Return what keeps a pass to itineraries, given by their ends; None for a free pass."""
    return NoGuide() if itineraries is None else ItineraryGuide(itineraries)


def starts_of(itineraries: Nodes) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Return catalogue rows and epochs (k,) at which itineraries start, each pair once."""
    pairs = np.column_stack([itineraries.visited[:, 0], itineraries.t_first_mjd2000])
    pairs = np.unique(pairs, axis=0)
    return pairs[:, 0].astype(np.intp), pairs[:, 1]
