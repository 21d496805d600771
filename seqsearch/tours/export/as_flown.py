"""`as_flown`: a tour with the epochs and masses of the rows that fly it."""

import msgspec

from seqsearch.tours.export.protocol import Flight
from seqsearch.tours.tour import Tour


def as_flown(flight: Flight) -> Tour:
    """Return a flight's tour, its legs with the epochs and masses of their rows.

    Refined legs may arrive later than impulses did, and with another mass. Impulses and maximum
    initial masses are those of the tour. Without continuous thrust that is the tour itself.
    """
    tour, phases = flight.tour, flight.trajectory.phases
    if not flight.trajectory.continuous or len(phases) != len(tour.legs):
        return tour
    legs = tuple(
        msgspec.structs.replace(
            leg,
            t_dep_mjd2000=float(phase.t_mjd2000[0]),
            tof_days=float(phase.t_mjd2000[-1] - phase.t_mjd2000[0]),
            m0_kg=float(phase.mass_kg[0]),
            m_final_kg=float(phase.mass_kg[-1]),
        )
        for leg, phase in zip(tour.legs, phases, strict=True)
    )
    return msgspec.structs.replace(tour, legs=legs, t_start_mjd2000=legs[0].t_dep_mjd2000)
