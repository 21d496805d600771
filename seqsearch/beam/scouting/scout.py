"""`scout`: one beam in which no leg is optimised, all masses and flight times being predicted."""

from dataclasses import dataclass, replace
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from seqsearch.beam.endings.protocol import Ends
from seqsearch.beam.forecast import Forecast, PairCurves
from seqsearch.beam.frontiers.depth import DepthFrontier
from seqsearch.beam.frontiers.protocol import Frontier
from seqsearch.beam.rankings.balanced import BalancedRanking
from seqsearch.core.candidates import reached
from seqsearch.core.nodes import Nodes
from seqsearch.core.problem import Problem
from seqsearch.settings import SearchSettings

_NEIGHBOURS: Final = 16
"""Targets of a node. On GTOC7 99 of 100 hops that a beam kept went to one of the nearest 15."""

_FLIGHT_TIMES: Final = 5
"""Quick answers for a margin curve. On GTOC7 beams end alike with 5, 6 and 9."""

STRETCHES: Final = (1.0, 1.03, 1.07, 1.12, 1.18, 1.25, 1.4)
"""Flight times in units of the shortest: finer than those that are optimised."""

_SPARE: Final = 2.0
"""Pairs that get a good answer, for each node that goes on."""

_ELAPSED: Final = (0.3, 0.7, 0.8, 0.9)
_WIDTHS: Final = (2.0, 0.3, 0.3, 2.0)
"""Width in units of `beam_width`, by the share of the longest duration that has elapsed.

In the first ranks the score says little about a tour's end: on GTOC7 the best tours of a beam
came from anywhere in its first five ranks, but from the best tenth of its last five. At the end
any node may have just enough left for another visit, and few hops can be flown anyway."""

_LEAVES: Final = 100
"""Itineraries of each of the last two ranks that are returned."""


@final
@dataclass(frozen=True, eq=False)
class Scouted:
    """What a beam of predicted legs found.

    Attributes
    ----------
    leaves : Nodes
        The ends of the best itineraries of the last two ranks, those of the last rank
        first. They are not in the tree, and their masses and epochs are predictions.
    nodes, proposed, questions : int
        Nodes expanded, hops proposed and legs that the predictor was asked about.
    """

    leaves: Nodes
    nodes: int
    proposed: int
    questions: int


def scout(
    problem: Problem, forecast: Forecast, ends: Ends, starts: Nodes, settings: SearchSettings
) -> Scouted:
    """Run a beam in which hops count as flown when the predictor says that they can be.

    Parameters
    ----------
    problem : Problem
        What to solve.
    forecast : Forecast
        Predicts the legs.
    ends : Ends
        Looks to the ends of tours.
    starts : Nodes
        Start nodes, at least one.
    settings : SearchSettings
        Width, caps and weights of the beam; neighbours and flight times are the scout's own.
    """
    ranking = ends.ranking(BalancedRanking(settings.time_weight, settings.propellant_weight))
    counts = np.zeros(3, dtype=np.int64)
    nodes = _numbered(starts)
    ranks = [nodes]
    while True:
        here = settings.with_(
            neighbours=min(_NEIGHBOURS, settings.neighbours),
            coarse_flight_times=_FLIGHT_TIMES,
            flight_time_stretches=STRETCHES,
            beam_width=_width(nodes, problem, settings.beam_width),
        )
        surveys = list(forecast.surveys(nodes, here))
        counts += (
            len(nodes),
            sum(survey.proposed for survey in surveys),
            sum(survey.questions for survey in surveys),
        )
        pairs = [survey.pairs for survey in surveys if len(survey.pairs)]
        if not pairs:
            break
        frontier = ends.frontier(DepthFrontier(here.frontier, problem, ranking))
        children = _children(problem, forecast, nodes, pairs, frontier, here)
        if len(children) == 0:
            break
        nodes = _numbered(children)
        ranks.append(nodes)
    ended = (rank.take(ends.reachable(rank)) for rank in reversed(ranks))
    last = [rank for rank in ended if len(rank)][:2] or ranks[:1]
    leaves = [_best(rank, ranking.score(rank, problem)) for rank in last]
    return Scouted(_numbered(Nodes.concatenate(leaves), -1), *(int(count) for count in counts))


def _children(
    problem: Problem,
    forecast: Forecast,
    nodes: Nodes,
    pairs: list[PairCurves],
    frontier: Frontier,
    settings: SearchSettings,
) -> Nodes:
    """Return the nodes of the next rank: chosen by quick answers first, then by good ones."""
    known = PairCurves.concatenate(pairs)
    candidates, m_final, pair = forecast.outlook(nodes, known, settings)
    quick = reached(problem, nodes, candidates, m_final)
    known = known.take(np.unique(pair[frontier.admit(quick, settings.beam_width, _SPARE)]))
    known = forecast.sharpened(nodes, known, settings)
    candidates, m_final, _ = forecast.outlook(nodes, known, settings)
    enough = m_final - candidates.hops.dropped_kg[-1] >= problem.spacecraft.m_dry
    found = reached(problem, nodes, candidates.take(enough), m_final[enough])
    return found.take(frontier.admit(found, settings.beam_width))


def _width(nodes: Nodes, problem: Problem, width: int) -> int:
    elapsed = float((nodes.t_arr_mjd2000 - nodes.t_first_mjd2000).mean())
    share = elapsed / problem.max_duration_days
    factor = np.exp(np.interp(share, _ELAPSED, np.log(_WIDTHS)))
    return max(1, round(width * float(factor)))


def _best(nodes: Nodes, scores: NDArray[np.float64]) -> Nodes:
    """Return the best nodes, no two of which visited the same bodies."""
    order = np.argsort(scores, kind="stable")
    _, first = np.unique(np.sort(nodes.visited[order], axis=1), axis=0, return_index=True)
    return nodes.take(order[np.sort(first)[:_LEAVES]])


def _numbered(nodes: Nodes, number: int | None = None) -> Nodes:
    """Return nodes with ids of their own, by which their children count as siblings."""
    ids = np.arange(len(nodes)) if number is None else np.full(len(nodes), number)
    return replace(nodes, tree_id=ids.astype(np.int64))
