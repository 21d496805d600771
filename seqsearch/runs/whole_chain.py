"""A sequence with a fixed end, retimed as a whole: whether it fits, and what it lacks."""

from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np

from feasibility.classifier.predictor import LegPredictor
from seqsearch.core.ending import Ending
from seqsearch.core.problem import Problem
from seqsearch.polish.flight import Flight
from seqsearch.polish.itinerary import Itinerary
from seqsearch.polish.retiming import SAFETY, retime
from seqsearch.tours.tour import Tour

_TOFS_DAYS: Final = np.geomspace(50.0, 350.0, 30)
"""Flight times that are looked at for a leg that the search did not reach."""

_ITERATIONS: Final = 80
_ATTEMPTS: Final = 2


@final
@dataclass(frozen=True, eq=False)
class WholeChain:
    """A sequence flown to its end, whether it fits into the mission or not.

    Attributes
    ----------
    tour : Tour or None
        The tour, where it keeps the rules.
    lacks : str
        What it lacks otherwise.
    """

    tour: Tour | None
    lacks: str = ""


def whole_chain(
    problem: Problem,
    ending: Ending,
    tour: Tour,
    sequence: tuple[int, ...],
    predictor: LegPredictor,
) -> WholeChain:
    """Fly a sequence and the leg to its end, from what a search has reached of it.

    Legs that it has not reached begin with what the predictor thinks of them, and all epochs
    are then improved together.

    Parameters
    ----------
    problem : Problem
        The problem of the sequence.
    ending : Ending
        Where it ends.
    tour : Tour
        What is flown so far.
    sequence : tuple of int
        Ids in order; the start, if that has no score, and the end may be missing.
    predictor : LegPredictor
        Proposes flight times.
    """
    catalogue = problem.catalogue
    rows = catalogue.rows_of(sequence).astype(np.intp)
    starts = problem.start_rows()
    if rows[0] not in starts:
        rows = np.insert(rows, 0, starts[0])
    if rows[-1] == ending.row:
        rows = rows[:-1]
    base, mass = _flown_part(problem, tour, len(rows))
    while base is None or len(base.rows) < len(rows):
        base = _lengthened(problem, base, rows, mass, predictor)
        mass = max(0.9 * mass, problem.spacecraft.m_dry)
    itinerary = base.ended(problem, ending, predictor, mass)
    lacks = "a leg without a solution at all epochs that were tried"
    # Begun anew where the first attempt ended, retiming forgets models of timetables far away.
    for _ in range(_ATTEMPTS):
        retimed = retime(problem, itinerary, max_iterations=_ITERATIONS)
        if retimed is None:
            break
        if retimed.flight.keeps_rules(problem):
            return WholeChain(retimed.flight.to_tour(problem))
        itinerary, lacks = retimed.flight.itinerary, _lacks(problem, retimed.flight)
    return WholeChain(None, lacks)


def _flown_part(problem: Problem, tour: Tour, count: int) -> tuple[Itinerary | None, float]:
    """Return what is flown of a sequence, without the leg to its end, and the mass then."""
    if not tour.legs:
        return None, problem.m0
    base = Itinerary.from_tour(problem, tour)
    if (
        len(base.rows) > count
        or base.rows[-1] == base.rows[0]
        or tour.rules.end_id == tour.bodies[-1].id
    ):
        base = base.part(0, len(base.rows) - 2)
    if len(base) == 0:
        return None, problem.m0
    return base, tour.legs[len(base) - 1].m_final_kg


def _lengthened(
    problem: Problem,
    base: Itinerary | None,
    rows: np.ndarray[tuple[int], np.dtype[np.intp]],
    mass: float,
    predictor: LegPredictor,
) -> Itinerary:
    """Return an itinerary with one more leg: the shortest flyable, or that of the best margin."""
    if base is None:
        departure = float(np.mean(problem.first_departure_mjd2000))
        pair = rows[:2]
    else:
        departure = float(base.t_arr_mjd2000[-1]) + problem.min_stay_days
        pair = rows[len(base.rows) - 1 : len(base.rows) + 1]
    n = len(_TOFS_DAYS)
    start = problem.start_nodes(pair[:1], np.array([departure]))
    node = replace(start, mass=np.array([mass]))
    target = np.full(n, pair[1], dtype=np.intp)
    parent = np.zeros(n, dtype=np.intp)
    hops = problem.hops(node, parent, target, np.full(n, departure), _TOFS_DAYS)
    margin = np.nan_to_num(predictor.margin(hops.legs[-1]), nan=0.0)
    best = int(np.argmax(margin >= 1.0)) if (margin >= 1.0).any() else int(np.argmax(margin))
    tof = float(_TOFS_DAYS[best])
    if base is None:
        return Itinerary(pair, np.array([departure]), np.array([tof]))
    return base.appended(int(pair[1]), departure, tof)


def _lacks(problem: Problem, flight: Flight) -> str:
    """Return in words what a timetable lacks: time, propellant, thrust on single legs."""
    itinerary = flight.itinerary
    ids = problem.catalogue.ids[itinerary.rows]
    days = itinerary.duration_days - problem.max_duration_days
    short = problem.spacecraft.m_dry - float(flight.mass[-1])
    parts = [
        f"{itinerary.duration_days:.1f} days instead of {problem.max_duration_days:.1f}"
        if days > 0.0
        else "",
        f"{short:.1f} kg of propellant short" if short > 0.0 else "",
    ]
    excess = flight.mass[:-1] / flight.m_star - 1.0
    parts += [
        f"leg {k + 1}, {ids[k]} -> {ids[k + 1]}, is {100.0 * excess[k]:.2f} % too heavy"
        for k in np.flatnonzero(excess > SAFETY)
    ]
    return ", ".join(part for part in parts if part) or "rules that no timetable keeps"
