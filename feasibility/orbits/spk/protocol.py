"""`Ephemeris`: where bodies are at any epoch, however that is known."""

from typing import Protocol, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray


class Ephemeris(Protocol):
    """Positions and velocities of bodies, heliocentric J2000 ecliptic.

    `feasibility.orbits.Catalogue` moves its bodies on Kepler orbits;
    `feasibility.orbits.spk.KernelTable` moves them as kernels say, and a catalogue that has one
    asks it.
    """

    def states_at(self, rows: ArrayLike, t_mjd2000: ArrayLike, /) -> NDArray[np.float64]:
        """Return the states of chosen bodies, each at its own epoch.

        Parameters
        ----------
        rows : array_like
            (k,) rows, repeats allowed.
        t_mjd2000 : array_like
            (k,) epochs.

        Returns
        -------
        NDArray
            (k, 6) float64, m and m/s.
        """
        ...

    def select(self, rows: ArrayLike, /) -> Self:
        """Return the ephemeris of some of the bodies, in the order of the rows."""
        ...
