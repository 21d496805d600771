"""Physical constants and unit conversions, all SI.

The values are those of the GTOC problem statements (GTOC2 to GTOC12 use the
same ones), not pykep's newer IAU values, so that published tables and tours
are reproduced to the last digit.
"""

from typing import Final

AU: Final = 1.49597870691e11
"""Astronomical unit in metres (GTOC7 problem statement, table of constants)."""

MU_SUN: Final = 1.32712440018e20
"""Gravitational parameter of the Sun in m3/s2 (GTOC7 problem statement)."""

G0: Final = 9.80665
"""Standard gravity in m/s2 (GTOC7 problem statement): exhaust velocity = isp * G0."""

DAY_S: Final = 86400.0
"""Seconds in a day."""

YEAR_DAYS: Final = 365.25
"""Days in a Julian year (GTOC7 problem statement)."""

MJD2000_MJD: Final = 51544.0
"""MJD of the MJD2000 zero point, 2000-01-01 00:00: MJD2000 = MJD - 51544."""

EARTH_VELOCITY: Final = (MU_SUN / AU) ** 0.5
"""Circular heliocentric speed at 1 AU in m/s: the velocity unit of scaled problems."""


def mjd_to_mjd2000(mjd: float) -> float:
    """Convert a modified Julian date to MJD2000 (days since 2000-01-01 00:00)."""
    return mjd - MJD2000_MJD
