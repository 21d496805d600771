"""`LegMaker`: the legs of GTOC5 tours, from nodes and numbers."""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from feasibility import Legs, Spacecraft
from feasibility.orbits import Catalogue
from seqsearch.problems.gtoc5.rules import Gtoc5Rules
from seqsearch.problems.gtoc5.self_fly_by import self_fly_by_delta_v
from seqsearch.problems.moves.legs_between import legs_between

_Array = NDArray[np.float64]
_Rows = NDArray[np.intp]

FLY_BY_RESERVE_M_S = 1.0
"""Fly-bys are planned this much faster than the rules ask for."""


@final
@dataclass(frozen=True, eq=False)
class LegMaker:
    """Makes launches, self-fly-bys and transfers, with n legs a call.

    Parameters
    ----------
    catalogue : Catalogue
        The bodies.
    spacecraft : Spacecraft
        Dry mass, thrust and specific impulse.
    rules : Gtoc5Rules
        Drops and speeds.
    """

    catalogue: Catalogue
    spacecraft: Spacecraft
    rules: Gtoc5Rules

    @property
    def fly_by_speed_m_s(self) -> float:
        """Relative speed of planned fly-bys."""
        return self.rules.fly_by_speed_min_m_s + FLY_BY_RESERVE_M_S

    @property
    def least_mass_at_rendezvous(self) -> float:
        """Mass in kg at a rendezvous that just suffices for both drops and a fly-by."""
        burn = float(np.exp(self_fly_by_delta_v(1.0, self.fly_by_speed_m_s) / self._exhaust))
        left = self.spacecraft.m_dry + self.rules.penetrator_kg
        return left * burn + self.rules.package_kg

    @property
    def _exhaust(self) -> float:
        return self.spacecraft.exhaust_velocity

    def mass_after_fly_by(self, mass: _Array | float, stretch: float) -> _Array:
        """Return (n,) kg, the estimate of the mass after a self-fly-by and its drop.

        Parameters
        ----------
        mass : (n,) float64, kg
            Before it.
        stretch : float
            Its time over the shortest possible.
        """
        burnt = np.exp(-self_fly_by_delta_v(stretch, self.fly_by_speed_m_s) / self._exhaust)
        after: _Array = np.asarray(mass) * burnt - self.rules.penetrator_kg
        return after

    def transfers(
        self,
        row: _Rows,
        t_mjd2000: _Array,
        velocity: _Array,
        target: _Rows,
        tof_days: _Array,
        mass: _Array,
    ) -> Legs:
        """Return the legs from bodies to rendezvous with others.

        Parameters
        ----------
        row, target : (n,) intp
            Catalogue rows of the bodies left and reached.
        t_mjd2000, tof_days : (n,) float64
            Departure epochs and flight times.
        velocity : (n, 3) float64, m/s
            At departure, relative to the body left.
        mass : (n,) float64, kg
            At departure.
        """
        return legs_between(
            self.catalogue,
            self.spacecraft,
            row,
            target,
            t_mjd2000,
            tof_days,
            mass,
            least_mass=self.least_mass_at_rendezvous,
            departure_velocity=velocity,
        )

    def self_fly_bys(
        self, row: _Rows, t_mjd2000: _Array, velocity: _Array, tof_days: _Array, mass: _Array
    ) -> Legs:
        """Return the legs from rest at bodies to fly-bys of them.

        Parameters
        ----------
        row : (n,) intp
            Catalogue rows.
        t_mjd2000, tof_days : (n,) float64
            Departure epochs and times until the fly-by.
        velocity : (n, 3) float64, m/s
            At the fly-by, relative to the body.
        mass : (n,) float64, kg
            At departure.
        """
        return legs_between(
            self.catalogue,
            self.spacecraft,
            row,
            row,
            t_mjd2000,
            tof_days,
            mass,
            least_mass=self.spacecraft.m_dry + self.rules.penetrator_kg,
            arrival_velocity=velocity,
        )
