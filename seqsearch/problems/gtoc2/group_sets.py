"""`GroupSets`: which body belongs to which group, and sets of groups as bits of integers."""

from dataclasses import dataclass
from functools import cached_property
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

_Rows = NDArray[np.intp]

NO_GROUP: Final = -1
"""Of the Earth."""


@final
@dataclass(frozen=True, eq=False)
class GroupSets:
    """The group of each body; a set of groups is an integer with their bits set.

    Parameters
    ----------
    of_body : (n,) intp
        Group of each body, 0 to g - 1; `NO_GROUP` for none.
    """

    of_body: _Rows

    @cached_property
    def count(self) -> int:
        """Number g of groups."""
        return int(self.of_body.max(initial=NO_GROUP)) + 1

    @cached_property
    def sizes(self) -> _Rows:
        """(2^g,) how many groups each set has."""
        return np.array([bin(groups).count("1") for groups in range(1 << self.count)])

    def left(self, visited: NDArray[np.intp]) -> _Rows:
        """Return (m,) the sets of groups of which (m, w) visited rows have no body; -1 is none."""
        everything = (1 << self.count) - 1
        group = np.where(visited >= 0, self.of_body[visited], NO_GROUP)
        bits = np.where(group >= 0, 1 << np.maximum(group, 0), 0)
        sets: _Rows = everything & ~np.bitwise_or.reduce(bits, axis=1)
        return sets

    def contain(self, sets: _Rows, row: _Rows) -> NDArray[np.bool_]:
        """Return whether sets of groups have the groups of bodies in them; shapes broadcast."""
        group = self.of_body[row]
        inside: NDArray[np.bool_] = (group >= 0) & ((sets >> np.maximum(group, 0)) & 1 == 1)
        return inside

    def without(self, sets: _Rows, row: _Rows) -> _Rows:
        """Return sets of groups less those of bodies that have one; shapes broadcast."""
        rest: _Rows = sets & ~(1 << self.of_body[row])
        return rest
