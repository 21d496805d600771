"""`Flight`: an itinerary flown by the leg solver, leg after leg, and how it bends when retimed."""

from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility import Legs, LegSolutions, optimise
from feasibility.sims_flanagan import solve_max_initial_mass
from seqsearch.core.ending import ending_of
from seqsearch.core.problem import Problem
from seqsearch.core.recording import record_tour
from seqsearch.core.tree import FlownLeg, SearchTree, with_excess
from seqsearch.polish.itinerary import Itinerary
from seqsearch.tours.records import LARGEST_M_STAR_KG
from seqsearch.tours.tour import Tour

_Array = NDArray[np.float64]

_LIGHTEST_SHARE: Final = 1.0 - 1e-6
"""A leg that is too heavy is flown with this share of m*, and the excess counts as overload."""

_STEP_DAYS: Final = 0.3
"""Step of the difference quotients: m* changes by about 0.3 %, far above solver tolerance."""

_STEP_LOAD: Final = 0.99
"""Factor on the mass for the difference quotient with respect to it."""


@final
@dataclass(frozen=True, eq=False)
class Flight:
    """An itinerary with its masses. With n the number of legs.

    A leg that is too heavy (mass above m*) is flown as if it were as heavy as
    can be, with the same share of propellant: so that a timetable that does not
    hold yet can be judged and improved. `overload` says by how much.

    Attributes
    ----------
    itinerary : Itinerary
        n legs.
    m_star : (n,) float64, kg
        Maximum initial masses, as tour files have them.
    mass : (n + 1,) float64, kg
        Mass at each departure and, last, after the last arrival.
    heaviest : LegSolutions
        The n maximum-initial-mass solutions.
    solutions : LegSolutions
        The n minimum-propellant solutions.
    """

    itinerary: Itinerary
    m_star: _Array
    mass: _Array
    heaviest: LegSolutions
    solutions: LegSolutions

    @property
    def load(self) -> _Array:
        """(n,) share of m* at which each leg was solved."""
        return np.minimum(self.mass[:-1] / self.m_star, _LIGHTEST_SHARE)

    @property
    def log_fraction(self) -> _Array:
        """(n,) logarithm of final over initial mass of each leg."""
        return np.log(self.mass[1:] / self.mass[:-1])

    def overload(self, safety: float) -> float:
        """Return the sum over legs of how much log(mass) exceeds log(m*) - safety."""
        return float(np.maximum(np.log(self.mass[:-1] / self.m_star) + safety, 0.0).sum())

    def keeps_rules(self, problem: Problem) -> bool:
        """Tell whether every leg can be flown and all rules of the problem hold."""
        itinerary = self.itinerary
        stays = itinerary.t_dep_mjd2000[1:] - itinerary.t_arr_mjd2000[:-1]
        earliest, latest = problem.first_departure_mjd2000
        ending = ending_of(problem)
        if ending is not None and not ending.is_complete(itinerary.rows):
            return False
        return bool(
            (self.mass[:-1] <= self.m_star).all()
            and self.mass[-1] >= problem.spacecraft.m_dry
            and (stays >= problem.min_stay_days - 1e-9).all()
            and earliest <= itinerary.t_dep_mjd2000[0] <= latest
            and itinerary.duration_days <= problem.max_duration_days
        )

    def to_tour(self, problem: Problem) -> Tour:
        """Return the tour; the flight has to keep the rules."""
        tree = SearchTree()
        return record_tour(problem, tree, self.planted(problem, tree))

    def planted(self, problem: Problem, tree: SearchTree) -> int:
        """Add the flight to a search tree and return its last node; it has to keep the rules."""
        itinerary = self.itinerary
        legs = itinerary.legs(problem, problem.m0)
        node = tree.add_start(
            int(itinerary.rows[0]), float(itinerary.t_dep_mjd2000[0]), problem.m0
        )
        for k in range(len(itinerary)):
            leg = FlownLeg(
                dep_row=int(itinerary.rows[k]),
                arr_row=int(itinerary.rows[k + 1]),
                rv_dep=with_excess(legs.rv_dep[k], self.solutions.dep_excess[k]),
                rv_arr=with_excess(legs.rv_arr[k], self.solutions.arr_excess[k]),
                t_dep_mjd2000=float(itinerary.t_dep_mjd2000[k]),
                tof_days=float(itinerary.tof_days[k]),
                m0=float(self.mass[k]),
                m_final=float(self.mass[k + 1]),
                m_star=float(self.m_star[k]),
                dropped=0.0,
                throttles=self.solutions.throttles[k],
                mismatch=float(self.solutions.mismatch[k]),
            )
            node = tree.add_hop(node, (leg,))
        return node


@final
@dataclass(frozen=True, eq=False)
class Tangents:
    """First-order models of all legs about one flight. With n the number of legs.

    With t the departure epochs and T the flight times in days and w = log(mass
    at departure in kg):

        log m*(t, T)           ~ log_m_star + m_star_t dt + m_star_tof dT
        log(m_final/m)(t,T,w)  ~ log_fraction + fraction_t dt + fraction_tof dT + fraction_w dw
    """

    t: _Array
    tof: _Array
    w: _Array
    log_m_star: _Array
    m_star_t: _Array
    m_star_tof: _Array
    log_fraction: _Array
    fraction_t: _Array
    fraction_tof: _Array
    fraction_w: _Array


def fly(problem: Problem, itinerary: Itinerary) -> Flight | None:
    """Solve all legs with the mass that the legs before left; None where a leg has no solution."""
    legs = itinerary.legs(problem, problem.m0)
    heaviest = solve_max_initial_mass(legs)
    if not heaviest.converged.all():
        return None
    mass = np.empty(len(legs) + 1)
    mass[0] = problem.m0
    solutions = []
    for k in range(len(legs)):
        share = min(mass[k] / heaviest.m0[k], _LIGHTEST_SHARE)
        # Exactly the mass of the chain where the leg can be flown.
        m0 = mass[k] if share < _LIGHTEST_SHARE else share * heaviest.m0[k]
        one = np.array([k])
        solution = optimise(legs.take(one).with_m0([m0]), guess=heaviest.take(one))
        if not solution.converged[0]:
            return None
        mass[k + 1] = mass[k] * (solution.m_final[0] / m0)
        if m0 == mass[k]:
            mass[k + 1] = solution.m_final[0]
        solutions.append(solution)
    m_star = np.minimum(heaviest.m0, LARGEST_M_STAR_KG)
    return Flight(itinerary, m_star, mass, heaviest, LegSolutions.concatenate(solutions))


def tangents(problem: Problem, flight: Flight) -> Tangents:
    """Return the models of all legs by difference quotients on the leg solver.

    The mass enters through its share of m* only, and the quotients keep that
    share: so a leg stays flyable whichever way it is shifted. A leg whose
    shifted copies are not solved counts as constant.
    """
    base = flight.itinerary
    n = len(base)
    later = replace(base, t_dep_mjd2000=base.t_dep_mjd2000 + _STEP_DAYS)
    longer = replace(base, tof_days=base.tof_days + _STEP_DAYS)
    moved = Legs.concatenate([later.legs(problem, problem.m0), longer.legs(problem, problem.m0)])
    heaviest = solve_max_initial_mass(moved)
    load = flight.load
    largest = np.minimum(heaviest.m0, LARGEST_M_STAR_KG)
    m_star = np.where(heaviest.converged, largest, problem.m0)
    legs = Legs.concatenate([moved, base.legs(problem, problem.m0)]).with_m0(
        np.concatenate([m_star[:n] * load, m_star[n:] * load, flight.m_star * load * _STEP_LOAD])
    )
    solved = optimise(legs, guess=LegSolutions.concatenate([heaviest, flight.heaviest]))
    good = solved.converged.reshape(3, n).all(axis=0)
    safe_final = np.where(solved.converged, solved.m_final, legs.m0)
    change = np.log(safe_final / legs.m0).reshape(3, n) - flight.log_fraction
    m_star_change = np.log(m_star.reshape(2, n) / flight.m_star) / _STEP_DAYS
    at_t, at_tof = np.where(good, m_star_change, 0.0)
    by_t, by_tof = np.where(good, change[:2] / _STEP_DAYS, 0.0)
    by_load = np.where(good, change[2] / np.log(_STEP_LOAD), 0.0)
    return Tangents(
        t=base.t_dep_mjd2000,
        tof=base.tof_days,
        w=np.log(flight.mass[:-1]),
        log_m_star=np.log(flight.m_star),
        m_star_t=at_t,
        m_star_tof=at_tof,
        log_fraction=flight.log_fraction,
        # log(load) = w - log m*(t, T)
        fraction_t=by_t - by_load * at_t,
        fraction_tof=by_tof - by_load * at_tof,
        fraction_w=by_load,
    )
