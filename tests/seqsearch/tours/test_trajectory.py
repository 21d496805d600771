"""Trajectories refuse rows that cannot be flown."""

import numpy as np
import pytest

from feasibility.errors import InputError
from seqsearch.tours.trajectory import Phase, Trajectory


def _phase(start: float = 0.0, n: int = 3) -> Phase:
    return Phase("1", "2", start + np.arange(n), np.ones((n, 6)), np.ones(n), np.zeros((n, 3)))


def test_arrays_cannot_be_changed() -> None:
    with pytest.raises(ValueError, match="read-only"):
        _phase().states[0, 0] = 2.0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"t_mjd2000": [0.0]}, "at least two rows"),
        ({"t_mjd2000": [0.0, 2.0, 1.0]}, "row 2: the epoch falls"),
        ({"states": np.ones((3, 5))}, r"states has shape \(3, 5\), expected \(3, 6\)"),
        ({"mass_kg": [1.0, np.nan, 1.0]}, "mass_kg has a number that is not finite"),
        ({"thrust_n": np.ones((3, 3))}, "thrust in the last row"),
    ],
)
def test_bad_rows_are_refused(changes: dict[str, object], message: str) -> None:
    good = {
        "t_mjd2000": np.arange(3.0),
        "states": np.ones((3, 6)),
        "mass_kg": np.ones(3),
        "thrust_n": np.zeros((3, 3)),
    }
    with pytest.raises(InputError, match=message):
        Phase("1", "2", **{**good, **changes})  # type: ignore[arg-type]


def test_phases_stand_in_order_of_time() -> None:
    assert len(Trajectory((_phase(0.0), _phase(2.0)), continuous=True).phases) == 2
    with pytest.raises(InputError, match="begins before"):
        Trajectory((_phase(0.0), _phase(1.0)), continuous=True)
    with pytest.raises(InputError, match="no phase"):
        Trajectory((), continuous=True)
