"""`Outlook`: what a tour may come to from where it is, phases left out."""

from dataclasses import dataclass
from functools import cached_property
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility import Spacecraft
from feasibility.constants import DAY_S
from feasibility.orbits import Catalogue
from seqsearch.problems.gtoc2.delta_v import delta_v_to_go, transfer_delta_v
from seqsearch.problems.gtoc2.group_sets import GroupSets

_Array = NDArray[np.float64]
_Rows = NDArray[np.intp]

_DUTY: Final = 0.9
"""Share of the flight times of good tours in which the engine burns."""

_YEAR_DAYS: Final = 365.25


@final
@dataclass(frozen=True, eq=False)
class Outlook:
    """Forecasts the score from the velocity changes between orbits.

    Parameters
    ----------
    catalogue : Catalogue
        The bodies.
    groups : GroupSets
        Their groups.
    spacecraft : Spacecraft
        Thrust and specific impulse.
    stay_days : float
        Stay at each body but the last.
    """

    catalogue: Catalogue
    groups: GroupSets
    spacecraft: Spacecraft
    stay_days: float

    @cached_property
    def delta_v(self) -> _Array:
        """(n, n) m/s, see `transfer_delta_v`."""
        return transfer_delta_v(self.catalogue)

    @cached_property
    def _to_go(self) -> _Array:
        return delta_v_to_go(self.delta_v, self.groups)

    @cached_property
    def kg_per_day(self) -> float:
        """What the engine burns at full thrust."""
        return self.spacecraft.thrust / self.spacecraft.exhaust_velocity * DAY_S

    def burn_days(self, mass: _Array | float, delta_v: _Array) -> _Array:
        """Return the days at full thrust that velocity changes take; shapes broadcast."""
        burnt = mass * -np.expm1(-delta_v / self.spacecraft.exhaust_velocity)
        days: _Array = burnt / self.kg_per_day
        return days

    def score(self, row: _Rows, left: _Rows, elapsed_days: _Array, mass: _Array) -> _Array:
        """Return (m,) kg/year, forecast for tours; the score itself where no group is left.

        Parameters
        ----------
        row : (m,) intp
            Catalogue rows of the bodies at which the tours have arrived.
        left : (m,) intp
            Sets of groups that are still to be visited.
        elapsed_days : (m,) float64
            From the launch to the arrival.
        mass : (m,) float64, kg
            At the arrival.
        """
        burning = self.burn_days(mass, self._to_go[left, row])
        days = elapsed_days + self.stay_days * self.groups.sizes[left] + burning / _DUTY
        rate: _Array = (mass - burning * self.kg_per_day) / days * _YEAR_DAYS
        return rate
