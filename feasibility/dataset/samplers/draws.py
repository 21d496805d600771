"""`Draw`: legs as a sampler proposes them, before anything is solved."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.errors import InputError
from feasibility.legs import Legs

Columns = dict[str, NDArray[Any]]

_LEAST_ACCEPTANCE: Final = 1e-4
_FIRST_BATCHES: Final = 50
"""Batches before a sampler that accepts almost nothing is given up."""


@final
@dataclass(frozen=True, eq=False)
class Draw:
    """What a sampler draws.

    Attributes
    ----------
    legs : Legs
        n legs with epochs and ids.
    dt_imp_days : (n,) float64
        Flight time of the cheapest impulsive transfer; NaN where the sampler has none.
    m0_min, m0_max : (n,) float64, kg
        Range of initial masses that the protocol speaks about.
    """

    legs: Legs
    dt_imp_days: NDArray[np.float64]
    m0_min: NDArray[np.float64]
    m0_max: NDArray[np.float64]

    def head(self, n: int) -> "Draw":
        """Return the first `n` legs."""
        return Draw(
            self.legs.take(np.arange(n)), self.dt_imp_days[:n], self.m0_min[:n], self.m0_max[:n]
        )


def collect(n: int, batch: Callable[[int], Columns]) -> Columns:
    """Call `batch` until it has accepted `n` rows in all, and return the first `n`.

    Parameters
    ----------
    n : int
        Rows wanted.
    batch : callable
        Draws the given number of candidates and returns the columns of those it accepts.

    Raises
    ------
    InputError
        Almost no candidate is accepted.
    """
    parts: list[Columns] = []
    accepted = proposed = 0
    while accepted < n:
        # Half as many again: most batches end in one or two rounds.
        candidates = (n - accepted) * 3 // 2 + 16
        part = batch(candidates)
        parts.append(part)
        accepted += len(next(iter(part.values())))
        proposed += candidates
        if len(parts) >= _FIRST_BATCHES and accepted < _LEAST_ACCEPTANCE * proposed:
            raise InputError(
                f"sampler: only {accepted} of {proposed} drawn legs are within its limits; "
                "expected limits that keep more of the catalogue's pairs"
            )
    return {name: np.concatenate([part[name] for part in parts])[:n] for name in parts[0]}
