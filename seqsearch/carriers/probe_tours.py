"""The tours of a crew as problem files and records: from the mother ship and back to her."""

from typing import Final

import msgspec
import numpy as np

from feasibility import InputError
from feasibility.constants import AU, MJD2000_MJD
from feasibility.orbits import Catalogue
from seqsearch.carriers.crew import TOUCH_DAYS, WAIT_DAYS, Crew
from seqsearch.carriers.flight import captures_of, releases_of
from seqsearch.polish.flight import fly
from seqsearch.polish.itinerary import Itinerary
from seqsearch.problems.extra_bodies import BodyTable
from seqsearch.problems.problem_file import Config, build_problem
from seqsearch.tours.tour import Tour

RELEASE_ID: Final = 10_000_001
CAPTURE_ID: Final = 10_000_002
"""Ids of the mother ship's orbits, which no asteroid has."""


def probe_config(config: Config, catalogue: Catalogue, crew: Crew, number: int) -> Config:
    """Return the problem file of one probe of a crew.

    Its tours start at the mother ship and end there, and leave the other probes' asteroids alone.

    Parameters
    ----------
    config : Config
        Of the whole run.
    catalogue : Catalogue
        The asteroids.
    crew : Crew
        All probes; rows are those of the catalogue.
    number : int
        Which of them, from 0.
    """
    plan = crew.plan
    others = [int(catalogue.ids[row]) for row in crew.closed(number)]
    others += [
        int(catalogue.ids[row])
        for row, probe in zip(plan.orbits, crew.waits(), strict=True)
        if probe not in (None, number)
    ]
    released = releases_of(crew)[number]
    begin, end = plan.windows_mjd2000[number]
    window = min(begin - WAIT_DAYS, released) - 1.0, max(end, released) + 1.0
    course = crew.course
    orbits = catalogue if course is None else course.catalogue_for(catalogue, plan, number)
    return msgspec.structs.replace(
        config,
        bodies=(
            _orbit(orbits, plan.first, RELEASE_ID, "mother ship at the release"),
            _orbit(orbits, plan.end(number), CAPTURE_ID, "mother ship at the capture"),
        ),
        mission=msgspec.structs.replace(
            config.mission,
            first_departure_mjd=(window[0] + MJD2000_MJD, window[1] + MJD2000_MJD),
            start_ids=(RELEASE_ID,),
            end_id=CAPTURE_ID,
        ),
        catalogue=msgspec.structs.replace(
            config.catalogue, exclude_ids=(*config.catalogue.exclude_ids, *sorted(set(others)))
        ),
        fleet=msgspec.structs.replace(config.fleet, probes=1),
    )


def probe_tour(config: Config, catalogue: Catalogue, crew: Crew, number: int) -> Tour:
    """Return the tour of one probe of a crew, flown once more, with its stays at the orbits.

    Parameters
    ----------
    config : Config
        That of `probe_config`.
    catalogue, crew, number
        As there.

    Raises
    ------
    InputError
        A leg has no solution; cannot be, as it was flown before.
    """
    problem = build_problem(config, catalogue)
    itinerary = crew.flights[number].itinerary
    ids = catalogue.ids[itinerary.rows].tolist()
    t_dep, tof = list(itinerary.t_dep_mjd2000), list(itinerary.tof_days)
    waits, end = crew.waits(), crew.plan.ends[number]
    if waits[0] == number:
        released = releases_of(crew)[number]
        ids, t_dep, tof = [RELEASE_ID, *ids], [released, *t_dep], [TOUCH_DAYS, *tof]
    else:
        ids[0] = RELEASE_ID
    if end > 0 and waits[end] == number:
        away = captures_of(crew)[number] - TOUCH_DAYS
        ids, t_dep, tof = [*ids, CAPTURE_ID], [*t_dep, away], [*tof, TOUCH_DAYS]
    else:
        ids[-1] = CAPTURE_ID
    rows = problem.catalogue.rows_of(np.asarray(ids)).astype(np.intp)
    flight = fly(problem, Itinerary(rows, np.array(t_dep), np.array(tof)))
    if flight is None:
        raise InputError(f"probe {number + 1}: a leg has no solution")
    return flight.to_tour(problem)


def _orbit(catalogue: Catalogue, row: int, body_id: int, name: str) -> BodyTable:
    a, e, i, node, argp, anomaly = (float(value) for value in catalogue.elements[row])
    return BodyTable(
        name=name,
        id=body_id,
        a_au=a / AU,
        e=e,
        i_deg=float(np.degrees(i)),
        node_deg=float(np.degrees(node)),
        argp_deg=float(np.degrees(argp)),
        mean_anomaly_deg=float(np.degrees(anomaly)),
        epoch_mjd=float(catalogue.epoch_mjd2000[row]) + MJD2000_MJD,
    )
