"""Expansion: the candidate hops that lead on from nodes."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from feasibility.orbits import OrbitalNeighbours
from seqsearch.core.nodes import Nodes
from seqsearch.core.problem import Hops, TourProblem
from seqsearch.settings import SearchSettings

_CHUNK_LEGS = 200_000
"""Candidates proposed at once: bounds memory to about 100 MB."""


@final
@dataclass(frozen=True, eq=False)
class Candidates:
    """Hops proposed by the expansion, one row a hop.

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

    def __len__(self) -> int:
        return len(self.parent)

    def take(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> "Candidates":
        """Return the candidates at the given rows (indices or a mask)."""
        return Candidates(self.parent[rows], self.target[rows], self.hops.take(rows))

    @staticmethod
    def concatenate(parts: "list[Candidates]") -> "Candidates":
        """Return the candidates of all parts, in order."""
        return Candidates(
            np.concatenate([part.parent for part in parts]),
            np.concatenate([part.target for part in parts]),
            Hops.concatenate([part.hops for part in parts]),
        )


def expand(
    problem: TourProblem, nodes: Nodes, neighbours: OrbitalNeighbours, settings: SearchSettings
) -> Iterator[Candidates]:
    """Propose hops from each node: nearest bodies x departure delays x flight times.

    Bodies visited before are left out, and so are arrivals beyond the
    problem's duration and first departures outside its window. Yields blocks
    of bounded size; together they are ordered by node, target, delay and
    flight time.
    """
    tof = settings.tof_days()
    delays = np.asarray(settings.departure_delays_days)
    n_near = min(settings.neighbours + int(nodes.depth.max(initial=0)), len(problem.catalogue) - 1)
    per_node = n_near * len(tof) * len(delays)
    step = max(1, _CHUNK_LEGS // per_node)
    for first in range(0, len(nodes), step):
        block = np.arange(first, min(first + step, len(nodes)))
        near = neighbours.query(nodes.row[block], nodes.t_ready_mjd2000[block], n_near)
        fresh = ~(near[:, :, None] == nodes.visited[block][:, None, :]).any(axis=2)
        departure = nodes.t_ready_mjd2000[block][:, None] + delays
        at_start = nodes.depth[block][:, None] == 0
        in_window = ~at_start | (departure <= problem.first_departure_mjd2000[1])
        clock = np.where(at_start, departure, nodes.t_first_mjd2000[block][:, None])
        in_time = (departure - clock)[:, :, None] + tof <= problem.max_duration_days
        allowed = fresh[:, :, None, None] & (in_window[:, :, None] & in_time)[:, None]
        i, j, d, k = np.nonzero(allowed)
        if len(i) == 0:
            continue
        parent, target = block[i], near[i, j]
        t_dep = nodes.t_ready_mjd2000[parent] + delays[d]
        yield Candidates(parent, target, problem.hops(nodes, parent, target, t_dep, tof[k]))


def reached(
    problem: TourProblem, nodes: Nodes, candidates: Candidates, m_final: NDArray[np.float64]
) -> Nodes:
    """Return the n nodes to which candidate hops lead, not yet in the tree (tree_id -1).

    Parameters
    ----------
    problem : TourProblem
        For the stay at the target.
    nodes : Nodes
        The nodes that the candidates start from.
    candidates : Candidates
        n hops.
    m_final : (n,) float64, kg
        Masses at arrival, before anything is dropped there.
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
    )
