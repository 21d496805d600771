"""`KernelTable`: bodies that move as kernels say, sampled once so that every process has them."""

import hashlib
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from feasibility.constants import DAY_S, MU_SUN


@final
@dataclass(frozen=True)
class KernelSource:
    """A kernel that a table was made from: the name of its file and the SHA-256 of its content."""

    name: str
    sha256: str


@final
@dataclass(frozen=True, eq=False, repr=False)
class KernelTable:
    """An `Ephemeris` of Chebyshev pieces; within its span it is as the kernels to 1 m.

    Outside of it bodies go on along the Kepler orbits of its ends: a search looks a little
    beyond a mission's window, but visits nothing there.

    Parameters
    ----------
    first : (n + 1,) int64
        The pieces of body j are ``first[j]`` to ``first[j + 1] - 1``.
    start, end : (p,) float64
        MJD2000; the pieces of a body follow each other in time.
    coefficients : (p, 6, c) float64
        m and m/s, heliocentric J2000 ecliptic.
    sources : tuple of KernelSource
        The kernels, in the order in which they count.
    """

    first: NDArray[np.int64]
    start: NDArray[np.float64]
    end: NDArray[np.float64]
    coefficients: NDArray[np.float64]
    sources: tuple[KernelSource, ...]

    def __len__(self) -> int:
        return len(self.first) - 1

    def __repr__(self) -> str:
        names = ", ".join(source.name for source in self.sources)
        return f"KernelTable(n={len(self)}, sources={names})"

    def __getstate__(self) -> dict[str, Any]:
        """Leave out what can be derived: tables travel to worker processes."""
        return {name: self.__dict__[name] for name in self.__dataclass_fields__}

    def states_at(self, rows: ArrayLike, t_mjd2000: ArrayLike, /) -> NDArray[np.float64]:
        """Return (k, 6) states, m and m/s, of (k,) rows at (k,) epochs, as they are."""
        # numba takes a third of a second to import: pay when the first state is asked for.
        from feasibility.orbits.kepler_kernels import propagate_batch
        from feasibility.orbits.spk.table_kernels import table_states

        states, outside = table_states(
            self.first,
            self.start,
            self.end,
            self.coefficients,
            np.ascontiguousarray(rows, dtype=np.int64),
            np.ascontiguousarray(t_mjd2000, dtype=np.float64),
        )
        beyond = outside != 0.0
        if beyond.any():
            states[beyond] = propagate_batch(states[beyond], outside[beyond] * DAY_S, MU_SUN)
        result: NDArray[np.float64] = states
        return result

    def select(self, rows: ArrayLike, /) -> Self:
        """Return the table of some bodies, in the order of the rows."""
        index = np.asarray(rows, dtype=np.int64)
        pieces = np.concatenate(
            [np.arange(self.first[row], self.first[row + 1]) for row in index]
            or [np.zeros(0, dtype=np.int64)]
        )
        first = np.concatenate([[0], np.cumsum(self.first[index + 1] - self.first[index])])
        return type(self)(
            first.astype(np.int64),
            self.start[pieces],
            self.end[pieces],
            self.coefficients[pieces],
            self.sources,
        )

    @cached_property
    def digest(self) -> str:
        """SHA-256 of the table's numbers."""
        digest = hashlib.sha256()
        for array in (self.first, self.start, self.end, self.coefficients):
            digest.update(np.ascontiguousarray(array).tobytes())
        return digest.hexdigest()
