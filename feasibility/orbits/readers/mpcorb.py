"""The Minor Planet Center's orbits in the format of ``MPCORB.DAT`` and ``NEA.txt``.

Columns have fixed places and may be blank; the format is described in
<https://www.minorplanetcenter.net/iau/info/MPOrbitFormat.html>. A full file has 1.5 million lines:
they are read some ten thousand at a time, column by column.
"""

import re
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from feasibility.errors import InputError
from feasibility.orbits.readers.bodies import UNNUMBERED, BodyTable, sieved
from feasibility.orbits.readers.columns import NEEDED
from feasibility.orbits.readers.fixed_columns import decimals
from feasibility.orbits.readers.packed import designation, mjd_of, numbers_of
from feasibility.runtime.text_column import TextColumn

LABEL: Final = "MPCORB"

_WIDTH: Final = 202
_LEAST_WIDTH: Final = 103
"""Up to the semi-major axis."""
_EPOCH: Final = slice(20, 25)
_ORBIT: Final = {
    "a": slice(92, 103),
    "e": slice(70, 79),
    "i": slice(59, 68),
    "node": slice(48, 57),
    "argp": slice(37, 46),
    "M": slice(26, 35),
}
_EXTRA: Final = {
    "H": slice(8, 13),
    "G": slice(14, 19),
    "n_obs": slice(117, 122),
    "n_opp": slice(123, 126),
}
_FLAGS: Final = slice(161, 165)
_FLAG_BITS: Final = {"neo": 0x0800, "pha": 0x8000}
_NAME: Final = slice(166, 194)
_BETWEEN: Final = (7, 13, 19, 25, 35, 36, 46, 47, 57, 58, 68, 69, 79, 91, 103, 104)
"""Places that are blank in every line."""

_SNIFFED: Final = 200
"""Lines before the first orbit: the file has a preamble of 43."""
_AT_ONCE: Final = 1 << 15
_SCAN: Final = 1 << 24

_LINE: Final = re.compile(rb"[0-9A-Za-z~_]{5,7} {1,3}.{11} [IJKL]\d\d[1-9A-C][1-9A-V]\b")
_LIKE_A_LINE: Final = re.compile(rb"[0-9A-Za-z~_]{5,7} +(?:.* )?(?:\d+\.\d+ +){3}")


def is_mpcorb(data: bytes) -> bool:
    """Return whether a table is in this format."""
    return any(_LINE.match(line) for line in _head(data))


def _head(data: bytes) -> list[bytes]:
    return data[: _SNIFFED * 2 * _WIDTH].split(b"\n")[:_SNIFFED]


def mpcorb_bodies(file: Path, data: bytes) -> BodyTable:
    """Return the bodies of a table in this format.

    A numbered body has its number as id. Others have 50 000 000 more than the number of their
    row, or that number alone where no body of the table is numbered.

    Raises
    ------
    InputError
        A line below the first orbit is no orbit, or as `sieved`.
    """
    letters = np.frombuffer(data, np.uint8)
    begins, ends = _line_bounds(letters)
    lines = np.arange(_first_orbit(file, data), len(begins))
    lines = lines[_filled(letters, begins, ends, lines)]
    parts = [
        _Block(file, letters, begins, ends, lines[at : at + _AT_ONCE])
        for at in range(0, len(lines), _AT_ONCE)
    ]
    numbers = np.concatenate([part.numbers for part in parts])
    unnumbered = np.arange(1, len(lines) + 1)
    if (numbers >= 0).any():
        unnumbered += UNNUMBERED
    cut = ends[lines[-1]] == len(letters) and ends[lines[-1]] - begins[lines[-1]] < _WIDTH - 8
    note = f", line {lines[-1] + 1}: ends early and has no line end; is the file truncated?"
    return sieved(
        file,
        LABEL,
        np.where(numbers >= 0, numbers, unnumbered),
        TextColumn.concatenate([part.names for part in parts]),
        np.concatenate([part.orbits for part in parts]),
        {name: np.concatenate([part.extra[name] for part in parts]) for name in parts[0].extra},
        lambda row: f"line {lines[row] + 1}",
        (note,) if cut else (),
    )


def _line_bounds(letters: NDArray[np.uint8]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return where lines begin and end."""
    ends = [
        np.flatnonzero(letters[at : at + _SCAN] == ord("\n")) + at
        for at in range(0, len(letters), _SCAN)
    ]
    bounds = np.concatenate([*ends, [len(letters)]]).astype(np.int64)
    return np.concatenate([[0], bounds[:-1] + 1]), bounds


def _first_orbit(file: Path, data: bytes) -> int:
    """Return the index of the first line that is an orbit, behind a preamble of text."""
    for index, line in enumerate(_head(data)):
        if _LINE.match(line):
            return index
        if _LIKE_A_LINE.match(line):
            raise _no_orbit(file, index, line)
    raise AssertionError(file)


def _no_orbit(file: Path, index: int, line: bytes) -> InputError:
    epoch = line[_EPOCH].decode("latin-1").strip()
    if len(line) < _LEAST_WIDTH:
        fault = f"{len(line)} characters, expected {_WIDTH}"
    elif np.isnan(mjd_of(epoch)):
        fault = f"columns 21 to 25 are {epoch!r}, expected an epoch such as K205V"
    else:
        fault = "its columns are not at their places"
    return InputError(
        f"{file}, line {index + 1}: no orbit in the format of MPCORB ({fault}); "
        "expected designation, H, G, epoch, M, argp, node, i, e, n, a"
    )


def _filled(
    letters: NDArray[np.uint8],
    begins: NDArray[np.int64],
    ends: NDArray[np.int64],
    lines: NDArray[np.int64],
) -> NDArray[np.bool_]:
    """Return which lines are not blank."""
    length = ends[lines] - begins[lines]
    filled = length > 0
    for k in np.flatnonzero(filled & (length < _LEAST_WIDTH)).tolist():
        line = letters[begins[lines[k]] : ends[lines[k]]].tobytes()
        filled[k] = bool(line.strip())
    return filled


class _Block:
    """Some lines, read column by column."""

    def __init__(
        self,
        file: Path,
        letters: NDArray[np.uint8],
        begins: NDArray[np.int64],
        ends: NDArray[np.int64],
        lines: NDArray[np.int64],
    ) -> None:
        cells = _cells(letters, begins[lines], ends[lines])
        self.numbers, good = numbers_of(cells[:, :7])
        good &= ends[lines] - begins[lines] >= _LEAST_WIDTH
        good &= (cells[:, _BETWEEN] == ord(" ")).all(axis=1)
        good &= (cells[:, : _NAME.start] < 127).all(axis=1) & (cells >= 32).all(axis=1)
        self.orbits = np.empty((len(lines), len(NEEDED)))
        self.orbits[:, 0], dated = _epochs(cells[:, _EPOCH])
        good &= dated
        for name, place in _ORBIT.items():
            self.orbits[:, NEEDED.index(name)], known = decimals(cells[:, place])
            good &= known
        if not good.all():
            line = int(lines[np.argmin(good)])
            raise _no_orbit(file, line, letters[begins[line] : ends[line]].tobytes())
        # What is no part of the orbit may be damaged: then it is not known.
        self.extra = {name: decimals(cells[:, place])[0] for name, place in _EXTRA.items()}
        flags = _flags(cells[:, _FLAGS])
        for name, bit in _FLAG_BITS.items():
            self.extra[name] = np.where(flags >= 0, (flags & bit) != 0, np.nan)
        self.names = _names(cells)


def _cells(
    letters: NDArray[np.uint8], begins: NDArray[np.int64], ends: NDArray[np.int64]
) -> NDArray[np.uint8]:
    """Return (n, 202) the letters of lines, blanks behind those that are shorter."""
    inside = begins + _WIDTH <= len(letters)
    cells = np.full((len(begins), _WIDTH), ord(" "), np.uint8)
    if inside.any():
        # Every place of the file as the begin of a line: the rows are copied, the view is not.
        windows = np.lib.stride_tricks.as_strided(
            letters, (len(letters) - _WIDTH + 1, _WIDTH), (1, 1), writeable=False
        )
        cells[inside] = windows[begins[inside]]
    for row in np.flatnonzero(~inside).tolist():
        line = letters[begins[row] : ends[row]][:_WIDTH]
        cells[row, : len(line)] = line
    length = ends - begins
    short = np.flatnonzero(length < _WIDTH)
    if len(short):
        cells[short] = np.where(
            np.arange(_WIDTH) < length[short, None], cells[short], np.uint8(ord(" "))
        )
    return cells


def _epochs(cells: NDArray[np.uint8]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return packed epochs as MJD, NaN where blank, and which cells can be read."""
    # Few epochs occur, so each is unpacked once.
    texts = np.ascontiguousarray(cells).view("S5").ravel()
    known, places = np.unique(texts, return_inverse=True)
    plain = [text.decode("latin-1").strip() for text in known.tolist()]
    days = np.array([mjd_of(text) for text in plain])
    good = ~np.isnan(days) | np.array([not text for text in plain])
    return days[places], good[places]


def _flags(cells: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Return (n,) four hexadecimal digits as a number, -1 where there are none."""
    lower = cells | 32
    digit = np.where(cells < 64, cells - np.uint8(48), lower - np.uint8(87))
    good = ((cells >= 48) & (cells <= 57)) | ((lower >= 97) & (lower <= 102))
    number = digit.astype(np.int64) @ [4096, 256, 16, 1]
    return np.where(good.all(axis=1), number, -1)


def _names(cells: NDArray[np.uint8]) -> TextColumn:
    """Return the readable designations: "1 Ceres" for "(1) Ceres", unpacked ones where blank."""
    words = cells[:, _NAME].copy()
    filled = words != ord(" ")
    bare = ~filled.any(axis=1)
    for row in np.flatnonzero(bare).tolist():
        text = designation(cells[row, :7].tobytes().decode("latin-1").strip())
        words[row, : len(text)] = np.frombuffer(text.encode("latin-1"), np.uint8)
        filled[row, : len(text)] = True
    place = np.arange(words.shape[1])
    first = np.argmax(filled, axis=1)
    last = words.shape[1] - 1 - np.argmax(filled[:, ::-1], axis=1)
    kept = (place >= first[:, None]) & (place <= last[:, None])
    numbered = words[np.arange(len(words)), first] == ord("(")
    close = np.argmax(words == ord(")"), axis=1)
    kept[numbered] &= (place != first[numbered, None]) & (place != close[numbered, None])
    names = TextColumn(words[kept], np.cumsum(kept.sum(axis=1)))
    if (names.data < 128).all():
        return names
    # A letter beyond ASCII, which the format has not: as cp1252 where it is no UTF-8.
    return TextColumn.of(_decoded(words[row][kept[row]].tobytes()) for row in range(len(words)))


def _decoded(name: bytes) -> str:
    try:
        return name.decode("utf-8")
    except UnicodeDecodeError:
        return name.decode("cp1252", "replace")
