"""A frontier and an expander of one's own, handed to `search`."""

import numpy as np
import pytest

from feasibility import AllOf, KeepAll
from feasibility.pruners import PrunerContractError
from seqsearch import TimePropellantRanking, search
from seqsearch.beam.expanders.forecast import ForecastExpander
from seqsearch.beam.expanders.grid import GridExpander
from seqsearch.beam.frontiers.depth import DepthFrontier
from seqsearch.beam.frontiers.protocol import Frontier
from seqsearch.beam.frontiers.time_slices import TimeSliceFrontier
from seqsearch.core.nodes import no_nodes
from tests.helpers.predictors import Toy
from tests.helpers.problems import small_problem, small_settings


class _Counting:
    """Hands all calls on to another object and counts them by method."""

    def __init__(self, inner, calls):
        self._inner = inner
        self._calls = calls

    def __getattr__(self, name):
        method = getattr(self._inner, name)

        def counted(*arguments, **options):
            self._calls[name] = self._calls.get(name, 0) + 1
            return method(*arguments, **options)

        return counted


def _same(result, other):
    assert result.tour == other.tour
    assert len(result.tree) == len(other.tree)
    for one, two in zip(result.counters, other.counters, strict=True):
        assert (one.rank, one.proposed, one.optimised, one.kept) == (
            two.rank,
            two.proposed,
            two.optimised,
            two.kept,
        )


@pytest.fixture(scope="module")
def problem():
    return small_problem(max_duration_days=500.0)


@pytest.mark.parametrize("kind", ["depth", "time"])
def test_a_frontier_of_ones_own_finds_the_tour_of_the_one_it_wraps(problem, kind):
    settings = small_settings(frontier={"kind": kind})
    calls = {}

    def frontier(settings, problem, ranking):
        if kind == "time":
            inner = TimeSliceFrontier(settings, problem, ranking)
        else:
            inner = DepthFrontier(settings.frontier, problem, ranking)
        assert isinstance(inner, Frontier)
        return _Counting(inner, calls)

    own = search(problem, settings=settings, frontier=frontier, rng=np.random.default_rng(4))
    _same(own, search(problem, settings=settings, rng=np.random.default_rng(4)))
    assert set(calls) == {"push", "pop", "admit", "waiting"}


def test_an_expander_of_ones_own_finds_the_tour_of_the_one_it_wraps(problem):
    settings = small_settings()
    calls = {}

    def expander(tools):
        return _Counting(GridExpander(tools), calls)

    own = search(problem, settings=settings, expander=expander, rng=np.random.default_rng(4))
    _same(own, search(problem, settings=settings, rng=np.random.default_rng(4)))
    assert calls["expand"] == len(own.counters)


def test_an_expander_of_ones_own_may_ask_a_predictor(problem):
    settings = small_settings()
    predictor = Toy()

    def found(**own):
        rng = np.random.default_rng(4)
        return search(problem, settings=settings, predictor=predictor, rng=rng, **own)

    _same(found(expander=lambda tools: ForecastExpander(tools, predictor)), found())


def test_one_made_anew_for_each_pass_and_a_ranking_of_ones_own_go_together(problem):
    settings = small_settings(passes=2, beam_width=3, solves_per_rank=60)
    made = []

    def frontier(settings, problem, ranking):
        made.append(ranking)
        return DepthFrontier(settings.frontier, problem, ranking)

    ranking = TimePropellantRanking(1.0, 0.3)
    result = search(problem, settings=settings, ranking=ranking, frontier=frontier)
    assert made == [ranking, ranking]
    assert {record.pass_number for record in result.counters} == {1, 2}


class _Heaviest:
    """Goes on from the heaviest node alone."""

    def __init__(self):
        self._nodes = no_nodes()

    def admit(self, nodes, /, width, spare=1.0):
        return np.argsort(-nodes.mass)[:1]

    def push(self, nodes, /):
        self._nodes = nodes

    def pop(self, width):
        nodes, self._nodes = self._nodes, no_nodes()
        return nodes

    def waiting(self):
        return self._nodes


def test_another_order_of_search_is_a_frontier_of_a_few_lines(problem):
    result = search(
        problem,
        settings=small_settings(solves_per_rank=40),
        frontier=lambda settings, problem, ranking: _Heaviest(),
    )
    kept = [record.kept for record in result.counters]
    assert set(kept) <= {0, 1}
    assert result.tour.n_asteroids >= 2


def test_a_pruner_that_breaks_the_contract_is_refused_before_the_search():
    class Fickle:
        name = "fickle"

        def keep(self, legs, /):
            return np.arange(len(legs)) % 2 == 0

    ranks = []
    with pytest.raises(PrunerContractError, match=r"Fickle\.keep: not row-wise"):
        search(
            small_problem(),
            pruner=AllOf(KeepAll(), Fickle()),
            settings=small_settings(),
            on_rank=ranks.append,
        )
    assert ranks == []
