"""`MimaPruner` and `Mima2Pruner`: the initial mass against a closed-form largest one."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from feasibility.errors import InputError
from feasibility.legs import Legs
from feasibility.orbits.mima import mima, mima2


@dataclass(frozen=True)
class _LargestMassPruner(ABC):
    """Keeps a leg whose estimated largest initial mass is at least `margin` times its mass."""

    margin: float = 1.0
    max_revs: int = 2

    def __post_init__(self) -> None:
        kind = type(self).__name__
        if not self.margin > 0:
            raise InputError(f"{kind} margin: {self.margin}, expected more than zero")
        if self.max_revs < 0:
            raise InputError(f"{kind} max_revs: {self.max_revs}, expected zero or more")

    @abstractmethod
    def _largest_mass(self, legs: Legs) -> NDArray[np.float64]:
        """Return the estimate, (n,) kg."""

    def keep(self, legs: Legs, /) -> NDArray[np.bool_]:
        """Return (n,) bool, True where the leg survives."""
        return self._largest_mass(legs) >= self.margin * legs.m0


@final
@dataclass(frozen=True)
class MimaPruner(_LargestMassPruner):
    """Keeps a leg whose MIMA is at least `margin` times its initial mass.

    Parameters
    ----------
    margin : float
        Least ratio of MIMA, on the best Lambert branch, to the initial mass.
        Below 1 fewer flyable legs are lost, and more others kept.
    max_revs : int
        Largest number of complete revolutions of a Lambert arc.

    Raises
    ------
    InputError
        `margin` is not positive, or `max_revs` is negative.

    Notes
    -----
    See `feasibility.orbits.mima` for the approximation and its source.

    Examples
    --------
    >>> MimaPruner(margin=0.95).name
    'mima'
    """

    @property
    def name(self) -> str:
        """Name in counters and reports."""
        return "mima"

    def _largest_mass(self, legs: Legs) -> NDArray[np.float64]:
        return mima(
            legs.rv_dep, legs.rv_arr, legs.tof_s, legs.thrust, legs.exhaust_velocity, self.max_revs
        )


@final
@dataclass(frozen=True)
class Mima2Pruner(_LargestMassPruner):
    """Keeps a leg whose MIMA2, which follows gravity along the arc, is at least `margin` times m0.

    Parameters, errors and source as for `MimaPruner`.

    Examples
    --------
    >>> Mima2Pruner(margin=0.95).name
    'mima2'
    """

    @property
    def name(self) -> str:
        """Name in counters and reports."""
        return "mima2"

    def _largest_mass(self, legs: Legs) -> NDArray[np.float64]:
        return mima2(
            legs.rv_dep, legs.rv_arr, legs.tof_s, legs.thrust, legs.exhaust_velocity, self.max_revs
        )
