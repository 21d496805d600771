"""`check_problem`: tests that a problem honours the contract of `Problem`."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.predictor import LegPredictor, lambert_final_mass
from seqsearch.core.candidates import Candidates, reached
from seqsearch.core.contract.asking import Asked, ProblemContractError
from seqsearch.core.contract.closing import check_closing
from seqsearch.core.contract.facts import check_facts, check_members
from seqsearch.core.contract.hops import Moves, check_hops
from seqsearch.core.contract.limits import check_days_left, check_may_visit, check_tour_cost
from seqsearch.core.contract.moves import check_candidates, check_moves
from seqsearch.core.contract.rules import check_rules
from seqsearch.core.contract.starts import check_starts
from seqsearch.core.nodes import Nodes
from seqsearch.core.problem import Problem
from seqsearch.settings import SearchSettings

__all__ = ["ProblemContractError", "check_problem"]

_HOPS: Final = 60
"""Hops that are asked for from one batch of nodes."""

_EXPANDED: Final = 3
"""Nodes of one batch from which candidates are asked for: a predictor may be slow."""

_TOF_DAYS: Final = (60.0, 300.0)
_VISITS: Final = 2
"""Depth of the nodes that are asked about."""

_SETTINGS: Final = SearchSettings(start_epochs=6, neighbours=20)


def check_problem(
    problem: Problem,
    *,
    predictor: LegPredictor | None = None,
    rng: np.random.Generator | None = None,
) -> None:
    """Test that `problem` honours the contract of `Problem`.

    To be called from the tests of whoever writes a problem, with a catalogue of some hundred
    bodies. Starts are drawn, hops to bodies that may be visited are asked for, and again from
    where those lead; every method is asked several times, also of a pickled copy.

    Parameters
    ----------
    problem : Problem
        The problem.
    predictor : LegPredictor, optional
        Without it the candidates of a problem's own moves are not tested.
    rng : numpy.random.Generator, optional
        Draws starts, targets and times; `default_rng(0)` where not given.

    Raises
    ------
    ProblemContractError
        The problem breaks the contract; the message is one line that names the member.
    """
    generator = np.random.default_rng(0) if rng is None else rng
    check_members(problem)
    asked = Asked(problem)
    check_facts(asked)
    nodes = check_starts(asked, generator)
    custom = check_moves(asked, _SETTINGS, generator)
    check_rules(asked, nodes)
    batches = [nodes]
    for _ in range(_VISITS):
        found = _check_from(asked, batches[-1], generator)
        if found is None:
            break
        batches.append(found)
    expanded = [] if custom is None else [custom]
    if len(batches) > 1:
        # A frontier may mix nodes of all depths but the first.
        under_way = Nodes.concatenate(batches[1:])
        _check_from(asked, under_way, generator)
        expanded += [] if custom is None else [under_way]
    if predictor is not None:
        for some in expanded:
            few = np.linspace(0, len(some) - 1, min(_EXPANDED, len(some))).astype(np.intp)
            check_candidates(asked, some.take(few), _SETTINGS, predictor)


def _check_from(asked: Asked, nodes: Nodes, rng: np.random.Generator) -> Nodes | None:
    """Check what a problem says of nodes; return nodes to which hops lead, None for none."""
    target = check_may_visit(asked, nodes, rng)
    check_days_left(asked, nodes, rng)
    check_tour_cost(asked, nodes, _SETTINGS, rng)
    check_closing(asked, nodes)
    moves = _moves(asked.problem, nodes, target, rng)
    if len(moves) == 0:
        return None
    hops = check_hops(asked, nodes, moves, rng)
    candidates = Candidates(moves.parent, moves.target, hops)
    return reached(asked.problem, nodes, candidates, lambert_final_mass(hops.legs[-1]))


def _moves(
    problem: Problem, nodes: Nodes, target: NDArray[np.intp], rng: np.random.Generator
) -> Moves:
    """Draw hops that the problem allows.

    Parameters
    ----------
    problem : Problem
        Says how long they may take.
    nodes : Nodes
        n nodes.
    target : (n, t) intp
        Targets of each, -1 for none.
    rng : numpy.random.Generator
        Draws.
    """
    left = problem.days_left(nodes, nodes.t_ready_mjd2000[:, None])[:, 0]
    parent, column = np.nonzero((target >= 0) & (left > 0.0)[:, None])
    some = np.sort(rng.permutation(len(parent))[:_HOPS])
    parent, column = parent[some], column[some]
    longest = np.minimum(_TOF_DAYS[1], 0.5 * left[parent])
    tof = rng.uniform(np.minimum(_TOF_DAYS[0], 0.5 * longest), longest)
    return Moves(parent, target[parent, column], nodes.t_ready_mjd2000[parent], tof)
