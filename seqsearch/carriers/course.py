"""`Course`: a mother ship's impulses between her first orbit and the end, in full.

A crew without one has all probes released at rest at the first orbit's asteroid and caught at rest
at those of the orbits that follow. On a course she coasts from impulse to impulse, and each probe
leaves from one of these coasts and comes back to one.
"""

from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.constants import MU_SUN
from feasibility.orbits import Catalogue
from feasibility.orbits.classical import cartesian_to_classical
from seqsearch.carriers.plans import Plan
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
    settled : tuple of int
        The coasts on the orbits after the first one.
    starts, ends : tuple of int
        For each probe the coast from which it is released, and that on which it is caught.
    stays : tuple
        The probes that stay at the asteroids of all orbits; None for none.
    stay_epochs : tuple of float
        When the first of them is released there, and the others are caught, MJD2000. Their stays
        may be longer than they have to be.
    route : Route, optional
        To the first orbit; default: that of the plan.
    """

    impulses: tuple[CarrierImpulse, ...]
    settled: tuple[int, ...]
    starts: tuple[int, ...]
    ends: tuple[int, ...]
    stays: tuple[int | None, ...]
    stay_epochs: tuple[float, ...]
    route: Route | None = None

    def coast_at(self, orbit: int) -> int:
        """Return the coast on an orbit, by its number in the plan."""
        return (0, *self.settled)[orbit]

    def window(self, coast: int) -> tuple[float, float]:
        """Return the epochs between which she is on a coast."""
        epochs = [impulse.t_mjd2000 for impulse in self.impulses]
        return ([_EPOCH, *epochs][coast], [*epochs, -_EPOCH][coast])

    def states(self, catalogue: Catalogue, plan: Plan) -> tuple[_Array, _Array]:
        """Return where she is after each impulse.

        Parameters
        ----------
        catalogue : Catalogue
            The asteroids.
        plan : Plan
            Her orbits.

        Returns
        -------
        epochs : (k,) float64
            MJD2000, one an impulse.
        states : (k, 6) float64, m and m/s
            Just after it; on an orbit of the plan exactly those of its asteroid.
        """
        epochs = np.array([impulse.t_mjd2000 for impulse in self.impulses])
        states = np.empty((len(epochs), 6))
        at = dict(zip(self.settled, plan.orbits[1:], strict=True))
        for k, impulse in enumerate(self.impulses):
            if k + 1 in at:
                states[k] = catalogue.states_at([at[k + 1]], epochs[k])[0]
                continue
            if k == 0:
                states[0] = catalogue.states_at([plan.first], epochs[0])[0]
            else:
                days = epochs[k : k + 1] - epochs[k - 1]
                states[k] = coasted(states[k - 1 : k], days, MU_SUN)[0]
            states[k, 3:] += impulse.dv_m_s
        return epochs, states

    def catalogue_for(self, catalogue: Catalogue, plan: Plan, number: int) -> Catalogue:
        """Return the asteroids with two rows moved to where one probe leaves and ends.

        So a tour from the first row to that of the probe's end is that probe's tour.
        """
        epochs, states = self.states(catalogue, plan)
        elements, at = catalogue.elements.copy(), catalogue.epoch_mjd2000.copy()
        start, end = self.starts[number], self.ends[number]
        for row, coast, orbit in (
            (plan.first, start, 0),
            (plan.end(number), end, plan.ends[number]),
        ):
            if coast != self.coast_at(orbit):
                elements[row] = cartesian_to_classical(states[coast - 1], MU_SUN)
                at[row] = epochs[coast - 1]
        return Catalogue(catalogue.ids, catalogue.names, at, elements, catalogue.source)
