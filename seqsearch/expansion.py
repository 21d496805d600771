"""Expansion: the candidate legs that lead on from the nodes of a rank."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from feasibility import Legs
from feasibility.orbits import OrbitalNeighbours
from seqsearch.nodes import Nodes
from seqsearch.problem import Problem
from seqsearch.settings import SearchSettings

_CHUNK_LEGS = 200_000
"""Candidates proposed at once: bounds memory to about 100 MB."""


@final
@dataclass(frozen=True, eq=False)
class Candidates:
    """Legs proposed by the expansion, one row a leg.

    With n the number of candidates.

    Attributes
    ----------
    parent : (n,) intp
        Position of the node in its rank.
    target : (n,) intp
        Catalogue row of the target.
    legs : Legs
        The n legs, with the parent's mass as initial mass.
    """

    parent: NDArray[np.intp]
    target: NDArray[np.intp]
    legs: Legs

    def __len__(self) -> int:
        return len(self.legs)

    def take(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> "Candidates":
        """Return the candidates at the given rows (indices or a mask)."""
        return Candidates(self.parent[rows], self.target[rows], self.legs.take(rows))

    @staticmethod
    def concatenate(parts: "list[Candidates]") -> "Candidates":
        """Return the candidates of all parts, in order."""
        return Candidates(
            np.concatenate([part.parent for part in parts]),
            np.concatenate([part.target for part in parts]),
            Legs.concatenate([part.legs for part in parts]),
        )


def expand(
    problem: Problem, nodes: Nodes, neighbours: OrbitalNeighbours, settings: SearchSettings
) -> Iterator[Candidates]:
    """Propose legs from each node: nearest bodies x departure delays x flight times.

    Bodies visited before are left out, and so are arrivals beyond the
    problem's duration and first departures outside its window. Yields blocks
    of bounded size; together they are ordered by node, target, delay and
    flight time.
    """
    tof = settings.tof_days()
    delays = np.asarray(settings.departure_delays_days)
    n_near = min(settings.neighbours + nodes.rank, len(problem.catalogue) - 1)
    per_node = n_near * len(tof) * len(delays)
    step = max(1, _CHUNK_LEGS // per_node)
    for first in range(0, len(nodes), step):
        block = np.arange(first, min(first + step, len(nodes)))
        near = neighbours.query(nodes.row[block], nodes.t_ready_mjd2000[block], n_near)
        fresh = ~(near[:, :, None] == nodes.visited[block][:, None, :]).any(axis=2)
        shape = (len(block), n_near, len(delays), len(tof))
        departure = nodes.t_ready_mjd2000[block][:, None, None, None] + delays[:, None]
        if nodes.rank == 0:
            clock = departure
            in_window = departure <= problem.first_departure_mjd2000[1]
        else:
            clock = nodes.t_first_mjd2000[block][:, None, None, None]
            in_window = np.ones((1, 1, 1, 1), dtype=bool)
        arrival = departure + tof
        in_time = arrival - clock <= problem.max_duration_days
        allowed = np.broadcast_to(fresh[:, :, None, None] & in_window & in_time, shape)
        i, j, d, k = np.nonzero(allowed)
        if len(i) == 0:
            continue
        parent = block[i]
        target = near[i, j]
        t_dep = nodes.t_ready_mjd2000[parent] + delays[d]
        legs = Legs(
            rv_dep=problem.catalogue.states_at(nodes.row[parent], t_dep),
            rv_arr=problem.catalogue.states_at(target, t_dep + tof[k]),
            tof_days=tof[k],
            m0=nodes.mass[parent],
            thrust=problem.spacecraft.thrust,
            isp=problem.spacecraft.isp,
            m_dry=problem.spacecraft.m_dry,
            t_dep_mjd2000=t_dep,
            dep_id=problem.catalogue.ids[nodes.row[parent]],
            arr_id=problem.catalogue.ids[target],
        )
        yield Candidates(parent, target, legs)


def reached(
    problem: Problem, nodes: Nodes, candidates: Candidates, m_final: NDArray[np.float64]
) -> Nodes:
    """Return the n nodes to which candidate legs lead, not yet in the tree (tree_id -1).

    Parameters
    ----------
    problem : Problem
        For the stay at the target.
    nodes : Nodes
        The rank that the candidates start from.
    candidates : Candidates
        n legs.
    m_final : (n,) float64, kg
        Masses at arrival.
    """
    departure = candidates.legs.t_dep_mjd2000
    assert departure is not None
    arrival = departure + candidates.legs.tof_days
    parent = candidates.parent
    return Nodes(
        row=candidates.target,
        t_ready_mjd2000=arrival + problem.min_stay_days,
        t_arr_mjd2000=arrival,
        t_first_mjd2000=departure if nodes.rank == 0 else nodes.t_first_mjd2000[parent],
        mass=m_final,
        visited=np.column_stack([nodes.visited[parent], candidates.target]),
        tree_id=np.full(len(candidates), -1, dtype=np.int64),
    )
