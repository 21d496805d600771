"""Starts and candidates of a problem that finds them itself."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.predictor import LegPredictor
from seqsearch.core.contract.asking import Asked, same
from seqsearch.core.contract.hops import check_hops_of
from seqsearch.core.contract.starts import check_start_nodes
from seqsearch.core.custom_moves import CustomCandidates, CustomMoves
from seqsearch.core.nodes import Nodes
from seqsearch.settings import SearchSettings

_STARTS: Final = "custom_moves.starts"
_CANDIDATES: Final = "custom_moves.candidates"
_SLACK_DAYS: Final = 1e-6


def check_moves(asked: Asked, settings: SearchSettings, rng: np.random.Generator) -> Nodes | None:
    """Return start nodes of the problem's own moves, found to be legal; None without moves.

    Raises
    ------
    ProblemContractError
        The moves lack a method, or the nodes are not legal.
    """
    moves = asked.problem.custom_moves
    if moves is None:
        return None
    if not isinstance(moves, CustomMoves):
        raise asked.breach(
            "custom_moves", f"{type(moves).__name__} has not both of starts and candidates"
        )
    nodes = asked.ask(_STARTS, settings, rng)
    check_start_nodes(asked, _STARTS, nodes)
    if len(nodes) == 0:
        raise asked.breach(_STARTS, "returned no nodes, expected one or more")
    found: Nodes = nodes
    return found


def check_candidates(
    asked: Asked, nodes: Nodes, settings: SearchSettings, predictor: LegPredictor
) -> None:
    """Raise ProblemContractError where the candidates from nodes are not legal."""
    parts = asked.ask(_CANDIDATES, nodes, settings, predictor, 1)
    if not same(asked.ask(_CANDIDATES, nodes, settings, predictor, 2), parts):
        raise asked.breach(_CANDIDATES, "two threads find something else than one")
    last = 0
    for part in parts:
        _check_form(asked, part, len(nodes))
        if part.parent.min() < last or (np.diff(part.parent) < 0).any():
            raise asked.breach(_CANDIDATES, "not ordered by node")
        last = int(part.parent.max())
        check_hops_of(asked, _CANDIDATES, nodes, part.parent, part.target, part.hops)
        _check_limits(asked, nodes, part)


def _check_form(asked: Asked, part: Any, n: int) -> None:
    """Check types and ranges of a part of the candidates from n nodes."""
    if not isinstance(part, CustomCandidates):
        raise asked.breach(_CANDIDATES, f"yields {type(part).__name__}, expected CustomCandidates")
    k = len(part.hops)
    if k == 0:
        raise asked.breach(_CANDIDATES, "yields no hops, expected one or more, or nothing")
    for name, dtype in (("parent", np.intp), ("target", np.intp), ("m_final", np.float64)):
        asked.array(f"{_CANDIDATES}().{name}", getattr(part, name), (k,), dtype)
    for name, column, size in (
        ("parent", part.parent, n),
        ("target", part.target, len(asked.problem.catalogue)),
    ):
        if column.min() < 0 or column.max() >= size:
            raise asked.breach(f"{_CANDIDATES}().{name}", f"not all are 0 to {size - 1}")
    if not (np.isfinite(part.m_final) & (part.m_final > 0.0)).all():
        raise asked.breach(f"{_CANDIDATES}().m_final", "not all are more than 0 kg")


def _check_limits(asked: Asked, nodes: Nodes, part: CustomCandidates) -> None:
    """Check that hops lead to targets that may be visited, within the time that there is."""
    parent, hops = part.parent, part.hops
    here = nodes.take(parent)
    allowed = asked.ask("may_visit", here, part.target[:, None])[:, 0]
    if not allowed.all():
        row = part.target[np.argmin(allowed)]
        body = asked.problem.catalogue.ids[row]
        raise asked.breach(_CANDIDATES, f"proposes body {body}, which may_visit forbids")
    departure: NDArray[np.float64] = hops.t_dep_mjd2000
    if (departure < here.t_ready_mjd2000 - _SLACK_DAYS).any():
        raise asked.breach(_CANDIDATES, "a hop departs before its node is ready")
    left = asked.ask("days_left", here, departure[:, None])[:, 0]
    over = hops.tof_days - left
    if over.max() > _SLACK_DAYS:
        raise asked.breach(
            _CANDIDATES, f"a hop takes {over.max():g} days longer than days_left says"
        )
