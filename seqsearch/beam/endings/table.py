"""`WayHomeTable`: what flights to the end cost, on a grid of departures and flight times."""

from dataclasses import replace
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.predictor import LegPredictor
from feasibility.orbits.lambert import lambert_delta_v
from feasibility.runtime.workers import in_threads
from seqsearch.core.ending import Ending
from seqsearch.core.hop_margins import log_margin, quick_margin_of
from seqsearch.core.nodes import Nodes
from seqsearch.core.problem import Problem
from seqsearch.core.way_home import LONGEST_DAYS, SHORTEST_DAYS, hops_home
from seqsearch.tours.records import LARGEST_M_STAR_KG

_Array = NDArray[np.float64]
_Index = NDArray[np.intp]

GRID_DAYS: Final = 30.0
"""Departures of the grid are this far apart: between them, m* at equal flight times changes
smoothly, as bodies that are worth a visit drift slowly past each other."""

TOFS_DAYS: Final = np.geomspace(SHORTEST_DAYS, LONGEST_DAYS, 10)

_OFFSET: Final = 1 << 19
_LATE_SHARE: Final = 0.2
"""Share of the propellant that is left where margins are asked for: m* hardly depends on it."""

_LARGEST_LOG: Final = float(np.log(LARGEST_M_STAR_KG))
_CELLS_AT_ONCE: Final = 1000


@final
class WayHomeTable:
    """Remembers m* and impulses of flights to the end, by body and departure.

    As an exact m* does not depend on the initial mass, the answers serve all nodes at a body.

    Parameters
    ----------
    problem : Problem
        Gives the legs.
    ending : Ending
        With a body at which tours end.
    predictor : LegPredictor
        Its quick answers are asked for, if it has such.
    threads : int
        How many questions are worked on at once.
    """

    def __init__(
        self, problem: Problem, ending: Ending, predictor: LegPredictor, threads: int = 1
    ) -> None:
        self._problem = problem
        self._ending = ending
        self._ask = quick_margin_of(predictor)
        self._threads = threads
        m_dry = problem.spacecraft.m_dry
        self._mass = m_dry + _LATE_SHARE * (problem.m0 - m_dry)
        self._keys = np.zeros(0, dtype=np.int64)
        self._log_m_star = np.zeros((0, len(TOFS_DAYS)))
        self._delta_v = np.zeros((0, len(TOFS_DAYS)))

    def at(self, row: _Index, cell: NDArray[np.int64]) -> tuple[_Array, _Array]:
        """Return log(m* in kg) and delta-v in m/s, (n, k) at the k flight times.

        Parameters
        ----------
        row : (n,) intp
            Catalogue rows of the bodies that are left.
        cell : (n,) int64
            Departures in units of the grid.
        """
        keys = (row.astype(np.int64) << 20) + (cell + _OFFSET)
        wanted, where = np.unique(keys, return_inverse=True)
        unknown = np.setdiff1d(wanted, self._keys, assume_unique=True)
        if len(unknown):
            self._learn(unknown)
        place = np.asarray(np.searchsorted(self._keys, wanted))[where.ravel()]
        return self._log_m_star[place], self._delta_v[place]

    def _learn(self, keys: NDArray[np.int64]) -> None:
        blocks = [
            keys[first : first + _CELLS_AT_ONCE] for first in range(0, len(keys), _CELLS_AT_ONCE)
        ]
        found = list(in_threads(self._flights, blocks, self._threads))
        self._keys = np.concatenate([self._keys, keys])
        order = np.argsort(self._keys, kind="stable")
        self._keys = self._keys[order]
        self._log_m_star = np.concatenate([self._log_m_star, *(m for m, _ in found)])[order]
        self._delta_v = np.concatenate([self._delta_v, *(dv for _, dv in found)])[order]

    def _flights(self, keys: NDArray[np.int64]) -> tuple[_Array, _Array]:
        """Return what `at` returns, of some keys."""
        n, k = len(keys), len(TOFS_DAYS)
        row = (keys >> 20).astype(np.intp)
        cell = ((keys & ((1 << 20) - 1)) - _OFFSET).astype(np.float64)
        epoch = GRID_DAYS * cell
        nodes = Nodes.at_start(row, epoch, np.full(n, self._mass))
        # One visit done: on some problems the first hop is of another kind than the rest.
        nodes = replace(
            nodes,
            depth=np.ones(n, dtype=np.int64),
            visited=np.column_stack([np.full(n, -1, dtype=np.intp), row]),
        )
        parent = np.repeat(np.arange(n), k)
        tof = np.tile(TOFS_DAYS, n)
        hops = hops_home(self._problem, self._ending, nodes, parent, epoch[parent], tof)
        # A leg that needs no thrust has no largest mass, and between inf there is no middle.
        log = np.minimum(log_margin(self._ask, hops) + np.log(self._mass), _LARGEST_LOG)
        legs = hops.legs[-1]
        delta_v = lambert_delta_v(
            *(legs.rv_dep, legs.rv_arr, legs.tof_s),
            max_revs=0,
            vinf_dep=legs.vinf_dep,
            vinf_arr=legs.vinf_arr,
        )
        return log.reshape(n, k), delta_v.reshape(n, k)
