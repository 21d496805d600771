"""`TextColumn`: a million short texts in two arrays instead of a million objects."""

from collections.abc import Iterable, Iterator, Sequence
from typing import Final, final, overload

import numpy as np
from numpy.typing import NDArray

_FIRST: Final = 3
"""Texts that `repr` shows."""


@final
class TextColumn(Sequence[str]):
    """A sequence of texts that is compact in memory and in pickles.

    It is indexed, sliced, searched and compared as a tuple of str would be; an item becomes a
    str when it is asked for.

    Parameters
    ----------
    data : array_like
        (b,) uint8: the texts in UTF-8, one behind the other.
    ends : array_like
        (n,) int64: where each text ends; the first begins at 0.
    """

    __slots__ = ("_data", "_ends")

    def __init__(self, data: NDArray[np.uint8], ends: NDArray[np.int64]) -> None:
        self._data = np.ascontiguousarray(data, dtype=np.uint8)
        self._ends = np.ascontiguousarray(ends, dtype=np.int64)

    @classmethod
    def of(cls, texts: Iterable[str]) -> "TextColumn":
        """Return the column of some texts."""
        encoded = [text.encode("utf-8", "replace") for text in texts]
        lengths = np.fromiter(map(len, encoded), np.int64, len(encoded))
        return cls(np.frombuffer(b"".join(encoded), np.uint8), np.cumsum(lengths))

    @property
    def data(self) -> NDArray[np.uint8]:
        """(b,) uint8: the texts in UTF-8, one behind the other."""
        return self._data

    @property
    def ends(self) -> NDArray[np.int64]:
        """(n,) int64: where each text ends."""
        return self._ends

    def __len__(self) -> int:
        return len(self._ends)

    @overload
    def __getitem__(self, index: int) -> str: ...
    @overload
    def __getitem__(self, index: slice) -> "TextColumn": ...
    def __getitem__(self, index: int | slice) -> "str | TextColumn":
        if isinstance(index, slice):
            return self.take(np.arange(len(self))[index])
        row = range(len(self))[index]
        begin = self._ends[row - 1] if row else 0
        return self._data[begin : self._ends[row]].tobytes().decode("utf-8", "replace")

    def __iter__(self) -> Iterator[str]:
        packed, begin = self._data.tobytes(), 0
        for end in self._ends.tolist():
            yield packed[begin:end].decode("utf-8", "replace")
            begin = end

    def __eq__(self, other: object) -> bool:
        if isinstance(other, TextColumn):
            return np.array_equal(self._ends, other._ends) and np.array_equal(
                self._data, other._data
            )
        if isinstance(other, tuple):
            return len(self) == len(other) and all(
                a == b for a, b in zip(self, other, strict=True)
            )
        return NotImplemented

    def __hash__(self) -> int:
        return hash(tuple(self))

    def __repr__(self) -> str:
        shown = ", ".join(repr(text) for text in self[:_FIRST])
        return f"TextColumn(n={len(self)}: {shown}{', ...' if len(self) > _FIRST else ''})"

    def __reduce__(self) -> tuple[type, tuple[NDArray[np.uint8], NDArray[np.int64]]]:
        return TextColumn, (self._data, self._ends)

    def take(self, rows: NDArray[np.int64]) -> "TextColumn":
        """Return the texts of some rows, in that order."""
        begins = np.concatenate([[0], self._ends[:-1]]).astype(np.int64)[rows]
        lengths = self._ends[rows] - begins
        ends = np.cumsum(lengths)
        # Each byte's place: where its text begins, and how far it is inside.
        inside = np.arange(int(lengths.sum())) - np.repeat(ends - lengths, lengths)
        return TextColumn(self._data[np.repeat(begins, lengths) + inside], ends)

    @classmethod
    def concatenate(cls, parts: Sequence["TextColumn"]) -> "TextColumn":
        """Return the texts of all parts in order."""
        starts = np.cumsum([0, *(len(part.data) for part in parts)])
        ends = [part.ends + start for part, start in zip(parts, starts[:-1], strict=True)]
        none: list[NDArray[np.int64]] = [np.zeros(0, np.int64)]
        return cls(
            np.concatenate([np.zeros(0, np.uint8), *(part.data for part in parts)]),
            np.concatenate(none + ends),
        )


def taken_texts(texts: Sequence[str], rows: NDArray[np.int64]) -> Sequence[str]:
    """Return some of many texts, in the form in which they come: a column, or else a tuple."""
    if isinstance(texts, TextColumn):
        return texts.take(rows)
    return tuple(texts[row] for row in rows.tolist())
