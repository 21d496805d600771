"""Epochs as files write them: calendar texts, seconds past J2000."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from feasibility.constants import DAY_S

_J2000_MJD2000: Final = 0.5
"""2000-01-01 12:00 TDB."""

TDB_UTC_S: Final = 69.184
"""TDB less UTC with the leap seconds known since 2017; later ones nobody knows."""


def seconds_past_j2000(t_mjd2000: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return TDB seconds past J2000, which SPICE calls ephemeris time."""
    return (t_mjd2000 - _J2000_MJD2000) * DAY_S


def calendar(t_mjd2000: NDArray[np.float64]) -> list[str]:
    """Return epochs as ``2030-01-01T12:00:00.000000``, rounded to microseconds."""
    day = np.floor(t_mjd2000)
    microseconds = np.round((t_mjd2000 - day) * DAY_S * 1e6).astype(np.int64)
    stamps = (
        np.datetime64("2000-01-01", "us")
        + day.astype(np.int64) * np.timedelta64(1, "D")
        + microseconds.astype("timedelta64[us]")
    )
    return [str(stamp) for stamp in np.datetime_as_string(stamps)]
