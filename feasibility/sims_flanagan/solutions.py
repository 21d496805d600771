"""`LegSolutions`: what every leg solver returns, one row a leg."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from enum import IntEnum
from typing import Final, Self, final

import numpy as np
from numpy.typing import NDArray

MISMATCH_TOLERANCE: Final = 1e-6
"""Largest mismatch of a closed leg, in units of AU, Earth velocity and initial mass."""

THROTTLE_TOLERANCE: Final = 1e-6
"""By how much the norm of a throttle may exceed 1 through rounding in a solver."""

TWO_IMPULSE: Final = 50
"""`LegSolutions.start` of the cheapest two-impulse arc; the next ones follow."""


@final
class Status(IntEnum):
    """How the solution of one leg ended."""

    CONVERGED = 0
    """A closed leg, confirmed by pykep's own leg."""
    NOT_CONVERGED = 1
    """No start led to a closed leg."""
    BELOW_DRY_MASS = 2
    """Closed, but the final mass is below the dry mass (minimum propellant only)."""
    TOO_HEAVY = 3
    """The initial mass exceeds the maximum initial mass: not flyable (minimum propellant only)."""


@final
@dataclass(frozen=True, eq=False)
class LegSolutions:
    """Sims-Flanagan legs as found by a solver; a failed solve is a row, not an exception.

    With n the number of legs and s the number of segments.

    Attributes
    ----------
    throttles : (n, s, 3) float64
        Throttle vectors, norm at most 1, heliocentric frame; NaN where not converged. In
        the first s // 2 segments an impulse is thrust x dt x throttle / the mass before it, in
        the others / the mass after it (pykep's convention, cut one half): `impulses` gives
        them in m/s.
    m0 : (n,) float64, kg
        Initial mass: the maximum initial mass m* or the given one; 0 where not
        converged.
    m_final : (n,) float64, kg
        Final mass; 0 where not converged.
    mismatch : (n,) float64
        Largest absolute mismatch at the match point, in units of AU,
        `constants.EARTH_VELOCITY` and `m0`; inf where not converged.
    converged : (n,) bool
        Where `status` is `Status.CONVERGED`: closed to `MISMATCH_TOLERANCE` with throttles
        at most 1 + `THROTTLE_TOLERANCE`, and for minimum propellant not below the dry mass.
    status : (n,) int8
        `Status` values.
    start : (n,) int16
        Which start won (an index into the solver's own list), -1 where none did.
    seconds : (n,) float64
        Processor time spent on the leg.
    """

    throttles: NDArray[np.float64]
    m0: NDArray[np.float64]
    m_final: NDArray[np.float64]
    mismatch: NDArray[np.float64]
    converged: NDArray[np.bool_]
    status: NDArray[np.int8]
    start: NDArray[np.int16]
    seconds: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.m0)

    @property
    def n_segments(self) -> int:
        """Number of segments, s."""
        return int(self.throttles.shape[1])

    def take(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> Self:
        """Return the solutions at the given rows (indices or a boolean mask)."""
        return type(self)(*(getattr(self, field.name)[rows] for field in fields(self)))

    @classmethod
    def concatenate(cls, parts: Sequence["LegSolutions"]) -> "LegSolutions":
        """Return the rows of all parts (at least one, of equal segment counts), in order."""
        return cls(
            *(
                np.concatenate([getattr(part, field.name) for part in parts])
                for field in fields(cls)
            )
        )

    @classmethod
    def unsolved(cls, n_legs: int, n_segments: int) -> "LegSolutions":
        """Return `n_legs` rows that are not converged, for a solver to fill in."""
        return cls(
            throttles=np.full((n_legs, n_segments, 3), np.nan),
            m0=np.zeros(n_legs),
            m_final=np.zeros(n_legs),
            mismatch=np.full(n_legs, np.inf),
            converged=np.zeros(n_legs, dtype=np.bool_),
            status=np.full(n_legs, Status.NOT_CONVERGED, dtype=np.int8),
            start=np.full(n_legs, -1, dtype=np.int16),
            seconds=np.zeros(n_legs),
        )
