"""`Course`: a mother ship's impulses between her first orbit and the end, in full.

A crew without one has all probes released at rest at the first orbit's asteroid and caught at rest
at the second one's. On a course she coasts from impulse to impulse, and each probe leaves from one
of these coasts and comes back to one.
"""

from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.constants import MU_SUN
from feasibility.orbits import Catalogue
from feasibility.orbits.classical import cartesian_to_classical
from seqsearch.carriers.routes import Route
from seqsearch.tours.carrier.path import coasted
from seqsearch.tours.carrier.records import CarrierImpulse

_Array = NDArray[np.float64]

_EPOCH: Final = -1e9
"""Epoch of what has no beginning, in MJD2000; the same with the other sign for no end."""


@final
@dataclass(frozen=True)
class Course:
    """Impulses after the way to the first orbit, and which coasts serve which probe.

    Coast 0 is the first orbit, coast k follows on the kth impulse.

    Attributes
    ----------
    impulses : tuple of CarrierImpulse
        In order of time.
    settled : int
        The coast on the second orbit.
    starts, ends : tuple of int
        For each probe the coast from which it is released, and that on which it is caught.
    stays : tuple
        The probes that stay at the asteroids of the first and the second orbit; None for none.
    stay_epochs : tuple of float
        When the first of them is released there, and the second one caught, MJD2000. Their stays
        may be longer than they have to be.
    route : Route, optional
        To the first orbit; default: that of the plan.
    """

    impulses: tuple[CarrierImpulse, ...]
    settled: int
    starts: tuple[int, ...]
    ends: tuple[int, ...]
    stays: tuple[int | None, int | None]
    stay_epochs: tuple[float, float] = (0.0, 0.0)
    route: Route | None = None

    def window(self, coast: int) -> tuple[float, float]:
        """Return the epochs between which she is on a coast."""
        epochs = [impulse.t_mjd2000 for impulse in self.impulses]
        return ([_EPOCH, *epochs][coast], [*epochs, -_EPOCH][coast])

    def states(self, catalogue: Catalogue, first: int, second: int) -> tuple[_Array, _Array]:
        """Return where she is after each impulse.

        Parameters
        ----------
        catalogue : Catalogue
            The asteroids.
        first, second : int
            Rows of those of both orbits.

        Returns
        -------
        epochs : (k,) float64
            MJD2000, one an impulse.
        states : (k, 6) float64, m and m/s
            Just after it; on the second orbit exactly those of its asteroid.
        """
        epochs = np.array([impulse.t_mjd2000 for impulse in self.impulses])
        states = np.empty((len(epochs), 6))
        for k, impulse in enumerate(self.impulses):
            if k == 0:
                states[0] = catalogue.states_at([first], epochs[0])[0]
            else:
                days = epochs[k : k + 1] - epochs[k - 1]
                states[k] = coasted(states[k - 1 : k], days, MU_SUN)[0]
            states[k, 3:] += impulse.dv_m_s
            if k + 1 == self.settled:
                states[k] = catalogue.states_at([second], epochs[k])[0]
        return epochs, states

    def catalogue_for(
        self, catalogue: Catalogue, first: int, second: int, number: int
    ) -> Catalogue:
        """Return the asteroids with both orbits' rows moved to where one probe leaves and ends.

        So a tour from the first row to the second one is that probe's tour.
        """
        epochs, states = self.states(catalogue, first, second)
        elements, at = catalogue.elements.copy(), catalogue.epoch_mjd2000.copy()
        start, end = self.starts[number], self.ends[number]
        for row, coast, asteroid in ((first, start, 0), (second, end, self.settled)):
            if coast != asteroid:
                elements[row] = cartesian_to_classical(states[coast - 1], MU_SUN)
                at[row] = epochs[coast - 1]
        return Catalogue(catalogue.ids, catalogue.names, at, elements, catalogue.source)
