"""`Trajectory`: the rows of a flight (epoch, state, mass, thrust) that files to hand in hold."""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from feasibility.errors import InputError


@final
@dataclass(frozen=True, eq=False, repr=False)
class Phase:
    """From the departure at one body to the arrival at the next.

    With n the number of rows, at least two. Thrust is constant from a row to the next; between
    rows of equal epoch the velocity may jump, which is an impulse.

    Parameters
    ----------
    start, end : str
        Ids of the table as text, or names such as ``EARTH`` and ``MOTHER``.
    t_mjd2000 : array_like
        (n,) epochs, never falling.
    states : array_like
        (n, 6) m and m/s, heliocentric J2000 ecliptic.
    mass_kg : array_like
        (n,) mass.
    thrust_n : array_like
        (n, 3) N, thrust from this row to the next, in the frame of the states; zero in the last.

    Raises
    ------
    InputError
        A shape does not fit, a number is not finite, an epoch falls or the last thrust is not 0.
    """

    start: str
    end: str
    t_mjd2000: NDArray[np.float64]
    states: NDArray[np.float64]
    mass_kg: NDArray[np.float64]
    thrust_n: NDArray[np.float64]

    def __init__(
        self,
        start: str,
        end: str,
        t_mjd2000: ArrayLike,
        states: ArrayLike,
        mass_kg: ArrayLike,
        thrust_n: ArrayLike,
    ) -> None:
        label = f"phase {start} -> {end}"
        epochs = np.array(t_mjd2000, dtype=np.float64)
        if epochs.ndim != 1 or len(epochs) < 2:
            raise InputError(f"{label}: expected at least two rows, got shape {epochs.shape}")
        n = len(epochs)
        columns = {"t_mjd2000": epochs}
        for name, values, shape in (
            ("states", states, (n, 6)),
            ("mass_kg", mass_kg, (n,)),
            ("thrust_n", thrust_n, (n, 3)),
        ):
            columns[name] = np.array(values, dtype=np.float64)
            if columns[name].shape != shape:
                raise InputError(
                    f"{label}: {name} has shape {columns[name].shape}, expected {shape}"
                )
        for name, column in columns.items():
            if not np.isfinite(column).all():
                raise InputError(f"{label}: {name} has a number that is not finite")
            column.flags.writeable = False
            object.__setattr__(self, name, column)
        if (np.diff(epochs) < 0.0).any():
            row = int(np.argmax(np.diff(epochs) < 0.0)) + 1
            raise InputError(f"{label}, row {row}: the epoch falls, expected time to go on")
        if self.thrust_n[-1].any():
            raise InputError(f"{label}: thrust in the last row, expected zero at the arrival")
        object.__setattr__(self, "start", start)
        object.__setattr__(self, "end", end)

    def __len__(self) -> int:
        return len(self.t_mjd2000)

    def __repr__(self) -> str:
        return f"Phase({self.start} -> {self.end}, n={len(self)})"


@final
@dataclass(frozen=True)
class Trajectory:
    """The phases of a tour in order of time; between two of them the spacecraft stays at a body.

    Attributes
    ----------
    phases : tuple of Phase
        At least one, each beginning no earlier than the one before ends.
    continuous : bool
        Whether the thrust is continuous. Otherwise the tour's impulses stand as jumps.
    """

    phases: tuple[Phase, ...]
    continuous: bool

    def __post_init__(self) -> None:
        if not self.phases:
            raise InputError("trajectory: no phase, expected at least one")
        for before, after in zip(self.phases, self.phases[1:], strict=False):
            if after.t_mjd2000[0] < before.t_mjd2000[-1]:
                raise InputError(
                    f"trajectory: {after} begins before {before} ends, expected them in order"
                )
