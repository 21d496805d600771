"""Calendar dates beside epochs: what people write and read, in MJD and MJD2000 (TDB, as UTC)."""

import datetime
from typing import Final

from feasibility.constants import MJD2000_MJD
from feasibility.errors import InputError

_MJD_ZERO: Final = datetime.datetime(1858, 11, 17)
"""MJD 0."""

_JD_MJD: Final = 2_400_000.5
_EARLIEST_MJD: Final = 33_282.0
"""1950-01-01: missions before it are another unit."""

_LATEST_MJD: Final = 200_000.0


def date_of(t_mjd2000: float) -> str:
    """Return the calendar date of an epoch, such as ``2030-01-01``."""
    return f"{_MJD_ZERO + datetime.timedelta(days=t_mjd2000 + MJD2000_MJD):%Y-%m-%d}"


def mjd_of(value: object, label: str) -> float:
    """Return an epoch as MJD that may be a number or a date.

    Parameters
    ----------
    value : object
        MJD as a number, a date or time as TOML has them, or as a text such as
        ``"2030-01-01"`` or ``"2030-01-01T12:00"``.
    label : str
        What the messages begin with.

    Raises
    ------
    InputError
        Neither of these, or a number that is a Julian date, MJD2000 or a year.
    """
    if isinstance(value, str):
        try:
            value = datetime.datetime.fromisoformat(value)
        except ValueError:
            raise InputError(
                f"{label}: {value!r}, expected MJD or a date such as 2030-01-01"
            ) from None
    if isinstance(value, datetime.datetime):
        return (value.replace(tzinfo=None) - _MJD_ZERO) / datetime.timedelta(days=1)
    if isinstance(value, datetime.date):
        return float((value - _MJD_ZERO.date()).days)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{label}: {value!r}, expected MJD or a date such as 2030-01-01")
    mjd = float(value)
    if _EARLIEST_MJD <= mjd <= _LATEST_MJD:
        return mjd
    raise InputError(f"{label}: {mjd:.10g} is no MJD of a mission{_meant(mjd)}")


def _meant(number: float) -> str:
    """Return a question about the unit that was probably meant; empty where none fits."""
    if _EARLIEST_MJD <= number - _JD_MJD <= _LATEST_MJD:
        return f"; is it a Julian date? then MJD {number - _JD_MJD:.10g}"
    if 1950 <= number <= 2200 and number == int(number):
        first = (datetime.date(int(number), 1, 1) - _MJD_ZERO.date()).days
        return f"; is it a year? then MJD {first} ({int(number)}-01-01)"
    if _EARLIEST_MJD <= number + MJD2000_MJD <= _LATEST_MJD:
        return f"; is it MJD2000? then MJD {number + MJD2000_MJD:.10g}"
    return f", expected {_EARLIEST_MJD:g} to {_LATEST_MJD:g}"
