"""The result of a run as plain data, for other programs."""

from pathlib import Path
from typing import Any

from seqsearch.runs.fleet import is_fleet, probe_paths
from seqsearch.runs.run_folder import SEQUENCE
from seqsearch.tours.dates import date_of
from seqsearch.tours.tour import Tour
from seqsearch.tours.tour_files import read_tour


def summary(folder: Path) -> dict[str, Any]:
    """Return what is in a run folder: its tour, or those of a fleet.

    Raises
    ------
    InputError
        A tour cannot be read.
    """
    paths = probe_paths(folder) if is_fleet(folder) else [folder / SEQUENCE]
    tours = [read_tour(path) for path in paths]
    return {
        "folder": str(folder),
        "asteroids": sum(tour.n_asteroids for tour in tours),
        "tours": [tour_summary(tour) for tour in tours],
    }


def tour_summary(tour: Tour) -> dict[str, Any]:
    """Return the figures of one tour."""
    return {
        "problem": tour.rules.name,
        "score": tour.score,
        "asteroids": tour.n_asteroids,
        "ids": [body.id for body in tour.bodies],
        "start_date": date_of(tour.t_start_mjd2000),
        "duration_days": tour.duration_days,
        "m_final_kg": tour.m_final_kg,
        "legs": [
            {
                "from_id": leg.from_id,
                "to_id": leg.to_id,
                "t_dep_mjd2000": leg.t_dep_mjd2000,
                "tof_days": leg.tof_days,
                "m0_kg": leg.m0_kg,
                "m_final_kg": leg.m_final_kg,
                "margin": leg.margin,
            }
            for leg in tour.legs
        ],
    }
