"""`Scouts`: beams of predicted legs, side by side, and the pool of what they found.

Part of the scouts explores: each a slice of the departure window, as niches found in one beam
for the whole window crowd each other out. The others are sent near itineraries of the pool,
starting some days or some bodies away from them.
"""

import functools
import pickle
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Any, Final, final

import numpy as np

from feasibility.classifier.predictor import LegPredictor
from feasibility.orbits import OrbitalNeighbours
from feasibility.runtime.cluster import shared
from seqsearch.beam.counters import RankCounters
from seqsearch.beam.endings.make import make_ends
from seqsearch.beam.forecast import Forecast
from seqsearch.beam.rankings.balanced import BalancedRanking
from seqsearch.beam.rankings.protocol import Ranking
from seqsearch.beam.scouting.pool import Pool
from seqsearch.beam.scouting.regions import starts_near, window_part
from seqsearch.beam.scouting.scout import Scouted, scout
from seqsearch.beam.starts import dense_starts
from seqsearch.core.ending import ending_of
from seqsearch.core.nodes import Nodes
from seqsearch.core.problem import Problem
from seqsearch.settings import SearchSettings

_SLICE_DAYS: Final = 300.0
"""About the length of the part of the departure window that one scout explores."""

_SLICE_EPOCHS: Final = 6
"""Epochs at which a slice is looked at."""

_MOST_EPOCHS: Final = 60
"""The same where tours start at one body and have to end somewhere."""

_EXPLORING: Final = 0.4
"""Share of the scouts that explore."""

_NICHES: Final = 8
"""As long as the pool has fewer niches than this, all scouts explore."""

_WEIGHT_SPREAD: Final = 0.4
"""Scouts weigh propellant differently: standard deviation of the logarithm of the weight. On GTOC7
near one and the same itinerary weights of 0.2 to 0.35 led to 15 asteroids, 0.4 to 0.6 to 14."""

_STARTS: Final = 2
"""Starts of a scout, in units of the beam width. They are not screened by the predictor, as the
beam's first rank does that: with 300 screened starts scouts ended later than with 600 others."""


@final
@dataclass(frozen=True)
class _Order:
    """What one scout is told: its seed, and a part of the window or an itinerary.

    `times_picked` is how often the niche of that itinerary was picked.
    """

    seed: int
    settings: SearchSettings
    window: tuple[float, float] | None
    near: Nodes | None
    times_picked: int = 0


@final
class Scouts:
    """Sends out scouts.

    Parameters
    ----------
    problem : Problem
        What to solve.
    predictor : LegPredictor
        Predicts their legs.
    settings : SearchSettings
        Settings of the search.
    executor : concurrent.futures.Executor, optional
        Where they work; default, and where the predictor cannot be sent to another
        process: here.
    """

    def __init__(
        self,
        problem: Problem,
        predictor: LegPredictor,
        settings: SearchSettings,
        executor: Executor | None = None,
    ) -> None:
        self._problem = problem
        self._tools = _Tools(problem, predictor, settings.reference_tof_days)
        self._executor = executor
        self._packed: Any = None
        if executor is not None:
            try:
                packed = pickle.dumps(self._tools)
            except (pickle.PicklingError, AttributeError, TypeError):
                self._executor = None
            else:
                self._packed = shared(executor, packed)

    def generation(
        self,
        pool: Pool,
        settings: SearchSettings,
        count: int,
        rng: np.random.Generator,
        counters: RankCounters,
    ) -> Pool:
        """Send out scouts at the same time and wait for all of them.

        Parameters
        ----------
        pool : Pool
            What is known.
        settings : SearchSettings
            Width of a scout, caps and weights.
        count : int
            How many.
        rng : numpy.random.Generator
            Draws where they go. The result does not depend on the executor.
        counters : RankCounters
            What they did is added.

        Returns
        -------
        Pool
            With what they found.
        """
        ranking = self._tools.ends.ranking(
            BalancedRanking(settings.time_weight, settings.propellant_weight)
        )
        pool, orders = self._orders(pool, settings, count, rng, ranking)
        found = []
        for order, scouted in zip(orders, self._send(orders), strict=True):
            found.append((scouted.leaves, order.times_picked // 2))
            counters.nodes += scouted.nodes
            counters.proposed += scouted.proposed
            counters.questions += scouted.questions
        return pool.merged(found, ranking, self._problem)

    def _orders(
        self,
        pool: Pool,
        settings: SearchSettings,
        count: int,
        rng: np.random.Generator,
        ranking: Ranking,
    ) -> tuple[Pool, list[_Order]]:
        explorers = count
        if len(pool) and pool.niches().max() + 1 >= _NICHES:
            explorers = int(np.count_nonzero(rng.random(count) < _EXPLORING))
        first, last = self._problem.first_departure_mjd2000
        slices = max(1, round((last - first) / _SLICE_DAYS))
        # Evenly spread, as few scouts have the whole window to look at.
        offset = rng.random()
        parts = [int(slices * ((offset + k / explorers) % 1.0)) for k in range(explorers)]
        pool, rows = pool.choose(count - explorers, ranking, self._problem)
        orders = []
        for k in range(count):
            weight = settings.propellant_weight * np.exp(_WEIGHT_SPREAD * rng.normal())
            changes: dict[str, object] = {
                "beam_width": settings.scouts.width,
                "propellant_weight": float(weight),
            }
            seed = int(rng.integers(2**62))
            if k < explorers:
                changes |= {
                    "starts": _STARTS * settings.scouts.width,
                    "start_epochs": self._slice_epochs(settings),
                }
                window = window_part(self._problem, parts[k], slices)
                orders.append(_Order(seed, settings.with_(**changes), window, None))
            else:
                # One start body may lead to all of the best: with a cap of 0.3 none of nine scouts
                # found the 15th asteroid that five of nine found without.
                changes["frontier"] = {"max_start_share": 1.0}
                row = rows[[k - explorers]]
                near, times = pool.nodes.take(row), int(pool.times_picked[row[0]])
                orders.append(_Order(seed, settings.with_(**changes), None, near, times))
        return pool, orders

    def _slice_epochs(self, settings: SearchSettings) -> int:
        """Return at how many epochs a slice is looked at: at more where few bodies are starts."""
        if ending_of(self._problem) is None:
            return _SLICE_EPOCHS
        wanted = _STARTS * settings.scouts.width / len(self._problem.start_rows())
        return int(np.clip(wanted, _SLICE_EPOCHS, _MOST_EPOCHS))

    def _send(self, orders: list[_Order]) -> list[Scouted]:
        if self._executor is None:
            return [_scouted(self._tools, order) for order in orders]
        futures = [self._executor.submit(_scouted_there, self._packed, order) for order in orders]
        return [future.result() for future in futures]


@final
class _Tools:
    """What all scouts of one process share."""

    def __init__(
        self, problem: Problem, predictor: LegPredictor, reference_tof_days: float
    ) -> None:
        self.problem = problem
        self.predictor = predictor
        self.neighbours = OrbitalNeighbours(
            problem.catalogue, reference_tof_days=reference_tof_days
        )
        self.forecast = Forecast(problem, predictor, self.neighbours)
        self.ends = make_ends(problem, predictor)


def _scouted(tools: _Tools, order: _Order) -> Scouted:
    rng = np.random.default_rng(order.seed)
    settings = order.settings
    if order.near is not None:
        count = _STARTS * settings.beam_width
        starts = starts_near(tools.problem, tools.neighbours, order.near, count, rng)
    else:
        starts = dense_starts(tools.problem, tools.neighbours, settings, rng, order.window)
    nodes = tools.problem.start_nodes(*starts)
    return scout(tools.problem, tools.forecast, tools.ends, nodes, settings)


@functools.lru_cache(maxsize=1)
def _unpacked(tools: bytes) -> _Tools:
    unpacked = pickle.loads(tools)
    assert isinstance(unpacked, _Tools)
    return unpacked


def _scouted_there(tools: bytes, order: _Order) -> Scouted:
    return _scouted(_unpacked(tools), order)
