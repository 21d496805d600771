"""`CurveChart`: what a classifier says of all legs between near bodies, at all epochs.

m* does not depend on the mass at departure, so one chart serves spacecraft of any mass. What is
stored is 1/m*, an acceleration, and the velocity change of the Lambert arc: both are nearly the
length of a vector that changes in proportion to time, so their squares are parabolas over the
departure epoch. Between charted departures 80 days apart, linear curves of log(m*) are 5 % too
low on average, and 20 % where a leg is best; parabolas are right to 1.4 %.
"""

from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.orbits import Catalogue

_Index = NDArray[np.intp]
Codes = NDArray[np.uint16]

N_TOFS: Final = 5
N_EPOCHS: Final = 3
"""Flight times of a curve, and departures: both ends and the middle of an interval."""

SPEED_UNIT: Final = 0.2
"""m/s of a code of a velocity change."""

MAX_CODE: Final = 65535
_LEAST_M_STAR: Final = 0.375
"""Least m* that has a code of its own, in dry masses."""


def inverse_unit(m_dry: float) -> float:
    """Return the 1/kg of a code of 1/m*."""
    return 1.0 / (_LEAST_M_STAR * m_dry * MAX_CODE)


@final
@dataclass(frozen=True, eq=False)
class CurveChart:
    """Legs between n bodies.

    With k intervals of departures and p pairs.

    Attributes
    ----------
    rows : (n,) intp
        Catalogue rows, ascending.
    t0_mjd2000 : float
        Where the first interval begins.
    step_days : float
        Length of the intervals.
    tof_days : (5,) float64
        Flight times, ascending.
    inverse_unit : float, 1/kg
        Unit of `inverse`.
    offsets : (k n + 1,) int64
        Pairs of body i in interval j are those from entry j n + i on.
    target : (p,) int32
        Where they lead, as positions in `rows`.
    inverse : (p, 3, 5) uint16
        1/m* at the beginning, the middle and the end of the interval.
    speed : (p, 3, 5) uint16
        Velocity changes of Lambert arcs, in units of `SPEED_UNIT`.
    """

    rows: _Index
    t0_mjd2000: float
    step_days: float
    tof_days: NDArray[np.float64]
    inverse_unit: float
    offsets: NDArray[np.int64]
    target: NDArray[np.int32]
    inverse: Codes
    speed: Codes

    @property
    def intervals(self) -> int:
        """How many intervals of departures there are."""
        return (len(self.offsets) - 1) // len(self.rows)

    def positions(self, rows: _Index) -> _Index:
        """Return positions of catalogue rows; those that are not on the chart are left out."""
        at = np.minimum(np.searchsorted(self.rows, rows), len(self.rows) - 1)
        found: _Index = at[self.rows[at] == rows]
        return found


@final
@dataclass(frozen=True, eq=False)
class Survey:
    """What a chart is to be made of.

    Attributes
    ----------
    catalogue : Catalogue
        All bodies.
    rows : (n,) intp
        Those of the chart, ascending.
    thrust, isp, m_dry : float
        The engine (N, s) and the dry mass (kg).
    mass : float, kg
        Mass for which the predictor is asked; m* hardly depends on it.
    first_mjd2000, last_mjd2000 : float
        The departures that are charted.
    tof_days : (5,) float64
        Flight times.
    """

    catalogue: Catalogue
    rows: _Index
    thrust: float
    isp: float
    m_dry: float
    mass: float
    first_mjd2000: float
    last_mjd2000: float
    tof_days: NDArray[np.float64]

    @property
    def step_days(self) -> float:
        """Length of the intervals: a third of the longest flight."""
        return float(self.tof_days[-1]) / 3.0

    @property
    def intervals(self) -> int:
        """How many intervals of departures there are."""
        return int(np.ceil((self.last_mjd2000 - self.first_mjd2000) / self.step_days))
