"""Where nodes may go, for how long, and which of them are better."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from feasibility.orbits.varied_legs import regroupings
from seqsearch.core.contract.asking import Asked, same
from seqsearch.core.nodes import Nodes
from seqsearch.settings import SearchSettings

_TARGETS: Final = 40
"""Targets of each node that are asked about, besides those that it has visited."""

_DEPARTURES: Final = 6
_DELAY_DAYS: Final = 40.0
"""Departures of each node that are asked about, and the days between them."""

_SLACK_DAYS: Final = 1e-6
_TOLERANCE: Final = 1e-9
"""A row's answer may depend on the other rows by no more than rounding."""


def check_may_visit(asked: Asked, nodes: Nodes, rng: np.random.Generator) -> NDArray[np.intp]:
    """Return (n, t) targets of n nodes, -1 in place of those that they may not visit.

    Raises
    ------
    ProblemContractError
        The answer is malformed, not row-wise, or allows a body that was visited before.
    """
    n, bodies = len(nodes), len(asked.problem.catalogue)
    before = np.where(nodes.visited < 0, nodes.row[:, None], nodes.visited)
    target = np.column_stack([rng.integers(0, bodies, (n, _TARGETS)), before]).astype(np.intp)
    answer = asked.ask("may_visit", nodes, target)
    allowed = asked.array("may_visit", answer, target.shape, np.bool_)
    again = allowed & (target[:, :, None] == nodes.visited[:, None, :]).any(axis=2)
    if again.any():
        node, column = np.argwhere(again)[0]
        body = asked.problem.catalogue.ids[target[node, column]]
        raise asked.breach("may_visit", f"node {node} may visit body {body} a second time")
    for what, rows in regroupings(n, rng, "node"):
        if not same(asked.ask("may_visit", nodes.take(rows), target[rows]), allowed[rows]):
            raise asked.breach("may_visit", f"not row-wise: another answer when {what}")
    if not same(asked.ask("may_visit", nodes, target[:, ::-1]), allowed[:, ::-1]):
        raise asked.breach("may_visit", "another answer when the targets are reversed")
    return np.where(allowed, target, -1)


def check_days_left(asked: Asked, nodes: Nodes, rng: np.random.Generator) -> None:
    """Raise ProblemContractError where the time that is left is malformed or too much."""
    problem = asked.problem
    delays = _DELAY_DAYS * np.arange(_DEPARTURES)
    departure = nodes.t_ready_mjd2000[:, None] + delays
    starts = bool((nodes.depth == 0).all())
    latest = problem.first_departure_mjd2000[1]
    if starts:
        departure[:, -1] = latest + _DELAY_DAYS
    answer = asked.ask("days_left", nodes, departure)
    left = asked.array("days_left", answer, departure.shape, np.float64)
    if np.isnan(left).any():
        raise asked.breach("days_left", "returned NaN, expected days, or a negative number")
    if starts and (left[departure > latest] >= 0.0).any():
        raise asked.breach(
            "days_left", "not negative for a first departure after the end of the window"
        )
    if not starts and (np.diff(left, axis=1) > 0.0).any():
        raise asked.breach("days_left", "more time is left after a later departure")
    first = departure if starts else nodes.t_first_mjd2000[:, None]
    over = left + (departure - first) - problem.max_duration_days
    if over.max() > _SLACK_DAYS:
        raise asked.breach(
            "days_left",
            f"a tour could last {over.max():g} days longer than max_duration_days",
        )
    for what, rows in regroupings(len(nodes), rng, "node"):
        if not same(asked.ask("days_left", nodes.take(rows), departure[rows]), left[rows]):
            raise asked.breach("days_left", f"not row-wise: another answer when {what}")


def check_tour_cost(
    asked: Asked, nodes: Nodes, settings: SearchSettings, rng: np.random.Generator
) -> None:
    """Raise ProblemContractError where the costs of nodes are malformed."""
    answer = asked.ask("tour_cost", nodes, settings)
    cost = asked.array("tour_cost", answer, (len(nodes),), np.float64)
    if not np.isfinite(cost).all():
        raise asked.breach("tour_cost", f"returned {cost[~np.isfinite(cost)][0]}")
    for what, rows in regroupings(len(nodes), rng, "node"):
        if not same(asked.ask("tour_cost", nodes.take(rows), settings), cost[rows], _TOLERANCE):
            raise asked.breach("tour_cost", f"not row-wise: another answer when {what}")
