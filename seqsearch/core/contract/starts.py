"""Where tours start: the rows, and the nodes that a problem makes of them."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from feasibility.orbits.varied_legs import regroupings
from seqsearch.core.contract.asking import Asked, same
from seqsearch.core.nodes import Nodes

_COUNT: Final = 24
"""Start nodes that are asked for."""

_TIMES: Final = ("t_ready_mjd2000", "t_arr_mjd2000", "t_first_mjd2000")


def check_starts(asked: Asked, rng: np.random.Generator) -> Nodes:
    """Return start nodes, made at some epochs of the window, which have been found to be legal.

    Raises
    ------
    ProblemContractError
        They are not, or rows of `start_rows` are not.
    """
    allowed = _start_rows(asked)
    earliest, latest = asked.problem.first_departure_mjd2000
    rows = rng.choice(allowed, _COUNT)
    epochs = rng.uniform(earliest, latest, _COUNT)
    answer = asked.ask("start_nodes", rows, epochs)
    check_start_nodes(asked, "start_nodes", answer)
    nodes: Nodes = answer
    if not (np.array_equal(nodes.row, rows) and np.array_equal(nodes.t_arr_mjd2000, epochs)):
        raise asked.breach("start_nodes", "the nodes are not at the rows and epochs asked for")
    for what, some in regroupings(_COUNT, rng, "start"):
        if not same(asked.ask("start_nodes", rows[some], epochs[some]), nodes.take(some)):
            raise asked.breach("start_nodes", f"not row-wise: another node when {what}")
    asked.ask("start_nodes", rows[:0], epochs[:0])
    return nodes


def check_start_nodes(asked: Asked, member: str, nodes: Any) -> None:
    """Raise ProblemContractError where nodes are not such as a tour may start with.

    Parameters
    ----------
    asked : Asked
        The problem.
    member : str
        Which of its methods made them.
    nodes : object
        The nodes.
    """
    problem = asked.problem
    if not isinstance(nodes, Nodes):
        raise asked.breach(member, f"returned {type(nodes).__name__}, expected Nodes")
    _check_columns(asked, member, nodes)
    earliest, latest = problem.first_departure_mjd2000
    outside = (nodes.t_arr_mjd2000 < earliest) | (nodes.t_arr_mjd2000 > latest)
    if outside.any():
        row = int(np.argmax(outside))
        raise asked.breach(
            member,
            f"node {row} starts at {nodes.t_arr_mjd2000[row]:g} MJD2000, expected "
            f"{earliest:g} to {latest:g}",
        )
    if not np.isin(nodes.row, problem.start_rows()).all():
        raise asked.breach(member, "a node is at a body that is not among start_rows")
    wrong = (nodes.mass != problem.m0) | ~np.isfinite(nodes.mass)
    if wrong.any():
        mass = nodes.mass[int(np.argmax(wrong))]
        raise asked.breach(member, f"a mass of {mass:g} kg, expected m0 = {problem.m0:g} kg")
    trail = np.full_like(nodes.visited, -1)
    trail[:, 0] = nodes.row
    expected = {
        "depth": nodes.depth == 0,
        "t_ready_mjd2000": nodes.t_ready_mjd2000 == nodes.t_arr_mjd2000,
        "t_first_mjd2000": nodes.t_first_mjd2000 == nodes.t_arr_mjd2000,
        "visited": (nodes.visited == trail).all(axis=1),
        "tree_id": nodes.tree_id == -1,
        "parent_id": nodes.parent_id == -1,
    }
    for column, right in expected.items():
        if not right.all():
            raise asked.breach(
                member, f"{column} is not that of a start (see Nodes.at_start, which makes them)"
            )


def _start_rows(asked: Asked) -> NDArray[np.intp]:
    problem = asked.problem
    answer = asked.ask("start_rows")
    rows = asked.array("start_rows", answer, np.shape(answer)[:1], np.intp)
    if len(rows) == 0:
        raise asked.breach("start_rows", "returned no rows, expected one or more")
    n = len(problem.catalogue)
    outside = (rows < 0) | (rows >= n)
    if outside.any():
        raise asked.breach(
            "start_rows", f"row {rows[outside][0]} is not in the catalogue of {n} bodies"
        )
    if len(np.unique(rows)) < len(rows):
        raise asked.breach("start_rows", "a row comes twice")
    ids = problem.catalogue.ids[rows].tolist()
    if problem.start_ids and set(ids) != set(problem.start_ids):
        raise asked.breach("start_rows", f"bodies {ids}, but start_ids is {problem.start_ids}")
    return rows


def _check_columns(asked: Asked, member: str, nodes: Nodes) -> None:
    n = len(nodes)
    width = max(1, (*np.shape(nodes.visited), 1, 1)[1])
    shapes: dict[str, tuple[tuple[int, ...], Any]] = {
        "row": ((n,), np.intp),
        "depth": ((n,), np.int64),
        "mass": ((n,), np.float64),
        "visited": ((n, width), np.intp),
        "tree_id": ((n,), np.int64),
        "parent_id": ((n,), np.int64),
    } | dict.fromkeys(_TIMES, ((n,), np.float64))
    for name, (shape, dtype) in shapes.items():
        asked.array(f"{member}().{name}", getattr(nodes, name), shape, dtype)
