"""A leg to be flown with continuous thrust, and the arc that flies it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from feasibility.constants import AU, DAY_S, MU_SUN
from feasibility.errors import InputError

Motion = Callable[[float], NDArray[np.float64]]
"""The (6,) state to be in at an epoch (MJD2000), m and m/s."""


@final
@dataclass(frozen=True, eq=False)
class ContinuousLeg:
    """From a state at an epoch to a moving target, with an engine.

    Attributes
    ----------
    departure : (6,) array
        State at the departure, m and m/s.
    target : callable
        State at each epoch of arrival: that of the body, and any relative velocity.
    t_dep_mjd2000 : float
        Epoch of the departure.
    m0_kg : float
        Mass there.
    thrust_n, exhaust_velocity_m_s : float
        Full thrust, and specific impulse times standard gravity.
    mu_m3_s2 : float
        Gravitational parameter.

    Raises
    ------
    InputError
        A mass, thrust or speed is not positive, or a number is not finite.
    """

    departure: NDArray[np.float64]
    target: Motion
    t_dep_mjd2000: float
    m0_kg: float
    thrust_n: float
    exhaust_velocity_m_s: float
    mu_m3_s2: float = MU_SUN

    def __post_init__(self) -> None:
        for name in ("m0_kg", "thrust_n", "exhaust_velocity_m_s", "mu_m3_s2"):
            value = getattr(self, name)
            if not 0.0 < value < np.inf:
                raise InputError(f"leg: {name} {value:g}, expected more than 0")
        if np.shape(self.departure) != (6,) or not np.isfinite(self.departure).all():
            raise InputError("leg: departure, expected six finite numbers in m and m/s")
        if not np.isfinite(self.t_dep_mjd2000):
            raise InputError(f"leg: t_dep_mjd2000 {self.t_dep_mjd2000}, expected a number")


@final
@dataclass(frozen=True, eq=False)
class ContinuousArc:
    """An arc of segments of constant thrust, with n segments.

    Attributes
    ----------
    edges_mjd2000 : (n + 1,) array
        Epochs between which the thrust is constant.
    states : (n + 1, 6) array
        States there, m and m/s; each follows from the one before.
    mass_kg : (n + 1,) array
        Masses there.
    thrust_n : (n, 3) array
        Thrust of each segment.
    miss_km, miss_m_s : float
        Distance from the target at the arrival, and relative velocity that should not be.
    converged : bool
        Whether it meets its target.
    iterations : int
        Linearisations.
    """

    edges_mjd2000: NDArray[np.float64]
    states: NDArray[np.float64]
    mass_kg: NDArray[np.float64]
    thrust_n: NDArray[np.float64]
    miss_km: float
    miss_m_s: float
    converged: bool
    iterations: int

    @property
    def t_arr_mjd2000(self) -> float:
        """Epoch of the arrival."""
        return float(self.edges_mjd2000[-1])

    @property
    def propellant_kg(self) -> float:
        """What the thrust uses."""
        return float(self.mass_kg[0] - self.mass_kg[-1])


@final
@dataclass(frozen=True)
class Scale:
    """Units of length, time and speed in which the gravitational parameter is 1."""

    length_m: float
    time_s: float

    @classmethod
    def of(cls, mu_m3_s2: float) -> "Scale":
        """Return the units whose length is 1 AU."""
        return cls(AU, float(np.sqrt(AU**3 / mu_m3_s2)))

    @property
    def days(self) -> float:
        """The unit of time in days."""
        return self.time_s / DAY_S

    def state(self, state: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a state in these units."""
        scaled: NDArray[np.float64] = state / self._sizes
        return scaled

    def si(self, states: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return states (..., 6) in SI units."""
        plain: NDArray[np.float64] = states * self._sizes
        return plain

    @property
    def _sizes(self) -> NDArray[np.float64]:
        speed = self.length_m / self.time_s
        return np.array([*[self.length_m] * 3, *[speed] * 3])
