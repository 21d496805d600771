"""Hops: that they lead from the nodes to the targets, at the times that were asked for."""

from dataclasses import dataclass
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility import Legs
from feasibility.arrays import StructOfArrays
from feasibility.orbits.varied_legs import regroupings
from seqsearch.core.contract.asking import Asked, same
from seqsearch.core.hops import Hops
from seqsearch.core.nodes import Nodes

_Array = NDArray[np.float64]

_SLACK_DAYS: Final = 1e-6
_SLACK_KG: Final = 1e-6
_SLACK_M: Final = 1e3
_REST_M_S: Final = 1e-6
"""How far numbers may be off; the speed is the one below which a tour's record says at rest."""

_TOLERANCE: Final = 1e-9
"""A row's answer may depend on the other rows by no more than rounding."""


@final
@dataclass(frozen=True, eq=False)
class Moves(StructOfArrays):
    """What hops are asked for, one row a hop.

    Attributes
    ----------
    parent, target : (k,) intp
        Positions among the nodes, and catalogue rows.
    t_dep_mjd2000, tof_days : (k,) float64
        Departure epochs and whole times of flight.
    """

    parent: NDArray[np.intp]
    target: NDArray[np.intp]
    t_dep_mjd2000: _Array
    tof_days: _Array


def check_hops(asked: Asked, nodes: Nodes, moves: Moves, rng: np.random.Generator) -> Hops:
    """Return the hops of moves from nodes, which have been found to be legal.

    Raises
    ------
    ProblemContractError
        They are not, or not row-wise.
    """

    def ask(nodes: Nodes, moves: Moves) -> Any:
        return asked.ask(
            "hops", nodes, moves.parent, moves.target, moves.t_dep_mjd2000, moves.tof_days
        )

    answer = ask(nodes, moves)
    check_hops_of(asked, "hops", nodes, moves.parent, moves.target, answer)
    hops: Hops = answer
    for what, found, wanted in (
        ("departs", hops.t_dep_mjd2000, moves.t_dep_mjd2000),
        ("arrives", hops.t_arr_mjd2000, moves.t_dep_mjd2000 + moves.tof_days),
    ):
        late = np.abs(found - wanted)
        if late.max() > _SLACK_DAYS:
            row = int(np.argmax(late))
            raise asked.breach(
                "hops",
                f"hop {row} {what} at {found[row]:.6f} MJD2000, asked for {wanted[row]:.6f}",
            )
    for what, rows in regroupings(len(moves), rng, "hop"):
        some = moves.take(rows)
        alone = ask(
            nodes.take(some.parent),
            Moves(np.arange(len(rows)), some.target, some.t_dep_mjd2000, some.tof_days),
        )
        if not same(alone, hops.take(rows), _TOLERANCE):
            raise asked.breach("hops", f"not row-wise: another hop when {what}")
    if len(ask(nodes, moves.take(np.arange(0)))):
        raise asked.breach("hops", "returned hops where none were asked for")
    return hops


def check_hops_of(
    asked: Asked,
    member: str,
    nodes: Nodes,
    parent: NDArray[np.intp],
    target: NDArray[np.intp],
    hops: Any,
) -> None:
    """Raise ProblemContractError where hops from nodes to targets cannot be flown in a row.

    Parameters
    ----------
    asked : Asked
        The problem.
    member : str
        Which of its methods made the hops.
    nodes : Nodes
        Where they start.
    parent, target : (k,) intp
        Positions among the nodes, and catalogue rows.
    hops : object
        The hops.
    """
    _check_form(asked, member, hops, len(parent))
    problem = asked.problem
    first, last = hops.legs[0], hops.legs[-1]
    ids = problem.catalogue.ids
    if not np.array_equal(first.dep_id, ids[nodes.row[parent]]):
        raise asked.breach(member, "a hop does not depart from the body of its node")
    if not np.array_equal(last.arr_id, ids[target]):
        raise asked.breach(member, "a hop does not arrive at its target")
    gap = np.abs(first.m0 - np.maximum(nodes.mass[parent], first.m_dry))
    if gap.max(initial=0.0) > _SLACK_KG:
        row = int(np.argmax(gap))
        raise asked.breach(
            member,
            f"hop {row} departs with {first.m0[row]:g} kg, its node has "
            f"{nodes.mass[parent[row]]:g} kg",
        )
    for number, legs in enumerate(hops.legs):
        _check_ends(asked, f"{member}().legs[{number}]", legs)
    rest = np.zeros((len(last), 3))
    _check_speed(asked, member, last.rv_arr, last.arr_id, hops.t_arr_mjd2000, rest, "arrives")
    under_way = np.flatnonzero(nodes.depth[parent] > 0)
    some = first.take(under_way)
    velocity = nodes.velocity[parent[under_way]]
    assert some.t_dep_mjd2000 is not None
    _check_speed(asked, member, some.rv_dep, some.dep_id, some.t_dep_mjd2000, velocity, "departs")
    for number, (one, other) in enumerate(zip(hops.legs, hops.legs[1:], strict=False), 1):
        _check_joined(asked, f"{member}().legs[{number}]", one, other)


def _check_form(asked: Asked, member: str, hops: Any, n: int) -> None:
    """Check types and lengths."""
    if not isinstance(hops, Hops):
        raise asked.breach(member, f"returned {type(hops).__name__}, expected Hops")
    if not hops.legs or len(hops.legs) != len(hops.dropped_kg):
        raise asked.breach(
            member,
            f"{len(hops.legs)} legs a hop and {len(hops.dropped_kg)} masses left behind, "
            "expected as many of both, one or more",
        )
    craft = asked.problem.spacecraft
    for number, (legs, dropped) in enumerate(zip(hops.legs, hops.dropped_kg, strict=True)):
        label = f"{member}().legs[{number}]"
        if not isinstance(legs, Legs) or len(legs) != n:
            raise asked.breach(label, f"{legs!r}, expected the Legs of {n} hops")
        if legs.t_dep_mjd2000 is None or legs.dep_id is None or legs.arr_id is None:
            raise asked.breach(label, "without t_dep_mjd2000, dep_id and arr_id")
        if not (
            (legs.thrust == craft.thrust).all()
            and (legs.isp == craft.isp).all()
            and (legs.m_dry >= craft.m_dry).all()
        ):
            raise asked.breach(label, "thrust, isp or m_dry are not those of the spacecraft")
        masses = asked.array(f"{member}().dropped_kg[{number}]", dropped, (n,), np.float64)
        if not (np.isfinite(masses) & (masses >= 0.0)).all():
            raise asked.breach(f"{member}().dropped_kg[{number}]", "expected 0 kg or more")


def _check_ends(asked: Asked, label: str, legs: Legs) -> None:
    """Check that legs begin and end where their bodies are then."""
    assert legs.t_dep_mjd2000 is not None
    ends = (
        ("begins", legs.rv_dep, legs.dep_id, legs.t_dep_mjd2000),
        ("ends", legs.rv_arr, legs.arr_id, legs.t_dep_mjd2000 + legs.tof_days),
    )
    for what, states, ids, epochs in ends:
        off = np.linalg.norm(states[:, :3] - _bodies(asked, label, ids, epochs)[:, :3], axis=1)
        if off.max(initial=0.0) > _SLACK_M:
            row = int(np.argmax(off))
            raise asked.breach(label, f"leg {row} {what} {off[row] / 1e3:g} km from its body")


def _check_speed(
    asked: Asked, member: str, states: _Array, ids: Any, epochs: _Array, nodes: _Array, what: str
) -> None:
    """Check that spacecraft move relative to bodies as nodes do: most are at rest there.

    An excess velocity of a leg is no part of its states, so arrivals are those of its bodies.
    """
    bodies = _bodies(asked, member, ids, epochs)[:, 3:]
    off = np.linalg.norm(states[:, 3:] - bodies - nodes, axis=1)
    if off.max(initial=0.0) > _REST_M_S:
        row = int(np.argmax(off))
        expected = float(np.linalg.norm(nodes[row]))
        rest = f"the node's {expected:g} m/s" if expected > 0.0 else "rest"
        raise asked.breach(
            member, f"a hop {what} with {off[row]:g} m/s relative to the body, expected {rest}"
        )


def _check_joined(asked: Asked, label: str, one: Legs, other: Legs) -> None:
    """Check that the second legs of hops begin where and when the first end."""
    assert one.t_dep_mjd2000 is not None
    assert other.t_dep_mjd2000 is not None
    assert one.arr_id is not None
    assert other.dep_id is not None
    wait = np.abs(other.t_dep_mjd2000 - (one.t_dep_mjd2000 + one.tof_days))
    jump = np.abs(other.rv_dep - one.rv_arr)
    if not np.array_equal(other.dep_id, one.arr_id):
        raise asked.breach(label, "does not begin at the body where the leg before ends")
    if wait.max(initial=0.0) > _SLACK_DAYS:
        raise asked.breach(label, f"begins {wait.max():g} days off the end of the leg before")
    if jump[:, :3].max(initial=0.0) > _SLACK_M or jump[:, 3:].max(initial=0.0) > _REST_M_S:
        raise asked.breach(
            label,
            f"begins {jump[:, :3].max() / 1e3:g} km and {jump[:, 3:].max():g} m/s off the state "
            "in which the leg before ends",
        )


def _bodies(asked: Asked, label: str, ids: Any, epochs: Any) -> _Array:
    """Return the (n, 6) states of bodies at epochs."""
    catalogue = asked.problem.catalogue
    strangers = ~np.isin(ids, catalogue.ids)
    if strangers.any():
        raise asked.breach(label, f"body {ids[strangers][0]} is not in the catalogue")
    return catalogue.states_at(catalogue.rows_of(ids), epochs)
