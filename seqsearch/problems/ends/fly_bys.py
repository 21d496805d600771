"""`FlyBys`: which bodies a spacecraft that does not stop can pass next, and when.

Arrivals are at epochs of a common grid, so that one tree of positions an epoch serves all nodes.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from feasibility import Legs
from feasibility.arrays import StructOfArrays
from feasibility.classifier.predictor import LegPredictor
from feasibility.constants import DAY_S, MU_SUN
from feasibility.orbits.lambert import lambert
from seqsearch.core.custom_moves import CustomCandidates
from seqsearch.core.nodes import Nodes
from seqsearch.core.problem import Problem
from seqsearch.problems.moves.launch_epochs import launch_epochs
from seqsearch.settings import SearchSettings

_Array = NDArray[np.float64]
_Rows = NDArray[np.intp]

_NEAR: Final = 12
"""Bodies looked at for each node and arrival, those nearest to where it would coast to."""

_HOPELESS: Final = 0.6
"""Estimated m*/m0 below which a leg is not worth a solve, where the predictor knows nothing.

A thrust that is constant in space shifts the arrival by half of what its impulse at the departure
would; the true m* is within a third of that on short legs.
"""

_LIKELY: Final = 0.98
"""The same for the margins of a predictor."""

_BURN: Final = 1.3
"""Propellant of a leg over that of the impulse which does the same."""


@final
@dataclass(frozen=True, eq=False)
class _Passages(StructOfArrays):
    """Bodies that might be passed, one row a node, body and arrival."""

    parent: _Rows
    target: _Rows
    tof_days: _Array


@final
class FlyBys:
    """Starts and candidates of tours of fly-bys; `CustomMoves`.

    Parameters
    ----------
    problem : Problem
        The problem, whose nodes have velocities.
    """

    def __init__(self, problem: Problem) -> None:
        self._problem = problem

    def starts(self, settings: SearchSettings, rng: np.random.Generator, /) -> Nodes:
        """Return ``settings.starts`` starts all over the window, at any of the start bodies."""
        n, allowed = settings.starts, self._problem.start_rows()
        epochs = launch_epochs(self._problem.first_departure_mjd2000, n, rng)
        return self._problem.start_nodes(rng.choice(allowed, n), epochs)

    def candidates(
        self,
        nodes: Nodes,
        settings: SearchSettings,
        predictor: LegPredictor,
        threads: int,  # noqa: ARG002
        /,
    ) -> Iterator[CustomCandidates]:
        """Propose the passages from all nodes at once that a solve may prove flyable."""
        passages = self._near(nodes, settings)
        if len(passages) == 0:
            return
        hops = self._problem.hops(
            nodes,
            passages.parent,
            passages.target,
            nodes.t_ready_mjd2000[passages.parent],
            passages.tof_days,
        )
        legs = hops.legs[0]
        delta_v = _impulse(legs)
        with np.errstate(divide="ignore"):
            estimate = 0.5 * legs.thrust * legs.tof_s / (legs.m0 * delta_v)
        rows = np.flatnonzero(estimate > _HOPELESS)
        margin = np.full(len(legs), np.nan)
        margin[rows] = predictor.margin(legs.take(rows))
        known = ~np.isnan(margin)
        worth = np.where(known, margin > _LIKELY, estimate > _HOPELESS)
        mass = legs.m0 * np.exp(-_BURN * delta_v / legs.exhaust_velocity)
        chosen = np.flatnonzero(worth & (mass > legs.m_dry))
        if len(chosen) == 0:
            return
        yield CustomCandidates(
            passages.parent[chosen],
            passages.target[chosen],
            hops.take(chosen),
            mass[chosen],
            len(rows),
        )

    def _near(self, nodes: Nodes, settings: SearchSettings) -> _Passages:
        """Return the passages of bodies near where nodes coast to, at arrivals of the grid."""
        catalogue = self._problem.catalogue
        left = self._problem.days_left(nodes, nodes.t_ready_mjd2000[:, None])[:, 0]
        longest = np.minimum(left, settings.tof_days_max)
        step = settings.tof_days_step
        first = np.ceil((nodes.t_ready_mjd2000 + settings.tof_days_min) / step).astype(np.intp)
        last = np.floor((nodes.t_ready_mjd2000 + longest) / step).astype(np.intp)
        states = catalogue.states_at(nodes.row, nodes.t_ready_mjd2000)
        states[:, 3:] += nodes.velocity
        near = min(_NEAR + int(nodes.depth.max(initial=0)), len(catalogue))
        parts = []
        for number in range(int(first.min()), int(last.max()) + 1):
            here = np.flatnonzero((first <= number) & (number <= last))
            if len(here) == 0:
                continue
            tof = number * step - nodes.t_ready_mjd2000[here]
            tree = KDTree(catalogue.states(number * step)[:, :3])
            _, targets = tree.query(_coasted(states[here], tof), k=near)
            targets = np.asarray(targets, dtype=np.intp).reshape(len(here), near)
            node, k = np.nonzero(self._problem.may_visit(nodes.take(here), targets))
            parts.append(_Passages(here[node], targets[node, k], tof[node]))
        if not parts:
            return _Passages(np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros(0))
        found = _Passages.concatenate(parts)
        return found.take(np.lexsort((found.tof_days, found.target, found.parent)))


def _coasted(states: _Array, tof_days: _Array) -> _Array:
    """Return (n, 3) m, where states (n, 6) are after (n,) days."""
    # Imported here: compiled kernels take a moment to load.
    from feasibility.orbits.kepler_kernels import propagate_batch

    return propagate_batch(states, tof_days * DAY_S, MU_SUN)[:, :3]


def _impulse(legs: Legs) -> _Array:
    """Return (n,) m/s that Lambert's arcs ask for beyond the excess velocities of legs."""
    v_dep, v_arr = lambert(legs.rv_dep[:, :3], legs.rv_arr[:, :3], legs.tof_s)
    at_departure = np.linalg.norm(v_dep[:, 0] - legs.rv_dep[:, 3:], axis=1)
    at_arrival = np.linalg.norm(v_arr[:, 0] - legs.rv_arr[:, 3:], axis=1)
    total = np.maximum(at_departure - legs.vinf_dep, 0.0)
    total += np.maximum(at_arrival - legs.vinf_arr, 0.0)
    found: _Array = np.nan_to_num(total, nan=np.inf)
    return found
