"""Scouting before a pass: generations of scouts, as long as there is time for them."""

import time
from typing import Final, Protocol, final

import numpy as np

from seqsearch.beam.counters import RankCounters
from seqsearch.beam.pacing import Pacing
from seqsearch.beam.scouting.pool import Pool
from seqsearch.beam.scouting.scouts import Scouts
from seqsearch.beam.state import SearchState
from seqsearch.budget import Budget
from seqsearch.settings import SearchSettings

_SCOUTS: Final = 4
"""Scouts sent out at a time; under a time limit two for each worker, if that is more."""

_ITINERARIES: Final = 150
"""Itineraries that a pass optimises, where scouts found as many."""


class Scouting(Protocol):
    """Looks for itineraries before a pass.

    Attributes
    ----------
    active : bool
        Whether there are scouts at all.
    """

    @property
    def active(self) -> bool: ...  # noqa: D102

    def guide(self, state: SearchState, rng: np.random.Generator) -> bool:
        """Put itineraries to which the next pass keeps into the state; False where none are."""
        ...


@final
class NoScouting:
    """Leaves all passes free; a `Scouting`."""

    active = False

    def guide(self, state: SearchState, rng: np.random.Generator) -> bool:  # noqa: ARG002
        """Return False."""
        return False


@final
class ScoutedPasses:
    """Sends scouts out before each pass; a `Scouting`.

    Parameters
    ----------
    scouts : Scouts
        What is sent out.
    pacing : Pacing
        How long they may take.
    budget : Budget
        No further generation is begun once it is used up.
    workers : int
        Processes that work for the scouts.
    """

    active = True

    def __init__(self, scouts: Scouts, pacing: Pacing, budget: Budget, workers: int) -> None:
        self._scouts = scouts
        self._pacing = pacing
        self._budget = budget
        self._workers = workers

    def guide(self, state: SearchState, rng: np.random.Generator) -> bool:
        """Look for itineraries, of which the pass optimises the best that were not flown yet."""
        counters = RankCounters(pass_number=state.pass_number, rank=0)
        pool = run_generations(
            self._scouts,
            state.pool,
            state.settings,
            rng,
            counters,
            seconds=self._pacing.scouting_s(state.settings),
            workers=self._workers,
            budget=self._budget,
        )
        state.pool, guide = pool.unflown(_ITINERARIES)
        state.guide = guide if len(guide) else None
        counters.kept = len(guide)
        state.counters.append(counters)
        return state.guide is not None


def run_generations(
    scouts: Scouts,
    pool: Pool,
    settings: SearchSettings,
    rng: np.random.Generator,
    counters: RankCounters,
    *,
    seconds: float | None,
    workers: int,
    budget: Budget,
) -> Pool:
    """Send out one generation of scouts after the other and return the pool they filled.

    Parameters
    ----------
    scouts : Scouts
        Sends them out.
    pool : Pool
        What is known.
    settings : SearchSettings
        How many generations, and what the scouts need.
    rng : numpy.random.Generator
        Draws where they go.
    counters : RankCounters
        What they did is added.
    seconds : float or None
        How long, at least one generation; None for ``settings.scouts.generations`` of them.
    workers : int
        Processes that work for the scouts; what is found depends on them under a time
        limit only.
    budget : Budget
        No further generation is begun once it is used up.
    """
    began = time.monotonic()
    count = _SCOUTS if seconds is None else max(_SCOUTS, 2 * workers)
    generations, slowest_s = 0, 0.0
    while not budget.used_up():
        spent_s = time.monotonic() - began
        if seconds is not None and generations and spent_s + slowest_s > seconds:
            break
        if seconds is None and generations == settings.scouts.generations:
            break
        pool = scouts.generation(pool, settings, count, rng, counters)
        generations += 1
        slowest_s = max(slowest_s, time.monotonic() - began - spent_s)
    counters.count_pruned({"predictor": counters.proposed - counters.nodes})
    counters.seconds = time.monotonic() - began
    return pool
