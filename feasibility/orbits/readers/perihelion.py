"""Ellipses given by their perihelion, as those of comets are."""

import datetime
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from feasibility.constants import AU, DAY_S, MU_SUN

_DEGREES_PER_DAY: Final = float(np.degrees(np.sqrt(MU_SUN / AU**3) * DAY_S))
"""Mean motion at 1 AU."""
_MJD_OF_DAY_0: Final = -678_576


def a_of(q_au: ArrayLike, e: ArrayLike) -> NDArray[np.float64]:
    """Return the semi-major axis in AU, NaN for an orbit that is no ellipse."""
    eccentricity = np.asarray(e, dtype=np.float64)
    bound = np.where(eccentricity < 1.0, eccentricity, np.nan)
    result: NDArray[np.float64] = np.asarray(q_au, dtype=np.float64) / (1.0 - bound)
    return result


def mean_anomaly_of(
    tp_mjd: ArrayLike, epoch_mjd: ArrayLike, a_au: ArrayLike
) -> NDArray[np.float64]:
    """Return the mean anomaly in degrees, 0 to 360, of a body at its perihelion at `tp_mjd`."""
    days = np.asarray(epoch_mjd, dtype=np.float64) - np.asarray(tp_mjd, dtype=np.float64)
    axis = np.asarray(a_au, dtype=np.float64)
    axis = np.where(axis > 0.0, axis, np.nan)
    result: NDArray[np.float64] = np.mod(_DEGREES_PER_DAY / axis**1.5 * days, 360.0)
    return result


def mjd_of_calendar(date: float) -> float:
    """Return a date written as 19860205.89532 as MJD, NaN for none."""
    day, fraction = divmod(date, 1.0)
    year, month_day = divmod(int(day), 10_000)
    try:
        whole = datetime.date(year, month_day // 100, month_day % 100)
    except ValueError:
        return float("nan")
    return whole.toordinal() + _MJD_OF_DAY_0 + fraction
