"""`LambertPruner`: the two-impulse delta-v against what the engine can give."""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from feasibility.constants import MU_SUN
from feasibility.errors import InputError
from feasibility.legs import Legs
from feasibility.orbits.lambert import lambert_delta_v
from feasibility.orbits.transfer_plane import in_line, levelled_targets


@final
@dataclass(frozen=True)
class LambertPruner:
    """Keeps a leg whose cheapest Lambert arc is within the engine's means.

    The engine at full thrust for the whole time of flight gives
    v_e ln(m0 / (m0 - F T / v_e)) (Tsiolkovsky's equation), and without limit
    where it would burn all of m0. A leg survives where the sum of both impulses
    on its best Lambert branch is at most `factor` times that, and where the
    propellant for this sum leaves at least the dry mass.

    Arcs go round as the departure orbit does, be it prograde or retrograde. Where the plane
    through both positions misleads (exactly at 0 or 180 degrees, or within 10 degrees of
    them and tilted by more than 30), the target is turned into the plane of the departure
    orbit, and the turn out of it costs nothing: such legs are rather kept. So are those exactly
    at 0 degrees, of which Lambert's arcs say nothing.

    Free ends: the excess velocities take over what they can of each impulse, and the arc of which
    least is left counts. Near a coasted departure orbit, after a whole number of turns, Lambert's
    arcs say little of fly-bys, and flyable ones are lost.

    Parameters
    ----------
    factor : float
        Largest ratio of Lambert delta-v to available delta-v. Impulses cost less
        than low thrust on short legs, so 1 is generous there; within some 10 degrees
        of 0 and 180, where Lambert's plane is tilted against the orbits, they cost
        more, and legs that can be flown are lost at any factor near 1.
    max_revs : int
        Largest number of complete revolutions of a Lambert arc.

    Raises
    ------
    InputError
        `factor` is not positive, or `max_revs` is negative.

    Examples
    --------
    >>> LambertPruner(factor=0.8).name
    'lambert'
    """

    factor: float = 1.0
    max_revs: int = 2

    def __post_init__(self) -> None:
        if not self.factor > 0:
            raise InputError(f"LambertPruner factor: {self.factor}, expected more than zero")
        if self.max_revs < 0:
            raise InputError(f"LambertPruner max_revs: {self.max_revs}, expected zero or more")

    @property
    def name(self) -> str:
        """Name in counters and reports."""
        return "lambert"

    def keep(self, legs: Legs, /) -> NDArray[np.bool_]:
        """Return (n,) bool, True where the leg survives."""
        rv_arr = levelled_targets(legs.rv_dep, legs.rv_arr, legs.tof_s, MU_SUN)
        needed = lambert_delta_v(
            legs.rv_dep,
            rv_arr,
            legs.tof_s,
            self.max_revs,
            vinf_dep=legs.vinf_dep,
            vinf_arr=legs.vinf_arr,
        )
        burnt = legs.thrust * legs.tof_s / (legs.exhaust_velocity * legs.m0)
        available = np.full(len(legs), np.inf)
        limited = burnt < 1.0
        available[limited] = -legs.exhaust_velocity[limited] * np.log1p(-burnt[limited])
        final_mass = legs.m0 * np.exp(-needed / legs.exhaust_velocity)
        # Where no arc exists the need is infinite, and so may be the supply.
        within = np.isfinite(needed) & (needed <= self.factor * available)
        return (within & (final_mass >= legs.m_dry)) | in_line(legs.rv_dep, legs.rv_arr)
