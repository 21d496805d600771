"""`season`: generations of scouts before a pass, as long as there is time for them."""

import time
from collections.abc import Callable
from typing import Final

import numpy as np

from seqsearch.beam.counters import RankCounters
from seqsearch.beam.scouting.pool import Pool
from seqsearch.beam.scouting.scouts import Camp
from seqsearch.settings import SearchSettings

_SCOUTS: Final = 4
"""Scouts sent out at a time; under a time limit two for each worker, if that is more."""


def season(
    camp: Camp,
    pool: Pool,
    settings: SearchSettings,
    rng: np.random.Generator,
    counters: RankCounters,
    *,
    seconds: float | None,
    workers: int,
    over: Callable[[], bool],
) -> Pool:
    """Send out one generation of scouts after the other and return the pool they filled.

    Parameters
    ----------
    camp : Camp
        Sends them out.
    pool : Pool
        What is known.
    settings : SearchSettings
        `scout_generations`, and what the camp needs.
    rng : numpy.random.Generator
        Draws where they go.
    counters : RankCounters
        What they did is added.
    seconds : float or None
        How long, at least one generation; None for `scout_generations` of them.
    workers : int
        Processes that work for the camp; what is found depends on them under a time
        limit only.
    over : callable
        Tells that no further generation shall be begun.
    """
    began = time.monotonic()
    scouts = _SCOUTS if seconds is None else max(_SCOUTS, 2 * workers)
    generations, slowest_s = 0, 0.0
    while not over():
        spent_s = time.monotonic() - began
        if seconds is not None and generations and spent_s + slowest_s > seconds:
            break
        if seconds is None and generations == settings.scout_generations:
            break
        pool = camp.generation(pool, settings, scouts, rng, counters)
        generations += 1
        slowest_s = max(slowest_s, time.monotonic() - began - spent_s)
    counters.count_pruned({"predictor": counters.proposed - counters.nodes})
    counters.seconds = time.monotonic() - began
    return pool
