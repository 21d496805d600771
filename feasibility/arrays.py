"""`StructOfArrays`: the base of records that hold one row a thing in each of their columns."""

from collections.abc import Sequence
from dataclasses import fields
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray


class StructOfArrays:
    """A dataclass whose fields are columns of equal length; abstract, its children are final.

    A column is an array with n rows, another struct of n rows (anything with `take` and
    `concatenate`), or a tuple of such columns.
    """

    def __len__(self) -> int:
        return _length(getattr(self, _names(type(self))[0]))

    def take(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> Self:
        """Return the given rows (indices or a mask)."""
        return type(self)(*(_taken(getattr(self, name), rows) for name in _names(type(self))))

    @classmethod
    def concatenate(cls, parts: Sequence[Self]) -> Self:
        """Return the rows of all parts, at least one, in order."""
        return cls(*(_joined([getattr(part, name) for part in parts]) for name in _names(cls)))


def _names(cls: Any) -> list[str]:
    return [field.name for field in fields(cls)]


def _length(column: Any) -> int:
    return _length(column[0]) if isinstance(column, tuple) else len(column)


def _taken(column: Any, rows: NDArray[np.intp] | NDArray[np.bool_]) -> Any:
    if isinstance(column, tuple):
        return tuple(_taken(part, rows) for part in column)
    return column[rows] if isinstance(column, np.ndarray) else column.take(rows)


def _joined(columns: list[Any]) -> Any:
    first = columns[0]
    if isinstance(first, tuple):
        return tuple(_joined(list(same)) for same in zip(*columns, strict=True))
    if isinstance(first, np.ndarray):
        return np.concatenate(columns)
    return type(first).concatenate(columns)
