"""`Passes`: begins one beam after another, until a budget or their number is used up."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import final

import numpy as np

from seqsearch.beam.best_tour import Best
from seqsearch.beam.pacing import Pacing
from seqsearch.beam.scouting.generations import Scouting
from seqsearch.beam.scouting.guide import starts_of
from seqsearch.beam.starts import Starts
from seqsearch.beam.state import SearchState
from seqsearch.budget import Budget
from seqsearch.core.nodes import Nodes
from seqsearch.core.problem import Problem


@final
class Passes:
    """Sets up the passes of a search.

    Parameters
    ----------
    problem : Problem
        What to solve.
    count : int
        How many passes, where no limit of the budget decides.
    pacing : Pacing
        How much effort each takes.
    scouting : Scouting
        Looks for itineraries before each.
    starts : Starts
        Chooses start nodes where there are no itineraries.
    best : Best
        Looks at the start nodes.
    budget : Budget
        Ends the search.
    rng : numpy.random.Generator
        Stream of the search.
    """

    def __init__(
        self,
        problem: Problem,
        count: int,
        *,
        pacing: Pacing,
        scouting: Scouting,
        starts: Starts,
        best: Best,
        budget: Budget,
        rng: np.random.Generator,
    ) -> None:
        self._problem = problem
        self._count = count
        self._pacing = pacing
        self._scouting = scouting
        self._starts = starts
        self._best = best
        self._budget = budget
        self._rng = rng

    def begin(self, state: SearchState, report: Callable[[Nodes], None]) -> Iterator[Nodes]:
        """Yield the nodes from which each pass goes on.

        A pass that the state is in the middle of comes first.

        Parameters
        ----------
        state : SearchState
            Gets the settings and the guide of each pass, and its start nodes in the tree.
        report : callable
            Called with the start nodes that scouts led to: what they found must not be lost.
        """
        if state.waiting is not None:
            self._set_effort(state)
            yield state.waiting
        while self._wanted(state) and not self._budget.used_up():
            state.pass_number += 1
            # What was loaded at the end of a pass still names the guide of that pass.
            state.guide = None
            narrow = self._set_effort(state)
            scouted = not narrow and self._scouting.guide(state, self._rng)
            if self._budget.used_up():
                return
            nodes = self._planted(self._start_nodes(state), state)
            if scouted:
                report(nodes)
            yield nodes

    def _wanted(self, state: SearchState) -> bool:
        return self._budget.limited or state.pass_number < self._count

    def _set_effort(self, state: SearchState) -> bool:
        """Set the settings of a pass, and tell whether it is a narrow one amid scouted ones."""
        scouted = self._scouting.active
        if scouted and (narrow := self._pacing.begin_narrow_pass(state.pass_number)):
            state.settings = narrow
            return True
        state.settings = self._pacing.begin_pass(
            state.pass_number, state.settings, state.counters, scouted=scouted
        )
        return False

    def _start_nodes(self, state: SearchState) -> Nodes:
        if state.guide is not None:
            return self._problem.start_nodes(*starts_of(state.guide))
        return self._starts(state.settings, self._rng)

    def _planted(self, nodes: Nodes, state: SearchState) -> Nodes:
        """Return start nodes with their ids in the tree."""
        ids = [
            state.tree.add_start(int(row), float(t), float(mass))
            for row, t, mass in zip(nodes.row, nodes.t_first_mjd2000, nodes.mass, strict=True)
        ]
        nodes = replace(nodes, tree_id=np.asarray(ids, dtype=np.int64))
        self._best.note(nodes, state)
        return nodes
