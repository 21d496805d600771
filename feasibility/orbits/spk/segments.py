"""The segments of SPK kernels: which body, about which centre, from when to when.

Layout of the files as in NAIF's "DAF Required Reading": a file record, then records of summaries
that name each other, 128 words of 8 bytes each. It is read here rather than by SPICE, which trusts
files more than it should: numbers that no kernel has can end the whole program.
"""

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.errors import InputError
from feasibility.orbits.spk.structure import check_data
from feasibility.runtime.spice import spice

_LAST_INERTIAL: Final = 21
"""Frames 1 to 21 are SPICE's inertial ones; all others turn, or need a further kernel."""

_WORDS: Final = 128
"""Words in a record."""

_WORD: Final = 8
_COUNTS: Final = (2, 6)
"""Double precision and integer components of a summary in an SPK file."""

_SUMMARY: Final = 5
_MOST_SUMMARIES: Final = 25


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
    return [segment for file in files for segment in _of_file(file)]


def _of_file(file: Path) -> list[Segment]:
    words, order = _words(file)
    rotations: dict[int, NDArray[np.float64]] = {}
    segments = []
    for start, end, numbers in _summaries(file, words, order):
        body, centre, frame, kind, first, last = numbers
        if not (0 < first <= last <= len(words) and -np.inf < start <= end < np.inf):
            raise InputError(f"{file}: damaged: a segment of body {body} lies outside the file")
        if frame not in rotations:
            rotations[frame] = _to_ecliptic(file, body, frame)
        check_data(file, body, kind, words[first - 1 : last], (start, end))
        packed = struct.pack("=2d6i", start, end, *numbers)
        descriptor = np.frombuffer(packed, dtype=np.float64).copy()
        segments.append(Segment(file, body, centre, start, end, rotations[frame], descriptor))
    if not segments:
        raise InputError(f"{file}: damaged: a kernel without a segment")
    return segments


def _words(file: Path) -> tuple[NDArray[np.float64], str]:
    """Return the words of a file, mapped rather than read, and the order of its bytes."""
    try:
        size = file.stat().st_size
        with file.open("rb") as stream:
            record = stream.read(_WORDS * _WORD)
    except OSError as error:
        raise InputError(f"{file}: cannot be read ({error.strerror})") from None
    if len(record) < _WORDS * _WORD:
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
    words = np.memmap(file, dtype=f"{order}f8", mode="r", shape=(free - 1,))
    return words, order


def _summaries(
    file: Path, words: NDArray[np.float64], order: str
) -> Iterator[tuple[float, float, tuple[int, ...]]]:
    """Yield start, end and the six numbers of each summary."""
    record = int(words[:_WORDS].view(f"{order}i4")[19])
    seen: set[int] = set()
    while record:
        if record in seen or not 2 <= record <= len(words) // _WORDS:
            raise InputError(f"{file}: damaged: its summaries do not follow each other")
        seen.add(record)
        block = words[(record - 1) * _WORDS : record * _WORDS]
        following, _, count = (float(value) for value in block[:3])
        whole = following.is_integer() and count.is_integer()
        if not (whole and 0 <= count <= _MOST_SUMMARIES):
            raise InputError(f"{file}: damaged: a record of summaries has {count:g} of them")
        for k in range(int(count)):
            summary = block[3 + _SUMMARY * k : 3 + _SUMMARY * (k + 1)]
            numbers = tuple(int(number) for number in summary[2:].view(f"{order}i4"))
            yield float(summary[0]), float(summary[1]), numbers
        record = int(following)


def _to_ecliptic(file: Path, body: int, frame: int) -> NDArray[np.float64]:
    with spice() as spiceypy:
        if not 1 <= frame <= _LAST_INERTIAL:
            name = spiceypy.frmnam(frame) or frame
            raise InputError(
                f"{file}: the states of body {body} are in the frame {name}, expected an inertial "
                "one such as J2000"
            )
        return np.asarray(spiceypy.pxform(spiceypy.frmnam(frame), "ECLIPJ2000", 0.0))
