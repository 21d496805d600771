"""When the legs of a tour may begin and end once some are late."""

from dataclasses import dataclass
from itertools import pairwise
from typing import final

import numpy as np

from feasibility.constants import MJD2000_MJD
from feasibility.continuous import file_epoch
from seqsearch.tours.tour import Tour


def not_before(t_mjd2000: float) -> float:
    """Return the first epoch that files can hold and that is no earlier."""
    epoch = float(file_epoch(t_mjd2000))
    return epoch if epoch >= t_mjd2000 else _beside(epoch, np.inf)


def not_after(t_mjd2000: float) -> float:
    """Return the last epoch that files can hold and that is no later."""
    epoch = float(file_epoch(t_mjd2000))
    return epoch if epoch <= t_mjd2000 else _beside(epoch, -np.inf)


def _beside(t_mjd2000: float, towards: float) -> float:
    return float(np.nextafter(t_mjd2000 + MJD2000_MJD, towards) - MJD2000_MJD)


@final
@dataclass(frozen=True)
class Timetable:
    """The times of a tour and the room around them.

    Attributes
    ----------
    departures, arrivals : tuple of float
        As the tour has them, in epochs that files can hold.
    stays : tuple of float
        Shortest time from each arrival to the next departure.
    fly_bys : tuple of bool
        Whether each leg but the last ends with a fly-by, after which there is no stay.
    latest : float
        Latest end of the tour.
    """

    departures: tuple[float, ...]
    arrivals: tuple[float, ...]
    stays: tuple[float, ...]
    fly_bys: tuple[bool, ...]
    latest: float

    @classmethod
    def of(cls, tour: Tour) -> "Timetable":
        """Return the timetable of a tour."""
        legs, rules = tour.legs, tour.rules
        fly_bys = tuple(leg.is_fly_by for leg in legs[:-1])
        stays = tuple(0.0 if leg.is_fly_by else rules.min_stay_days for leg in legs[:-1])
        departures = [float(file_epoch(legs[0].t_dep_mjd2000))]
        for (leg, following), stay in zip(pairwise(legs), stays, strict=True):
            arrival = float(file_epoch(leg.t_arr_mjd2000))
            departures.append(_departure(following.t_dep_mjd2000, arrival, stay))
        latest = not_after(departures[0] + max(rules.max_duration_days, tour.duration_days))
        arrivals = [float(file_epoch(leg.t_arr_mjd2000)) for leg in legs]
        arrivals[-1] = min(arrivals[-1], latest)
        return cls(tuple(departures), tuple(arrivals), stays, fly_bys, latest)

    def departure(self, k: int, arrival_before: float | None) -> float:
        """Return when leg k departs after the one before it has arrived.

        As in the tour where that can be; after a fly-by at once.
        """
        if arrival_before is None:
            return self.departures[k]
        if self.fly_bys[k - 1]:
            return arrival_before
        return _departure(self.departures[k], arrival_before, self.stays[k - 1])

    def latest_arrival(self, k: int) -> float:
        """Return by when leg k has to arrive so that the tour can end in time.

        Later legs keep their flight times and shorten the stays to what is allowed.
        """
        flights = sum(
            self.arrivals[j] - self.departures[j] for j in range(k + 1, len(self.departures))
        )
        return not_after(self.latest - flights - sum(self.stays[k:]))


def _departure(wished: float, arrival: float, stay: float) -> float:
    """Return the departure as wished, or as soon as the stay is long enough."""
    departure = not_before(max(wished, arrival + stay))
    # Rounding must not take anything off a stay, as files tell it.
    while (departure + MJD2000_MJD) - (arrival + MJD2000_MJD) < stay:
        departure = _beside(departure, np.inf)
    return departure
