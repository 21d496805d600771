"""Bodies about the Sun, put together from segments: which one counts when, and the states."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.errors import InputError
from feasibility.orbits.spk.segments import Segment
from feasibility.runtime.spice import opened, states_in_segment

SUN: Final = 10
BARYCENTRE: Final = 0
"""NAIF's number of the barycentre of the solar system."""

_M_OF_KM: Final = 1e3
_LONGEST_CHAIN: Final = 10
"""Centres between a body and the Sun; more than that is a circle."""

_SUN_KERNEL: Final = (
    "such as de440s.bsp (naif.jpl.nasa.gov/pub/naif/generic_kernels/spk/planets), in the same "
    "folder or meta-kernel"
)


@final
@dataclass(frozen=True)
class Piece:
    """A time in which the same segments lead from a body to the Sun.

    Attributes
    ----------
    start, end : float
        Seconds of TDB past J2000.
    links : tuple
        Segments and the signs with which their states are added.
    """

    start: float
    end: float
    links: tuple[tuple[Segment, float], ...]


States = Callable[[Piece, NDArray[np.float64]], NDArray[np.float64]]
"""Heliocentric states within a piece at (k,) seconds of TDB past J2000: (k, 6), m and m/s."""


@final
class Motion:
    """The bodies of some kernels.

    Parameters
    ----------
    segments : sequence of Segment
        Where two are of the same body at the same time the later one counts.
    """

    def __init__(self, segments: Sequence[Segment]) -> None:
        self._segments_of: dict[int, list[Segment]] = {}
        for segment in segments:
            self._segments_of.setdefault(segment.body, []).append(segment)

    @property
    def bodies(self) -> tuple[int, ...]:
        """NAIF numbers of all bodies, ascending."""
        return tuple(sorted(self._segments_of))

    def files_of(self, body: int) -> tuple[str, ...]:
        """Return the names of the kernels that have a body."""
        names = dict.fromkeys(segment.file.name for segment in self._segments_of.get(body, ()))
        return tuple(names)

    def pieces(self, body: int, start: float = -np.inf, end: float = np.inf) -> list[Piece]:
        """Return the times for which the motion of a body about the Sun is known, in order."""
        return list(self._pieces(body, start, end, 0))

    def missing(self, body: int) -> str:
        """Return why the motion of a body about the Sun is not known, or when it is."""
        for _ in range(_LONGEST_CHAIN):
            segments = self._segments_of.get(body)
            if body == BARYCENTRE:
                if SUN in self._segments_of:
                    return "none of its time is in the kernel that has the Sun"
                return (
                    "is given relative to the barycentre of the solar system, expected a kernel "
                    f"with the Sun relative to it besides, {_SUN_KERNEL}"
                )
            if not segments:
                return (
                    f"is given relative to body {body}, expected a kernel with that one besides, "
                    f"{_SUN_KERNEL}"
                )
            body = segments[-1].centre
        return "its centres go in a circle"

    @contextmanager
    def reading(self) -> Iterator[States]:
        """Open the kernels and yield what has their states; they are closed at the end."""
        with ExitStack() as stack:
            handles: dict[Path, int] = {}

            def states(piece: Piece, epochs: NDArray[np.float64]) -> NDArray[np.float64]:
                total = np.zeros((len(epochs), 6))
                for segment, sign in piece.links:
                    if segment.file not in handles:
                        handles[segment.file] = stack.enter_context(opened(segment.file))
                    inside = np.clip(epochs, segment.start, segment.end)
                    found = states_in_segment(
                        segment.file, handles[segment.file], segment.descriptor, inside
                    )
                    # Ends of segments are rounded, and SPICE is strict about them.
                    found[:, :3] += found[:, 3:] * (epochs - inside)[:, None]
                    for half in (slice(0, 3), slice(3, 6)):
                        total[:, half] += sign * (found[:, half] @ segment.to_ecliptic.T)
                if not np.isfinite(total).all():
                    file = piece.links[0][0].file
                    raise InputError(f"{file}: damaged: a state is not finite")
                return total * _M_OF_KM

            yield states

    def _pieces(self, body: int, start: float, end: float, depth: int) -> Iterator[Piece]:
        if body == SUN:
            yield Piece(start, end, ())
        elif depth < _LONGEST_CHAIN:
            target, sign = (SUN, -1.0) if body == BARYCENTRE else (body, 1.0)
            for segment, first, last in self._runs(target, start, end):
                if body != BARYCENTRE:
                    for piece in self._pieces(segment.centre, first, last, depth + 1):
                        yield Piece(piece.start, piece.end, ((segment, sign), *piece.links))
                elif segment.centre == BARYCENTRE:
                    yield Piece(first, last, ((segment, sign),))

    def _runs(
        self, target: int, start: float, end: float
    ) -> Iterator[tuple[Segment, float, float]]:
        """Yield which segment of a body counts from when to when."""
        own = [
            segment
            for segment in self._segments_of.get(target, ())
            if segment.end > start and segment.start < end
        ]
        if not own:
            return
        spans = np.clip([(segment.start, segment.end) for segment in own], start, end)
        edges = np.unique(spans)
        counts = np.full(len(edges) - 1, -1)
        for number, (first, last) in enumerate(np.searchsorted(edges, spans)):
            counts[first:last] = number
        changes = np.flatnonzero(np.diff(counts)) + 1
        for run in np.split(np.arange(len(counts)), changes):
            if len(run) and counts[run[0]] >= 0:
                yield own[counts[run[0]]], float(edges[run[0]]), float(edges[run[-1] + 1])


def states_at(
    pieces: Sequence[Piece], states: States, epochs: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return (k, 6) states of a body at (k,) epochs that its pieces cover, m and m/s."""
    starts = np.array([piece.start for piece in pieces])
    which = np.clip(np.searchsorted(starts, epochs, side="right") - 1, 0, None)
    result = np.empty((len(epochs), 6))
    for number in np.unique(which):
        mine = which == number
        result[mine] = states(pieces[number], epochs[mine])
    return result
