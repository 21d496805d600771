"""`assemble`: everything that a search works with, made once from what it was given."""

from concurrent.futures import Executor
from dataclasses import dataclass
from typing import final

import numpy as np

from feasibility import AllOf, Pruner
from feasibility.classifier.predictor import LegPredictor
from feasibility.orbits import OrbitalNeighbours
from feasibility.pruners import quick_check
from seqsearch.beam.auditing import Auditor, make_auditor
from seqsearch.beam.best_tour import Best
from seqsearch.beam.endings.make import make_ends
from seqsearch.beam.endings.protocol import Ends
from seqsearch.beam.expanders.make import make_expander
from seqsearch.beam.expanders.protocol import Expander, ExpanderTools, MakeExpander
from seqsearch.beam.frontiers.make import make_frontier
from seqsearch.beam.frontiers.protocol import Frontier, MakeFrontier
from seqsearch.beam.pacing import ClockPacing, FixedPacing, Pacing
from seqsearch.beam.passes import Passes
from seqsearch.beam.rankings.make import make_ranking
from seqsearch.beam.rankings.protocol import Ranking
from seqsearch.beam.scouting.charted import ChartedPasses, chart_fits
from seqsearch.beam.scouting.generations import NoScouting, ScoutedPasses, Scouting
from seqsearch.beam.scouting.guide import Guide, guide_to
from seqsearch.beam.scouting.scouts import Scouts
from seqsearch.beam.starts import make_starts
from seqsearch.beam.state import SearchState
from seqsearch.budget import Budget
from seqsearch.core.optimisation import LegOptimiser
from seqsearch.core.possible import check_possible
from seqsearch.core.problem import Problem
from seqsearch.problems.rendezvous import RendezvousProblem
from seqsearch.pruning.pruner_spec import parse_pruner, predictor_of
from seqsearch.settings import SearchSettings


@final
@dataclass(frozen=True, eq=False)
class Beam:
    """What one pass works with.

    Attributes
    ----------
    guide : Guide
        Which hops it may look at.
    expander : Expander
        Finds flyable hops.
    frontier : Frontier
        Which nodes go on.
    """

    guide: Guide
    expander: Expander
    frontier: Frontier


@final
@dataclass(frozen=True, eq=False)
class OwnParts:
    """Parts that the caller of a search brings in place of those that the settings name.

    Attributes
    ----------
    ranking : Ranking or None
        Which nodes go on.
    frontier : callable or None
        Makes the frontier of each pass.
    expander : callable or None
        Makes the expander of each pass.
    """

    ranking: Ranking | None = None
    frontier: MakeFrontier | None = None
    expander: MakeExpander | None = None

    @property
    def none(self) -> bool:
        """Whether there are none."""
        return self.ranking is None and self.frontier is None and self.expander is None


@final
@dataclass(frozen=True, eq=False)
class Tools:
    """What a search works with.

    Attributes
    ----------
    problem : Problem
        What to solve.
    budget : Budget
        When to stop.
    passes : Passes
        Begins one beam after another.
    pacing : Pacing
        How wide beams are.
    auditor : Auditor
        What is audited.
    best : Best
        Remembers the best tour.
    optimiser : LegOptimiser
        Solves legs.
    rng : numpy.random.Generator
        Stream of the search.
    """

    problem: Problem
    budget: Budget
    passes: Passes
    pacing: Pacing
    auditor: Auditor
    best: Best
    optimiser: LegOptimiser
    rng: np.random.Generator
    _ends: Ends
    _neighbours: OrbitalNeighbours
    _pruner: AllOf
    _predictor: LegPredictor | None
    _own: OwnParts
    _threads: int

    def beam(self, state: SearchState) -> Beam:
        """Return what the pass works with that the state is in.

        Raises
        ------
        InputError
            A ranking or a problem's own moves need a predictor, and there is none.
        """
        guide = guide_to(state.guide)
        settings = guide.settings(state.settings)
        ranking = self._own.ranking or make_ranking(settings, self._predictor, self._neighbours)
        ranking = self._ends.ranking(ranking)
        tools = ExpanderTools(
            self.problem,
            self._neighbours,
            self._pruner,
            ranking,
            self.optimiser,
            self._threads,
        )
        own = self._own
        return Beam(
            guide,
            own.expander(tools) if own.expander else make_expander(tools, self._predictor, guide),
            self._ends.frontier((own.frontier or make_frontier)(settings, self.problem, ranking)),
        )


def assemble(
    problem: Problem,
    settings: SearchSettings,
    *,
    pruner: Pruner | None,
    predictor: LegPredictor | None,
    audit_predictor: LegPredictor | None,
    own: OwnParts,
    rng: np.random.Generator,
    executor: Executor | None,
    threads: int,
    budget: Budget,
) -> Tools:
    """Return the tools of a search; see `seqsearch.search` for the parameters.

    Raises
    ------
    InputError
        A pruner specification that cannot be read, or a mission in which no hop fits.
    """
    check_possible(problem, settings)
    pruner = pruner or parse_pruner(settings.pruner)
    pruner = pruner if isinstance(pruner, AllOf) else AllOf(pruner)
    quick_check(pruner)
    predictor = predictor or predictor_of(pruner)
    timed = budget.deadline.remaining_s() is not None
    pacing = ClockPacing(problem, budget.deadline, settings) if timed else FixedPacing()
    neighbours = OrbitalNeighbours(
        problem.catalogue, reference_tof_days=settings.reference_tof_days
    )
    ends = make_ends(problem, predictor, threads)
    optimiser = LegOptimiser(executor)
    best = ends.best(settings, optimiser, budget)
    scouting: Scouting = NoScouting()
    if predictor is not None and own.none and _scouts_fit(problem, settings, timed=timed):
        scouts = Scouts(problem, predictor, settings, executor)
        scouting = ScoutedPasses(scouts, pacing, budget, threads)
        if isinstance(problem, RendezvousProblem) and chart_fits(
            problem, settings, budget, threads
        ):
            scouting = ChartedPasses(
                scouting,
                problem,
                predictor,
                settings,
                best=best,
                budget=budget,
                executor=executor,
                threads=threads,
            )
    passes = Passes(
        problem,
        settings.passes,
        pacing=pacing,
        scouting=scouting,
        starts=make_starts(problem, neighbours, predictor, threads),
        best=best,
        budget=budget,
        rng=rng,
    )
    return Tools(
        problem,
        budget,
        passes,
        pacing,
        make_auditor(settings.audit.per_rank, pruner, audit_predictor or predictor, pacing, rng),
        best,
        optimiser,
        rng,
        ends,
        neighbours,
        pruner,
        predictor,
        own,
        threads,
    )


def _scouts_fit(problem: Problem, settings: SearchSettings, *, timed: bool) -> bool:
    """Tell whether a search sends out scouts, if it has a predictor and all parts are ours."""
    wanted = settings.scouts.share if timed else settings.scouts.generations
    plain = settings.ranking in ("weighted", "balanced") and settings.frontier.kind == "depth"
    return bool(wanted) and plain and problem.custom_moves is None
