"""Retiming: the best timetable of a fixed sequence of bodies, all epochs and stays together.

A bundle method. Each leg's m* and propellant are modelled by the tangents at
the last few timetables (their lower envelope, as both are nearly concave in
time), the timetable that is best in the model within a trust region is found
by linear programming, and the leg solver judges it. Mass that is missing and
legs that are too heavy are allowed at a price, so a sequence that does not fit
into the mission yet has a least duration too.
"""

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog
from scipy.sparse import coo_array

from seqsearch.core.problem import Problem
from seqsearch.polish.flight import Flight, Tangents, fly, tangents
from seqsearch.polish.itinerary import Itinerary

_Array = NDArray[np.float64]

SAFETY: Final = 2e-4
"""By how much log(m*) has to exceed log(m0): the solver's own reproducibility."""

OVERLOAD_DAYS: Final = 2000.0
"""Price of an overload of one (in the logarithm of mass): 1 % costs 20 days, which is
several times what the flight time has to grow to fly it."""

SHORTFALL_DAYS_PER_KG: Final = 5.0
"""Price of missing propellant: several times what saving it costs."""

_TRUST_DAYS: Final = 6.0
_SMALLEST_TRUST_DAYS: Final = 0.05
_LARGEST_TRUST_DAYS: Final = 25.0
_EPOCH_TRUST: Final = 3.0
"""Epochs may move this many times as far as flight times: they add up along the tour."""

_REMEMBERED: Final = 8
"""Timetables whose tangents are kept."""

_SPARE_KG: Final = 0.1
"""Propellant that is to be left, so that rounding cannot leave too little."""

_SMALL_DEBT_DAYS: Final = 30.0
"""Merit beyond the duration that is worth an attempt to settle it."""

_SHORTEST_TOF_DAYS: Final = 10.0


@final
@dataclass(frozen=True, eq=False)
class Retimed:
    """A flight and its merit.

    Attributes
    ----------
    flight : Flight
        The best that was found.
    merit_days : float
        Its duration, plus the price of overload and missing propellant.
    iterations : int
        Timetables that were flown.
    """

    flight: Flight
    merit_days: float
    iterations: int


def merit_days(problem: Problem, flight: Flight) -> float:
    """Return the duration of a flight plus the price of what it lacks."""
    shortfall = max(0.0, problem.spacecraft.m_dry + _SPARE_KG - float(flight.mass[-1]))
    return (
        flight.itinerary.duration_days
        + OVERLOAD_DAYS * flight.overload(SAFETY)
        + SHORTFALL_DAYS_PER_KG * shortfall
    )


def retime(
    problem: Problem,
    itinerary: Itinerary,
    *,
    max_iterations: int = 40,
    tolerance_days: float = 0.05,
) -> Retimed | None:
    """Find the timetable of least merit near a given one.

    Parameters
    ----------
    problem : Problem
        Window, stays, masses.
    itinerary : Itinerary
        Sequence, and the timetable to begin with; one leg or more.
    max_iterations : int
        Timetables that are flown at most.
    tolerance_days : float
        Stop where the model promises no more than this.

    Returns
    -------
    Retimed or None
        None if a leg of the given timetable has no solution.
    """
    flight = fly(problem, _with_stays(problem, itinerary))
    if flight is None:
        return None
    merit = merit_days(problem, flight)
    current = tangents(problem, flight)
    models = deque([current], maxlen=_REMEMBERED)
    trust = _TRUST_DAYS
    iterations = 1
    while iterations < max_iterations and trust > _SMALLEST_TRUST_DAYS:
        step = _best_in_model(problem, flight, current, models, trust)
        if step is None or merit - step[1] < tolerance_days:
            break
        promised = merit - step[1]
        trial = fly(problem, step[0])
        iterations += 1
        if trial is None:
            trust /= 4.0
            continue
        trial_merit = merit_days(problem, trial)
        kept = (merit - trial_merit) / promised
        models.append(tangents(problem, trial))
        if kept > 0.02:
            flight, merit, current = trial, trial_merit, models[-1]
        if kept > 0.7:
            trust = min(2.0 * trust, _LARGEST_TRUST_DAYS)
        elif kept < 0.2:
            trust /= 2.0
    settled = _settle(problem, flight, current, models)
    if settled is not None:
        flight, merit = settled, merit_days(problem, settled)
    return Retimed(flight, merit, iterations)


def _settle(
    problem: Problem, flight: Flight, current: Tangents, models: Iterable[Tangents]
) -> Flight | None:
    """Buy the last grams and per milles that a timetable lacks; None if it lacks nothing, or much.

    A price leaves small debts, as the model is not exact: aim a little higher.
    """
    debt = merit_days(problem, flight) - flight.itinerary.duration_days
    if _owes_nothing(problem, flight) or debt > _SMALL_DEBT_DAYS:
        return None
    for factor in (4.0, 16.0, 64.0):
        step = _best_in_model(problem, flight, current, models, 1.0, factor)
        trial = None if step is None else fly(problem, step[0])
        if trial is not None and _owes_nothing(problem, trial):
            return trial
    return None


def _owes_nothing(problem: Problem, flight: Flight) -> bool:
    return flight.overload(0.0) == 0.0 and bool(flight.mass[-1] >= problem.spacecraft.m_dry)


def _with_stays(problem: Problem, itinerary: Itinerary) -> Itinerary:
    """Delay departures until every stay is long enough and the first is in the window."""
    t = itinerary.t_dep_mjd2000.copy()
    t += np.clip(t[0], *problem.first_departure_mjd2000) - t[0]
    for k in range(1, len(t)):
        t[k] = max(t[k], t[k - 1] + itinerary.tof_days[k - 1] + problem.min_stay_days)
    return replace(itinerary, t_dep_mjd2000=t)


@final
class _Program:
    """A linear program that grows by blocks of rows; variables are named by their columns."""

    def __init__(self, n: int) -> None:
        self.t = np.arange(n)
        self.tof = n + self.t
        self.w = 2 * n + np.arange(n + 1)
        self.heavy = 3 * n + 1 + np.arange(n + 1)
        self.overload = 4 * n + 2 + self.t
        self.shortfall = 5 * n + 2
        self.size = 5 * n + 3
        self._values: list[_Array] = []
        self._rows: list[NDArray[np.intp]] = []
        self._columns: list[NDArray[np.intp]] = []
        self._bounds: list[_Array] = []
        self._n_rows = 0

    def at_most(self, terms: list[tuple[NDArray[np.intp], _Array | float]], bound: _Array) -> None:
        """Add the rows sum of coefficient * variable <= bound, one for each entry of `bound`."""
        rows = self._n_rows + np.arange(len(bound))
        for columns, coefficients in terms:
            self._rows.append(rows)
            self._columns.append(columns)
            self._values.append(np.broadcast_to(coefficients, len(rows)))
        self._bounds.append(bound)
        self._n_rows += len(bound)

    def minimise(self, cost: _Array, low: _Array, high: _Array) -> tuple[_Array, float] | None:
        """Return the solution and its cost; None if there is none."""
        where = (np.concatenate(self._rows), np.concatenate(self._columns))
        matrix = coo_array((np.concatenate(self._values), where), (self._n_rows, self.size))
        found = linprog(
            cost,
            A_ub=matrix.tocsr(),
            b_ub=np.concatenate(self._bounds),
            bounds=np.column_stack([low, high]),
            method="highs",
        )
        return (found.x, float(found.fun)) if found.status == 0 else None


def _best_in_model(
    problem: Problem,
    flight: Flight,
    current: Tangents,
    models: Iterable[Tangents],
    trust: float,
    caution: float = 1.0,
) -> tuple[Itinerary, float] | None:
    """Return the timetable of least merit in the model, and that merit.

    `caution` multiplies the safety of the margins and the propellant to spare.
    Unknowns are changes of epochs t, flight times T and w = log mass; the
    overload of each leg; the missing share of propellant. The masses by the
    lower envelope bound the final mass; were they to bound the loads as well,
    the program would throw propellant away to become lighter. The loads go by
    the masses of the newest tangents alone, which no choice can lower.
    """
    base = flight.itinerary
    n = len(base)
    program = _Program(n)
    w = np.log(flight.mass)
    for side in (1.0, -1.0):
        program.at_most(
            [
                (program.heavy[1:], side),
                (program.heavy[:-1], side * (-1.0 - current.fraction_w)),
                (program.t, -side * current.fraction_t),
                (program.tof, -side * current.fraction_tof),
            ],
            np.zeros(n),
        )
    for model in models:
        dt, dtof, dw = base.t_dep_mjd2000 - model.t, base.tof_days - model.tof, w[:-1] - model.w
        # A tangent of a function that is not concave may pass below the function: lift it.
        log_m_star = np.maximum(
            model.log_m_star + model.m_star_t * dt + model.m_star_tof * dtof,
            np.log(flight.m_star),
        )
        log_fraction = np.maximum(
            model.log_fraction
            + model.fraction_t * dt
            + model.fraction_tof * dtof
            + model.fraction_w * dw,
            flight.log_fraction,
        )
        program.at_most(
            [
                (program.heavy[:-1], 1.0),
                (program.t, -model.m_star_t),
                (program.tof, -model.m_star_tof),
                (program.overload, -1.0),
            ],
            log_m_star - caution * SAFETY - w[:-1],
        )
        program.at_most(
            [
                (program.w[1:], 1.0),
                (program.w[:-1], -1.0 - model.fraction_w),
                (program.t, -model.fraction_t),
                (program.tof, -model.fraction_tof),
            ],
            log_fraction - flight.log_fraction,
        )
    program.at_most(
        [(program.t[:-1], 1.0), (program.tof[:-1], 1.0), (program.t[1:], -1.0)],
        base.t_dep_mjd2000[1:] - base.t_arr_mjd2000[:-1] - problem.min_stay_days,
    )
    program.at_most(
        [(program.w[-1:], -1.0), (np.array([program.shortfall]), -1.0)],
        w[-1:] - np.log(problem.spacecraft.m_dry + caution * _SPARE_KG),
    )
    cost = np.zeros(program.size)
    cost[[program.t[-1], program.tof[-1]]] += 1.0
    cost[program.t[0]] -= 1.0
    cost[program.overload] = OVERLOAD_DAYS
    cost[program.shortfall] = SHORTFALL_DAYS_PER_KG * problem.spacecraft.m_dry
    low, high = np.full(program.size, -np.inf), np.full(program.size, np.inf)
    low[program.t], high[program.t] = -_EPOCH_TRUST * trust, _EPOCH_TRUST * trust
    low[program.tof], high[program.tof] = (
        np.minimum(np.maximum(-trust, _SHORTEST_TOF_DAYS - base.tof_days), 0.0),
        trust,
    )
    earliest, latest = problem.first_departure_mjd2000
    low[0] = max(low[0], earliest - base.t_dep_mjd2000[0])
    high[0] = min(high[0], latest - base.t_dep_mjd2000[0])
    low[program.w[0]] = high[program.w[0]] = 0.0
    low[program.heavy[0]] = high[program.heavy[0]] = 0.0
    low[program.overload] = low[program.shortfall] = 0.0
    found = program.minimise(cost, low, high)
    if found is None:
        return None
    x, value = found
    moved = replace(
        base,
        t_dep_mjd2000=base.t_dep_mjd2000 + x[program.t],
        tof_days=base.tof_days + x[program.tof],
    )
    return _with_stays(problem, moved), base.duration_days + value
