"""`Mima2Pruner`: the initial mass against MIMA2."""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from feasibility.errors import InputError
from feasibility.legs import Legs
from feasibility.orbits.mima import mima2


@final
@dataclass(frozen=True)
class Mima2Pruner:
    """Keeps a leg whose MIMA2 is at least `margin` times its initial mass.

    Parameters
    ----------
    margin : float
        Least ratio of MIMA2, on the best Lambert branch, to the initial mass.
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
    >>> Mima2Pruner(margin=0.95).name
    'mima2'
    """

    margin: float = 1.0
    max_revs: int = 2

    def __post_init__(self) -> None:
        if not self.margin > 0:
            raise InputError(f"Mima2Pruner margin: {self.margin}, expected more than zero")
        if self.max_revs < 0:
            raise InputError(f"Mima2Pruner max_revs: {self.max_revs}, expected zero or more")

    @property
    def name(self) -> str:
        """Name in counters and reports."""
        return "mima2"

    def keep(self, legs: Legs, /) -> NDArray[np.bool_]:
        """Return (n,) bool, True where the leg survives."""
        mass = mima2(
            legs.rv_dep, legs.rv_arr, legs.tof_s, legs.thrust, legs.exhaust_velocity, self.max_revs
        )
        return mass >= self.margin * legs.m0
