"""`check_ranking`: our rankings pass, and each breach of the contract is named in one line."""

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from feasibility.orbits import OrbitalNeighbours
from seqsearch import Ranking, check_ranking
from seqsearch.beam.rankings import (
    BalancedRanking,
    ParetoRanking,
    PotentialRanking,
    RankingContractError,
    TimePropellantRanking,
    make_ranking,
)
from seqsearch.settings import SearchSettings
from tests.helpers.gtoc5 import toy_problem
from tests.helpers.predictors import Toy
from tests.helpers.problems import small_problem

PROBLEM = small_problem()
NEIGHBOURS = OrbitalNeighbours(PROBLEM.catalogue)


@pytest.mark.parametrize(
    "ranking",
    [
        TimePropellantRanking(),
        TimePropellantRanking(0.0, 1.0),
        BalancedRanking(),
        BalancedRanking(1.0, 0.0),
        ParetoRanking(TimePropellantRanking()),
        ParetoRanking(BalancedRanking()),
        PotentialRanking(TimePropellantRanking(), Toy(), NEIGHBOURS),
    ],
    ids=lambda ranking: type(ranking).__name__,
)
def test_our_rankings_honour_the_contract(ranking):
    assert isinstance(ranking, Ranking)
    check_ranking(ranking, PROBLEM, rng=np.random.default_rng(5))


@pytest.mark.parametrize("name", ["weighted", "balanced", "pareto", "potential"])
def test_the_rankings_that_settings_name_honour_it_on_another_problem(name):
    problem = toy_problem()
    neighbours = OrbitalNeighbours(problem.catalogue)
    check_ranking(make_ranking(SearchSettings(ranking=name), Toy(), neighbours), problem)


@dataclass(frozen=True)
class _By:
    """A ranking made of a function, for the tests of the check."""

    function: Any

    def score(self, nodes, problem, /):
        return self.function(nodes)


_calls = itertools.count()


def _spoil(nodes):
    nodes.mass[:] = 0.0
    return np.zeros(len(nodes))


def _spread(nodes):
    return (nodes.mass - nodes.mass.mean()) / nodes.mass.std(ddof=1)


def _outermost(nodes):
    others = nodes.mass[np.argsort(nodes.mass)]
    return np.minimum(1.0, others[1] - nodes.mass)


def test_scores_may_depend_on_the_other_nodes_and_all_be_the_same():
    check_ranking(_By(lambda nodes: nodes.mass - nodes.mass.mean()))
    check_ranking(_By(lambda nodes: np.zeros(len(nodes))))


@pytest.mark.parametrize(
    ("ranking", "words"),
    [
        (object(), "object: has no method score"),
        (_By(lambda nodes: nodes.mass.tolist()), "returned list on 48 nodes"),
        (_By(lambda nodes: nodes.depth), "dtype int64"),
        (_By(lambda nodes: nodes.mass[:, None]), "shape (48, 1)"),
        (_By(lambda nodes: np.log(np.maximum(nodes.mass - 800.0, 0.0))), "returned -inf for node"),
        (_By(lambda nodes: np.arange(len(nodes)) * 1.0), "when the nodes are reversed"),
        (_By(lambda nodes: np.zeros(len(nodes)) + next(_calls)), "two calls"),
        (_By(_spoil), "it changed the nodes"),
        (_By(_spread), "returned nan for node 0 of a single node"),
        (_By(_outermost), "raised IndexError on a single node: index 1 is out of bounds"),
    ],
)
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_each_breach_of_the_contract_is_named_in_one_line(ranking, words):
    with pytest.raises(RankingContractError) as caught:
        check_ranking(ranking)
    message = str(caught.value)
    assert words in message
    assert "\n" not in message
