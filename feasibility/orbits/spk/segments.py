"""The segments of SPK kernels: which body, about which centre, from when to when."""

import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.errors import InputError
from feasibility.runtime.spice import opened, spice

_LAST_INERTIAL: Final = 21
"""Frames 1 to 21 are SPICE's inertial ones; all others turn, or need a further kernel."""

_FILE_RECORD: Final = 1024
_COUNTS: Final = (2, 6)
"""Double precision and integer components of a descriptor in an SPK file."""

_WORD: Final = 8


@final
@dataclass(frozen=True, eq=False)
class Segment:
    """One segment of a kernel.

    Attributes
    ----------
    file : Path
        The kernel.
    body, centre : int
        NAIF numbers.
    kind : int
        Type of the segment, 1 to 21.
    start, end : float
        Seconds of TDB past J2000 for which it has states.
    to_ecliptic : (3, 3) float64
        Turns its frame to the ecliptic of J2000.
    descriptor : (5,) float64
        What SPICE finds it by.
    """

    file: Path
    body: int
    centre: int
    kind: int
    start: float
    end: float
    to_ecliptic: NDArray[np.float64] = field(repr=False)
    descriptor: NDArray[np.float64] = field(repr=False)


def read_segments(files: Sequence[Path]) -> list[Segment]:
    """Return the segments of kernels, in the order of files and within them.

    Raises
    ------
    InputError
        A file cannot be read, is cut off or damaged, or a segment's frame is not inertial.
    """
    segments: list[Segment] = []
    for file in files:
        words = _checked_words(file)
        with spice() as spiceypy, opened(file) as handle:
            spiceypy.dafbfs(handle)
            rotations: dict[int, NDArray[np.float64]] = {}
            while spiceypy.daffna():
                # The summary is padded to the longest that any DAF file may have.
                descriptor = np.array(spiceypy.dafgs()[:5], dtype=np.float64)
                times, numbers = spiceypy.dafus(descriptor, *_COUNTS)
                body, centre, frame, kind, first, last = (int(number) for number in numbers)
                if not (0 < first <= last <= words and times[0] <= times[1]):
                    raise InputError(
                        f"{file}: damaged: a segment of body {body} lies outside the file"
                    )
                if frame not in rotations:
                    rotations[frame] = _to_ecliptic(spiceypy, file, body, frame)
                segments.append(
                    Segment(
                        file,
                        body,
                        centre,
                        kind,
                        float(times[0]),
                        float(times[1]),
                        rotations[frame],
                        descriptor,
                    )
                )
        if not any(segment.file == file for segment in segments):
            raise InputError(f"{file}: damaged: a kernel without a segment")
    return segments


def _checked_words(file: Path) -> int:
    """Return how many words a kernel has; its own record says how many it should have."""
    try:
        size = file.stat().st_size
        with file.open("rb") as stream:
            record = stream.read(_FILE_RECORD)
    except OSError as error:
        raise InputError(f"{file}: cannot be read ({error.strerror})") from None
    if len(record) < _FILE_RECORD:
        raise InputError(f"{file}: cut off: {size} bytes, expected a kernel of at least 1024")
    order = ">" if record[88:96] == b"BIG-IEEE" else "<"
    counts = struct.unpack(f"{order}2i", record[8:16])
    free = struct.unpack(f"{order}i", record[84:88])[0]
    if counts != _COUNTS or free < 1:
        raise InputError(f"{file}: damaged: its first record is not that of an SPK kernel")
    if size < (free - 1) * _WORD:
        raise InputError(
            f"{file}: cut off: {size} bytes, expected {(free - 1) * _WORD} by its first record"
        )
    return int(free - 1)


def _to_ecliptic(spiceypy: Any, file: Path, body: int, frame: int) -> NDArray[np.float64]:
    if not 1 <= frame <= _LAST_INERTIAL:
        name = spiceypy.frmnam(frame) or frame
        raise InputError(
            f"{file}: the states of body {body} are in the frame {name}, expected an inertial "
            "one such as J2000"
        )
    return np.asarray(spiceypy.pxform(spiceypy.frmnam(frame), "ECLIPJ2000", 0.0))
