"""`check_ranking`: tests that a ranking honours the contract of `Ranking`."""

import copy
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility import Spacecraft
from feasibility.orbits import synthetic_main_belt
from seqsearch.beam.rankings.protocol import Ranking
from seqsearch.core.nodes import Nodes
from seqsearch.core.problem import Problem
from seqsearch.problems.rendezvous import RendezvousProblem

_COUNT: Final = 48
"""Nodes that are scored together; the last ones are copies of the first."""

_COPIES: Final = 8
_MAX_DEPTH: Final = 6
_ALONE: Final = 5
_TOLERANCE: Final = 1e-9
"""Sums over the other nodes depend on the order by rounding."""


@final
class RankingContractError(AssertionError):
    """A ranking breaks the contract; the message is one line that says how."""


def check_ranking(
    ranking: Ranking, problem: Problem | None = None, *, rng: np.random.Generator | None = None
) -> None:
    """Test that `ranking` honours the contract of `Ranking`.

    To be called from the tests of whoever writes a ranking. Which nodes it prefers is its own
    affair: the same score for all is legal.

    Parameters
    ----------
    ranking : Ranking
        Called some ten times, with up to 48 nodes of several depths.
    problem : Problem, optional
        Of which the nodes are; a synthetic belt of 200 bodies where not given.
    rng : numpy.random.Generator, optional
        Draws nodes and the permutation; `default_rng(0)` where not given.

    Raises
    ------
    RankingContractError
        The scores have the wrong shape or dtype or are not finite, depend on the order of the
        nodes or change from call to call; `score` raises, be it on a single node, or changes
        the nodes.
    """
    generator = np.random.default_rng(0) if rng is None else rng
    label = f"{type(ranking).__name__}.score"
    if not callable(getattr(ranking, "score", None)):
        raise RankingContractError(f"{type(ranking).__name__}: has no method score")
    problem = _synthetic(generator) if problem is None else problem
    nodes = _varied_nodes(problem, generator)
    score = _ask(ranking, nodes, problem)
    if not np.array_equal(_ask(ranking, nodes, problem), score):
        raise RankingContractError(f"{label}: not pure: two calls with the same nodes differ")
    every = np.arange(len(nodes))
    for what, rows in (("reversed", every[::-1]), ("shuffled", generator.permutation(every))):
        answer = _ask(ranking, nodes.take(rows), problem)
        if not np.allclose(answer, score[rows], _TOLERANCE, _TOLERANCE * np.abs(score).max()):
            raise RankingContractError(
                f"{label}: a node gets another score when the nodes are {what}"
            )
    for row in range(_ALONE):
        _ask(ranking, nodes.take(every[row : row + 1]), problem)


def _ask(ranking: Ranking, nodes: Nodes, problem: Problem) -> NDArray[np.float64]:
    """Return (n,) a copy of the scores of n nodes, which have been found to be legal."""
    label = f"{type(ranking).__name__}.score"
    what = "a single node" if len(nodes) == 1 else f"{len(nodes)} nodes"
    handed = copy.deepcopy(nodes)
    try:
        score = ranking.score(handed, problem)
    except Exception as error:
        message = " ".join(str(error).split())
        raise RankingContractError(
            f"{label}: raised {type(error).__name__} on {what}: {message}"
        ) from error
    columns = Nodes.__dataclass_fields__
    if not all(np.array_equal(getattr(handed, name), getattr(nodes, name)) for name in columns):
        raise RankingContractError(f"{label}: not pure: it changed the nodes")
    if not isinstance(score, np.ndarray):
        raise RankingContractError(
            f"{label}: returned {type(score).__name__} on {what}, expected a numpy array"
        )
    if score.shape != (len(nodes),):
        raise RankingContractError(
            f"{label}: returned shape {score.shape} on {what}, expected ({len(nodes)},)"
        )
    if score.dtype != np.float64:
        raise RankingContractError(
            f"{label}: returned dtype {score.dtype} on {what}, expected float64"
        )
    if not np.isfinite(score).all():
        row = int(np.argmin(np.isfinite(score)))
        raise RankingContractError(f"{label}: returned {score[row]} for node {row} of {what}")
    return score.copy()


def _synthetic(rng: np.random.Generator) -> RendezvousProblem:
    return RendezvousProblem(
        name="synthetic",
        catalogue=synthetic_main_belt(200, rng),
        spacecraft=Spacecraft(m_dry=800.0, thrust=0.3, isp=3000.0),
        m0=2000.0,
        first_departure_mjd2000=(8000.0, 8400.0),
        max_duration_days=2000.0,
        min_stay_days=30.0,
    )


def _varied_nodes(problem: Problem, rng: np.random.Generator) -> Nodes:
    """Draw nodes under way: early and late, heavy and light, some used up, some alike."""
    n = _COUNT
    bodies = len(problem.catalogue)
    depth = rng.integers(1, min(_MAX_DEPTH, bodies - 1) + 1, n)
    trails = np.array([rng.permutation(bodies)[: depth.max() + 1] for _ in range(n)])
    visited = np.where(np.arange(depth.max() + 1) <= depth[:, None], trails, -1)
    earliest, latest = problem.first_departure_mjd2000
    first = rng.uniform(earliest, latest, n)
    # A few have used up all the time, and a few all the propellant.
    elapsed = np.minimum(rng.uniform(0.0, 1.1, n), 1.0)
    left = np.maximum(rng.uniform(-0.1, 1.0, n), 0.0)
    arrival = first + elapsed * problem.max_duration_days
    dry = problem.spacecraft.m_dry
    nodes = Nodes(
        row=visited[np.arange(n), depth].astype(np.intp),
        depth=depth.astype(np.int64),
        t_ready_mjd2000=arrival + problem.min_stay_days,
        t_arr_mjd2000=arrival,
        t_first_mjd2000=first,
        mass=dry + left * (problem.m0 - dry),
        visited=visited.astype(np.intp),
        tree_id=np.arange(n, dtype=np.int64),
        parent_id=np.full(n, -1, dtype=np.int64),
    )
    return Nodes.concatenate([nodes.take(np.arange(n - _COPIES)), nodes.take(np.arange(_COPIES))])
