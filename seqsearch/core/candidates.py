"""`Candidates`: hops that might be flown, and where they would lead."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from feasibility.arrays import StructOfArrays
from feasibility.orbits import OrbitalNeighbours
from seqsearch.core.ending import ending_of
from seqsearch.core.hops import Hops
from seqsearch.core.nodes import Nodes
from seqsearch.core.problem import Problem
from seqsearch.settings import SearchSettings

_CHUNK_LEGS = 200_000
"""Candidates proposed at once: bounds memory to about 100 MB."""


@final
@dataclass(frozen=True, eq=False)
class Candidates(StructOfArrays):
    """Hops that are not yet solved, one row a hop.

    With n the number of candidates.

    Attributes
    ----------
    parent : (n,) intp
        Position of the node among those that are expanded.
    target : (n,) intp
        Catalogue row of the target.
    hops : Hops
        The n hops, from the parent's mass.
    """

    parent: NDArray[np.intp]
    target: NDArray[np.intp]
    hops: Hops


@final
@dataclass(frozen=True, eq=False)
class Pairs(StructOfArrays):
    """Nodes and the targets that they may go on to, one row a pair and departure epoch.

    With n the number of pairs, ordered by node, target and epoch.

    Attributes
    ----------
    parent : (n,) intp
        Position of the node among those that are expanded.
    target : (n,) intp
        Catalogue row of the target.
    t_dep_mjd2000 : (n,) float64
        Departure epoch.
    days_left : (n,) float64
        Longest time of flight that the mission has room for.
    """

    parent: NDArray[np.intp]
    target: NDArray[np.intp]
    t_dep_mjd2000: NDArray[np.float64]
    days_left: NDArray[np.float64]


def near_pairs(
    problem: Problem,
    nodes: Nodes,
    block: NDArray[np.intp],
    neighbours: OrbitalNeighbours,
    n_near: int,
    settings: SearchSettings,
) -> Pairs:
    """Pair nodes with the nearest bodies and the departure delays, as far as the rules allow.

    Parameters
    ----------
    problem : Problem
        Its rules.
    nodes : Nodes
        All nodes that are expanded.
    block : (b,) intp
        The nodes in question.
    neighbours : OrbitalNeighbours
        Which bodies are near.
    n_near : int
        How many of them are looked at, those included that may not be visited.
    settings : SearchSettings
        `departure_delays_days`; flights shorter than `tof_days_min` are not worth a pair.
    """
    here = nodes.take(block)
    near = _with_required(problem, neighbours.query(here.row, here.t_ready_mjd2000, n_near))
    departure = here.t_ready_mjd2000[:, None] + np.asarray(settings.departure_delays_days)
    left = problem.days_left(here, departure)
    here_to_near = problem.may_visit(here, near) & (near >= 0)
    allowed = here_to_near[:, :, None] & (left >= settings.tof_days_min)[:, None]
    i, j, d = np.nonzero(allowed)
    return Pairs(block[i], near[i, j], departure[i, d], left[i, d])


def _with_required(problem: Problem, near: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return targets (n, t) with the bodies that a tour has to visit, -1 for those near anyway."""
    ending = ending_of(problem)
    if ending is None or len(ending.required) == 0:
        return near
    required = np.broadcast_to(ending.required, (len(near), len(ending.required)))
    twice = (required[:, :, None] == near[:, None, :]).any(axis=2)
    return np.column_stack([near, np.where(twice, -1, required)])


def on_grid(
    problem: Problem, nodes: Nodes, pairs: Pairs, settings: SearchSettings
) -> Candidates | None:
    """Return the candidates of pairs at all flight times of the grid; None for none."""
    tof = settings.tof_days()
    pair, k = np.nonzero(tof <= pairs.days_left[:, None])
    if len(pair) == 0:
        return None
    parent, target, t_dep = pairs.parent[pair], pairs.target[pair], pairs.t_dep_mjd2000[pair]
    return Candidates(parent, target, problem.hops(nodes, parent, target, t_dep, tof[k]))


def grid_candidates(
    problem: Problem, nodes: Nodes, neighbours: OrbitalNeighbours, settings: SearchSettings
) -> Iterator[Candidates]:
    """Propose hops from each node: nearest bodies x departure delays x flight times.

    Yields blocks of bounded size; together they are ordered by node, target, delay and
    flight time.
    """
    n_near = min(settings.neighbours + int(nodes.depth.max(initial=0)), len(problem.catalogue) - 1)
    per_node = n_near * len(settings.tof_days()) * len(settings.departure_delays_days)
    step = max(1, _CHUNK_LEGS // per_node)
    for first in range(0, len(nodes), step):
        block = np.arange(first, min(first + step, len(nodes)))
        pairs = near_pairs(problem, nodes, block, neighbours, n_near, settings)
        candidates = on_grid(problem, nodes, pairs, settings)
        if candidates is not None:
            yield candidates


def reached(
    problem: Problem,
    nodes: Nodes,
    candidates: Candidates,
    m_final: NDArray[np.float64],
    excess: NDArray[np.float64] | None = None,
) -> Nodes:
    """Return the n nodes to which candidates lead, not yet in the tree (tree_id -1).

    Parameters
    ----------
    problem : Problem
        For the stay at the target.
    nodes : Nodes
        The nodes that the candidates start from.
    candidates : Candidates
        n candidates.
    m_final : (n,) float64, kg
        Masses at arrival, before anything is dropped there.
    excess : (n, 3) float64, m/s, optional
        Velocities at arrival relative to the targets; default: at rest.
    """
    hops, parent = candidates.hops, candidates.parent
    return Nodes(
        row=candidates.target,
        depth=nodes.depth[parent] + 1,
        t_ready_mjd2000=hops.t_arr_mjd2000 + problem.min_stay_days,
        t_arr_mjd2000=hops.t_arr_mjd2000,
        t_first_mjd2000=np.where(
            nodes.depth[parent] == 0, hops.t_dep_mjd2000, nodes.t_first_mjd2000[parent]
        ),
        mass=m_final - hops.dropped_kg[-1],
        visited=nodes.extended_visits(parent, candidates.target),
        tree_id=np.full(len(candidates), -1, dtype=np.int64),
        parent_id=nodes.tree_id[parent],
        velocity=np.zeros((len(candidates), 3)) if excess is None else excess,
    )
