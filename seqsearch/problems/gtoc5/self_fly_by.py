"""The self-fly-by in closed form: away from a body and back past it, without gravity.

With acceleration a = thrust / mass and the wanted relative speed u, the
spacecraft thrusts against the direction of the fly-by, coasts, and thrusts
along it. The shortest one has no coast and takes (1 + sqrt 2) u / a, all of it
at full thrust ("GTOC5: results from the European Space Agency and University of
Florence", Acta Futura 8 (2014) 45, doi 10.2420/AF08.2014.45, linear
acceleration model). A longer one needs less propellant: 15 % more time saves
30 %. Gravity along the relative motion changes the time by -20 to +50 % at
4000 kg and 0.3 N near 1 AU, hardly at all below 1000 kg.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from feasibility.constants import DAY_S

_FACTOR: Final = 1.0 + np.sqrt(2.0)


def shortest_self_fly_by_days(
    mass_kg: NDArray[np.float64] | float, speed_m_s: float, thrust_n: float
) -> NDArray[np.float64]:
    """Return the shortest time of a self-fly-by in days, (n,) or one as `mass_kg`.

    Parameters
    ----------
    mass_kg : (n,) float64 or float
        Mass, constant in this model.
    speed_m_s : float
        Relative speed at the fly-by.
    thrust_n : float
        Thrust.
    """
    days: NDArray[np.float64] = np.asarray(mass_kg) * (_FACTOR * speed_m_s / thrust_n / DAY_S)
    return days


def self_fly_by_delta_v(
    stretch: NDArray[np.float64] | float, speed_m_s: float
) -> NDArray[np.float64]:
    """Return the velocity change in m/s of a self-fly-by that takes longer than the shortest.

    With s = u / a, thrust against the fly-by for t1, a coast, and thrust along
    it for t1 + s close the path if the whole time is t1 + s + s^2 / (2 t1).

    Parameters
    ----------
    stretch : (n,) float64 or float
        Time over the shortest time; below 1 counts as 1.
    speed_m_s : float
        Relative speed at the fly-by.
    """
    beyond = np.maximum(np.asarray(stretch), 1.0) * _FACTOR - 1.0
    # Rounding may make the root of the shortest one negative.
    first = (beyond - np.sqrt(np.maximum(beyond**2 - 2.0, 0.0))) / 2.0
    delta_v: NDArray[np.float64] = speed_m_s * (1.0 + 2.0 * first)
    return delta_v
