"""Checks of the columns of `Legs`: each names the column, the first bad row and what it may be."""

from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from feasibility.constants import AU, DAY_S, MU_SUN, YEAR_DAYS
from feasibility.errors import InputError

_MIN_RADIUS_M = 0.01 * AU
_AU_SLIP_M = 1e6
_MAX_RADIUS_M = 1e4 * AU
_SLOW_FRACTION = 0.01
_VELOCITY_SLIPS = {"km/s": 1e3, "AU/day": AU / DAY_S, "AU/year": AU / (DAY_S * YEAR_DAYS)}
_KM_S_SLIPS: Final = (0.1, 20.0)
"""What excess velocities are in km/s; in m/s they would make no difference."""
_MOST_EXCESS: Final = 3e5
"""m/s: beyond it any speed is meant, or a unit is wrong."""


def check_finite(label: str, column: NDArray[np.float64]) -> None:
    """Raise InputError where a column is not finite."""
    bad = ~np.isfinite(column)
    if bad.any():
        row, *component = (int(index) for index in np.argwhere(bad)[0])
        where = f", component {component[0]}" if component else ""
        raise InputError(f"{label}, row {row}{where}: {column[row, *component]} is not finite")


def check_state(name: str, rv: NDArray[np.float64]) -> None:
    """Raise InputError where states (n, 6) are no heliocentric ones in m and m/s."""
    check_finite(f"Legs {name}", rv)
    radius = np.sqrt(np.einsum("ij,ij->i", rv[:, :3], rv[:, :3]))
    speed = np.sqrt(np.einsum("ij,ij->i", rv[:, 3:], rv[:, 3:]))
    bad_radius = (radius < _MIN_RADIUS_M) | (radius > _MAX_RADIUS_M)
    if bad_radius.any():
        row = int(np.argmax(bad_radius))
        slip = ""
        if 0 < radius[row] < _AU_SLIP_M:
            slip = "; is it in AU?"
        elif 0 < radius[row] < _MIN_RADIUS_M:
            slip = "; is it in km?"
        raise InputError(
            f"Legs {name}, row {row}: distance from the Sun {radius[row]:g} m, expected "
            f"{_MIN_RADIUS_M:.2g} to {_MAX_RADIUS_M:.2g} m{slip}"
        )
    # The local circular speed tells metres from kilometres per second at any distance.
    circular = np.sqrt(MU_SUN / radius)
    slow = speed < _SLOW_FRACTION * circular
    fast = speed > circular / _SLOW_FRACTION
    if (slow | fast).any():
        row = int(np.argmax(slow | fast))
        slip = ""
        for unit, metres_per_second in _VELOCITY_SLIPS.items():
            if 0.2 < metres_per_second * speed[row] / circular[row] < 1.5:
                slip = f"; is it in {unit}?"
        raise InputError(
            f"Legs {name}, row {row}: speed {speed[row]:g} m/s where a circular orbit has "
            f"{circular[row]:.4g} m/s{slip}"
        )


def check_excess(columns: Mapping[str, NDArray[np.float64]]) -> None:
    """Raise InputError where largest excess velocities, columns (n,), are none in m/s.

    Zero, infinity and any finite value are right, but not a largest one that looks like km/s: a
    single small value may be meant, as one of a series that begins at 0.
    """
    largest = 0.0
    for name, column in columns.items():
        bad = ~(column >= 0.0)
        if bad.any():
            row = int(np.argmax(bad))
            raise InputError(
                f"Legs {name}, row {row}: {column[row]:g} m/s, expected zero or more, or inf"
            )
        fast = (column > _MOST_EXCESS) & (column < np.inf)
        if fast.any():
            row = int(np.argmax(fast))
            raise InputError(
                f"Legs {name}, row {row}: {column[row]:g} m/s is beyond {_MOST_EXCESS:g} m/s; "
                "expected inf for any speed"
            )
        largest = max(largest, float(column[column < np.inf].max(initial=0.0)))
    low, high = _KM_S_SLIPS
    if low <= largest < high:
        name = next(name for name, column in columns.items() if (column == largest).any())
        row = int(np.argmax(columns[name] == largest))
        raise InputError(
            f"Legs {name}, row {row}: {largest:g} m/s is the largest excess velocity, expected 0, "
            f"or {high:g} m/s or more; is it in km/s?"
        )
