"""`MimaPruner` and `Mima2Pruner`: the initial mass against a closed-form largest one."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from feasibility.constants import MU_SUN
from feasibility.errors import InputError
from feasibility.legs import Legs
from feasibility.orbits.lambert import with_lambert_excess
from feasibility.orbits.mima import mima, mima2
from feasibility.orbits.transfer_plane import in_line, levelled_targets


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
    def _largest_mass(
        self, legs: Legs, rv_dep: NDArray[np.float64], rv_arr: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the estimate, (n,) kg, for the end states `rv_dep` and `rv_arr`."""

    def keep(self, legs: Legs, /) -> NDArray[np.bool_]:
        """Return (n,) bool, True where the leg survives."""
        rv_dep = legs.rv_dep
        rv_arr = levelled_targets(legs.rv_dep, legs.rv_arr, legs.tof_s, MU_SUN)
        thrustless = np.zeros(len(legs), dtype=np.bool_)
        free = np.flatnonzero(legs.free_ends)
        if len(free):
            rv_dep, rv_arr = rv_dep.copy(), rv_arr.copy()
            some = legs.take(free)
            rv_dep[free], rv_arr[free], rest = with_lambert_excess(
                *(some.rv_dep, rv_arr[free], some.tof_s, some.vinf_dep, some.vinf_arr),
                max_revs=self.max_revs,
            )
            thrustless[free] = rest == 0.0
        enough = self._largest_mass(legs, rv_dep, rv_arr) >= self.margin * legs.m0
        return enough | thrustless | in_line(legs.rv_dep, legs.rv_arr)


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
    See `feasibility.orbits.mima` for the approximation and its source. Retrograde legs are
    judged as their prograde mirror images are. Near 0 and 180 degrees, where the plane
    through both positions misleads, the plane of the departure orbit is taken and the turn
    out of it neglected: such legs are rather kept, and always exactly at 0 degrees.

    The closed forms know no free ends. A leg with them is judged as the leg that begins and ends
    with the excess velocities of the Lambert arc of which least is left, cut to their bounds; one
    of which nothing is left is kept.

    Examples
    --------
    >>> MimaPruner(margin=0.95).name
    'mima'
    """

    @property
    def name(self) -> str:
        """Name in counters and reports."""
        return "mima"

    def _largest_mass(
        self, legs: Legs, rv_dep: NDArray[np.float64], rv_arr: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        return mima(rv_dep, rv_arr, legs.tof_s, legs.thrust, legs.exhaust_velocity, self.max_revs)


@final
@dataclass(frozen=True)
class Mima2Pruner(_LargestMassPruner):
    """Keeps a leg whose MIMA2, which follows gravity along the arc, is at least `margin` times m0.

    Parameters, errors, source and what is said of planes as for `MimaPruner`.

    Examples
    --------
    >>> Mima2Pruner(margin=0.95).name
    'mima2'
    """

    @property
    def name(self) -> str:
        """Name in counters and reports."""
        return "mima2"

    def _largest_mass(
        self, legs: Legs, rv_dep: NDArray[np.float64], rv_arr: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        return mima2(rv_dep, rv_arr, legs.tof_s, legs.thrust, legs.exhaust_velocity, self.max_revs)
