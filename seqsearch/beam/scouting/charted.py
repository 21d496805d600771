"""Scouting over a chart: under a long time limit, beams that look everything up.

The chart is made once, before the third pass. Each pass from then on sends beams to all slices of
the departure window, retimes the most promising tours, and puts those that keep the rules into the
tree.
"""

import functools
import pickle
import time
from collections.abc import Iterator
from concurrent.futures import Executor
from dataclasses import replace
from typing import Any, Final, final

import numpy as np

from feasibility.classifier.predictor import LegPredictor
from feasibility.runtime.cluster import shared
from feasibility.runtime.workers import in_threads
from seqsearch.beam.best_tour import Best
from seqsearch.beam.counters import RankCounters
from seqsearch.beam.scouting.generations import Scouting
from seqsearch.beam.state import SearchState
from seqsearch.budget import Budget
from seqsearch.chart.curves import N_TOFS, Survey
from seqsearch.chart.making import legs_of, make_chart
from seqsearch.chart.roaming import Roaming, RoamingOrder, RoamingTour
from seqsearch.core.ending import ending_of
from seqsearch.core.nodes import Nodes
from seqsearch.polish.flight import Flight
from seqsearch.polish.itinerary import Itinerary
from seqsearch.polish.retiming import retime
from seqsearch.problems.rendezvous import RendezvousProblem
from seqsearch.settings import SearchSettings

_FIRST_PASS: Final = 3
"""The passes before give a first answer, as under a short limit."""

_LEG_S: Final = 3e-6
_SHARE: Final = 0.5
"""What it takes to chart a leg, with one thread, and the largest share of the time left for it."""

_FEWEST: Final = 1000
_MOST_LEGS: Final = 3e8
"""Bodies below which nothing is charted, and legs above which: the chart takes three bytes and a
half for each."""

_SHORTEST: Final = 1.5
"""Shortest flight time of curves, in units of `tof_days_min`."""

_SLICE_DAYS: Final = 40.0
_EPOCHS: Final = 4
_WIDTH: Final = 2500
_WIDEST: Final = 10_000
_WEIGHTS: Final = (0.08, 0.35)
"""Beams: a slice of the departure window and the departures in it, widths of the first round and
of later ones, and between which weights of propellant they differ. On GTOC7 a beam of 8000 finds
the same tours as one of 2000; other weights and departures do more."""

_ROUND_S: Final = 150.0
_RESERVE_S: Final = 30.0
"""Longest time that a round of beams takes, and what is left at the end for retiming."""

_LENGTHS: Final = 2
_RETIMED: Final = 8
_ALIKE: Final = 0.5
_PER_NICHE: Final = 2
"""Tours that are retimed after a round: of how many lengths, how many of each, and most of one
niche, which have more than this share of their bodies in common."""

_FLOWN: Final = 4
"""Itineraries that the pass after a round keeps to."""


def chart_fits(
    problem: RendezvousProblem, settings: SearchSettings, budget: Budget, threads: int
) -> bool:
    """Tell whether there is time for a chart, and whether beams over one find its tours.

    They start at any body that counts, and end anywhere.
    """
    remaining_s = budget.deadline.remaining_s()
    if remaining_s is None:
        return False
    if ending_of(problem) is not None or problem.sequence or problem.unscored_ids:
        return False
    survey = survey_of(problem, settings)
    legs = legs_of(survey)
    enough = _LEG_S * legs <= _SHARE * remaining_s * threads
    return enough and len(survey.rows) >= _FEWEST and legs <= _MOST_LEGS


def survey_of(problem: RendezvousProblem, settings: SearchSettings) -> Survey:
    """Return what the chart of a problem is to be made of."""
    craft = problem.spacecraft
    rows = np.setdiff1d(np.arange(len(problem.catalogue)), problem.rows_to_avoid)
    shortest = min(_SHORTEST * settings.tof_days_min, 0.5 * settings.tof_days_max)
    first, last = problem.first_departure_mjd2000
    return Survey(
        catalogue=problem.catalogue,
        rows=rows,
        thrust=float(craft.thrust),
        isp=float(craft.isp),
        m_dry=float(craft.m_dry),
        mass=float(np.sqrt(problem.m0 * craft.m_dry)),
        first_mjd2000=first,
        last_mjd2000=last + problem.max_duration_days,
        tof_days=np.geomspace(shortest, settings.tof_days_max, N_TOFS),
    )


@final
class ChartedPasses:
    """Looks for tours on a chart before the passes from the third on; a `Scouting`.

    Parameters
    ----------
    inner : Scouting
        Scouts before the passes until then, and where the chart's beams find nothing.
    problem : RendezvousProblem
        What to solve.
    predictor : LegPredictor
        Is asked about the legs of the chart.
    settings : SearchSettings
        Flight times.
    best : Best
        Looks at the flights that keep the rules.
    budget : Budget
        With a time limit.
    executor : concurrent.futures.Executor, optional
        Where tours are retimed; default: here.
    threads : int
        Threads of this process that make the chart and run its beams.
    """

    active = True

    def __init__(
        self,
        inner: Scouting,
        problem: RendezvousProblem,
        predictor: LegPredictor,
        settings: SearchSettings,
        *,
        best: Best,
        budget: Budget,
        executor: Executor | None,
        threads: int,
    ) -> None:
        self._inner = inner
        self._problem, self._predictor, self._settings = problem, predictor, settings
        self._best, self._budget = best, budget
        self._executor, self._threads = executor, threads
        self._common: Any = executor and shared(executor, pickle.dumps(problem))
        self._roaming: Roaming | None = None
        self._rounds = 0
        self._retimed: set[tuple[int, ...]] = set()

    def guide(self, state: SearchState, rng: np.random.Generator) -> bool:
        """Look for tours on the chart, put those that were flown into the tree; else scout."""
        if state.pass_number < _FIRST_PASS:
            return self._inner.guide(state, rng)
        counters = RankCounters(pass_number=state.pass_number, rank=0)
        began = time.monotonic()
        if self._roaming is None:
            self._roaming = self._charted()
        if self._roaming is None:
            return self._inner.guide(state, rng)
        tours = self._roamed(self._roaming, rng)
        ends = [
            self._planted(flight, state) for flight in self._flown(self._promising(tours, state))
        ]
        counters.nodes, counters.kept = len(tours), len(ends)
        counters.seconds = time.monotonic() - began
        if not ends:
            return self._inner.guide(state, rng)
        state.counters.append(counters)
        found = Nodes.concatenate(ends)
        order = np.lexsort((found.t_arr_mjd2000 - found.t_first_mjd2000, -found.depth))
        state.guide = found.take(order[:_FLOWN])
        return True

    def _charted(self) -> Roaming | None:
        """Return beams over a chart; None where there is no time for it."""
        problem = self._problem
        if not chart_fits(problem, self._settings, self._budget, self._threads):
            return None
        chart = make_chart(
            survey_of(problem, self._settings),
            self._predictor,
            threads=self._threads,
            goes_on=lambda: not self._budget.used_up(),
        )
        return None if chart is None else Roaming(chart, problem)

    def _roamed(self, roaming: Roaming, rng: np.random.Generator) -> list[RoamingTour]:
        """Return what beams in all slices of the window found, in as many as there was time for.

        Later rounds are wider, with other weights and departures.
        """
        first, last = self._problem.first_departure_mjd2000
        slices = max(1, round((last - first) / _SLICE_DAYS))
        days = (last - first) / slices
        shift = days * rng.random() / _EPOCHS
        low, high = np.log(_WEIGHTS)
        weights = np.exp(rng.uniform(float(low), float(high), slices))
        orders = [
            RoamingOrder(
                begin_mjd2000=float(first + k * days + shift),
                days=days,
                epochs=_EPOCHS,
                width=min(_WIDTH * 2**self._rounds, _WIDEST),
                propellant_weight=float(weights[k]),
            )
            for k in rng.permutation(slices)
        ]
        self._rounds += 1
        began = time.monotonic()

        def run(order: RoamingOrder) -> list[RoamingTour]:
            late = time.monotonic() - began > _ROUND_S
            remaining_s = self._budget.deadline.remaining_s()
            if late or (remaining_s is not None and remaining_s < _RESERVE_S):
                return []
            return roaming.run(order)

        return [tour for found in in_threads(run, orders, self._threads) for tour in found]

    def _promising(self, tours: list[RoamingTour], state: SearchState) -> list[Itinerary]:
        """Return the tours that are worth retiming: the longest in visits, then the shortest.

        None that was retimed before, and few that are nearly the same.
        """
        lengths = {len(tour.itinerary) for tour in tours}
        wanted = sorted((k for k in lengths if k >= state.best_key[0]), reverse=True)
        chosen = []
        for length in wanted[:_LENGTHS]:
            alike = [tour for tour in tours if len(tour.itinerary) == length]
            niches: list[frozenset[int]] = []
            for tour in sorted(alike, key=lambda tour: tour.itinerary.duration_days):
                if len(niches) == _RETIMED:
                    break
                bodies = tour.bodies
                key = tuple(tour.itinerary.rows.tolist())
                crowd = sum(len(bodies & other) > _ALIKE * len(bodies) for other in niches)
                if key in self._retimed or crowd >= _PER_NICHE:
                    continue
                self._retimed.add(key)
                niches.append(bodies)
                chosen.append(tour.itinerary)
        return chosen

    def _flown(self, itineraries: list[Itinerary]) -> Iterator[Flight]:
        """Yield itineraries with their best timetables, those that keep the rules."""
        if self._executor is None:
            found = (_retimed(self._problem, itinerary) for itinerary in itineraries)
        else:
            submit, common = self._executor.submit, self._common
            futures = [submit(_retimed_there, common, one) for one in itineraries]
            found = (future.result() for future in futures)
        for flight in found:
            if flight is not None and flight.keeps_rules(self._problem):
                yield flight

    def _planted(self, flight: Flight, state: SearchState) -> Nodes:
        """Put a flight into the tree and return its end."""
        problem, itinerary = self._problem, flight.itinerary
        node = flight.planted(problem, state.tree)
        start = problem.start_nodes(itinerary.rows[-1:], itinerary.t_dep_mjd2000[:1])
        arrival = itinerary.t_arr_mjd2000[-1:]
        end = replace(
            start,
            depth=np.array([len(itinerary)]),
            t_ready_mjd2000=arrival + problem.min_stay_days,
            t_arr_mjd2000=arrival,
            mass=flight.mass[-1:],
            visited=itinerary.rows[None],
            tree_id=np.array([node]),
        )
        self._best.note(end, state)
        return end


def _retimed(problem: RendezvousProblem, itinerary: Itinerary) -> Flight | None:
    found = retime(problem, itinerary)
    return None if found is None else found.flight


@functools.lru_cache(maxsize=1)
def _unpacked(problem: bytes) -> RendezvousProblem:
    unpacked = pickle.loads(problem)
    assert isinstance(unpacked, RendezvousProblem)
    return unpacked


def _retimed_there(problem: bytes, itinerary: Itinerary) -> Flight | None:
    return _retimed(_unpacked(problem), itinerary)
