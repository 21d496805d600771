"""`BestEndedTour`: remembers the best tour that has come to its end."""

from dataclasses import replace
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.predictor import LegPredictor
from seqsearch.beam.endings.outlook import EndOutlook
from seqsearch.beam.state import SearchState
from seqsearch.budget import Budget
from seqsearch.core.candidates import Candidates, reached
from seqsearch.core.ending import Ending, ending_of
from seqsearch.core.flown_hops import FlownHops
from seqsearch.core.nodes import Nodes
from seqsearch.core.optimisation import LegOptimiser
from seqsearch.core.problem import Problem
from seqsearch.core.way_home import WaysHome, hops_home, ways_home
from seqsearch.settings import SearchSettings

_TRIED: Final = 16
_ROUNDS: Final = 4
"""Nodes of a rank from which the way to the end is flown at once, and how often, if none gets
there."""

_WAYS: Final = 3
"""Last legs that are flown from a node: the cheapest ones, and the one of the largest margin."""

_MARGIN_DOUBT: Final = 0.02


@final
class BestEndedTour:
    """Compares tours that have come to their end, where they have to; a `Best`.

    The way to the end is flown for the best nodes of a rank, as far as they could be the best.

    Parameters
    ----------
    problem : Problem
        What is solved, with an ending.
    settings : SearchSettings
        Settings of the search.
    predictor : LegPredictor
        Proposes the last legs.
    optimiser : LegOptimiser
        Flies them.
    outlook : EndOutlook
        Tells from which nodes it is worth it.
    budget : Budget
        What may be spent.
    """

    def __init__(
        self,
        problem: Problem,
        settings: SearchSettings,
        *,
        predictor: LegPredictor,
        optimiser: LegOptimiser,
        outlook: EndOutlook,
        budget: Budget,
    ) -> None:
        ending = ending_of(problem)
        assert ending is not None
        self._ending: Ending = ending
        self._problem = problem
        self._settings = settings
        self._predictor = predictor
        self._optimiser = optimiser
        self._outlook = outlook
        self._budget = budget

    def note(self, nodes: Nodes, state: SearchState) -> None:
        """Remember the best of some nodes in the tree, if it ends a better tour than so far."""
        open_ = (nodes.depth > 0) & (nodes.depth >= state.best_key[0])
        open_ &= self._ending.missing(nodes) == 0
        for depth in np.unique(nodes.depth[open_])[::-1]:
            if self._noted(nodes.take(open_ & (nodes.depth == depth)), state):
                return

    def _noted(self, nodes: Nodes, state: SearchState) -> bool:
        """Remember the best of some equally deep nodes; tell whether one is better."""
        homecoming = self._outlook.homecoming(nodes)
        there = self._outlook.at_home(nodes, homecoming)
        costs = self._problem.tour_cost(there, self._settings)
        rows = np.argsort(costs, kind="stable")
        rows = rows[homecoming.possible[rows]]
        depth = int(nodes.depth[0])
        if depth == state.best_key[0]:
            rows = rows[costs[rows] < -state.best_key[1]]
        if self._ending.row is None:
            if len(rows):
                best = int(rows[0])
                state.best_key = (depth, -float(costs[best]))
                state.best_node, state.closing = int(nodes.tree_id[best]), ()
            return bool(len(rows))
        for first in range(0, min(len(rows), _ROUNDS * _TRIED), _TRIED):
            if self._budget.used_up() and state.best_node >= 0:
                break
            flown = self._flown(nodes.take(rows[first : first + _TRIED]))
            if len(flown.nodes) == 0:
                continue
            costs = self._problem.tour_cost(flown.nodes, self._settings)
            best = int(np.argmin(costs))
            key = (depth, -float(costs[best]))
            if key > state.best_key:
                closing = flown.legs(self._problem, np.array([best]))[0]
                node = int(flown.nodes.parent_id[best])
                state.best_key, state.best_node, state.closing = key, node, closing
            return True
        return False

    def _flown(self, nodes: Nodes) -> FlownHops:
        """Fly the most promising ways to the end from some nodes."""
        problem, ending = self._problem, self._ending
        ways = ways_home(problem, ending, nodes, self._predictor)
        ways = ways.take(self._promising(nodes, ways))
        if len(ways) == 0:
            return FlownHops.none()
        hops = hops_home(problem, ending, nodes, ways.parent, ways.t_dep_mjd2000, ways.tof_days)
        assert ending.row is not None
        target = np.full(len(ways), ending.row, dtype=np.intp)
        candidates = Candidates(ways.parent, target, hops)
        promise = problem.tour_cost(
            reached(problem, nodes, candidates, ways.m_final), self._settings
        )
        count = self._budget.affordable(len(ways))
        settings = self._settings.with_(solves_per_rank=max(1, count))
        optimised = self._optimiser.run_all(candidates, promise, settings, self._budget.deadline)
        self._budget.charge(optimised.n_legs)
        return FlownHops.of(problem, nodes, candidates, optimised)

    def _promising(self, nodes: Nodes, ways: WaysHome) -> NDArray[np.intp]:
        """Return positions of the cheapest ways of each node, and of the surest one."""
        m_dry = self._problem.spacecraft.m_dry
        log = np.nan_to_num(ways.log_margin, nan=0.0)
        spare = ways.m_final - m_dry
        doubt = 0.02 * (self._problem.m0 - m_dry)
        flyable = (log >= -_MARGIN_DOUBT) & (spare >= -doubt)
        ends = replace(
            nodes.take(ways.parent),
            t_arr_mjd2000=ways.t_dep_mjd2000 + ways.tof_days,
            mass=ways.m_final,
        )
        cost = self._problem.tour_cost(ends, self._settings)
        # A leg on the verge of what can be flown may turn out beyond it.
        cost = np.where(flyable, cost + np.maximum(0.01 - log, 0.0), np.inf)
        chosen: list[int] = []
        for parent in range(len(nodes)):
            rows = np.flatnonzero(ways.parent == parent)
            rows = rows[np.isfinite(cost[rows])]
            if len(rows):
                best = rows[np.argsort(cost[rows], kind="stable")[:_WAYS]]
                widest = rows[np.argmax(log[rows] * (spare[rows] >= 0.0))]
                chosen += [*best.tolist(), int(widest)]
        return np.unique(np.asarray(chosen, dtype=np.intp))
