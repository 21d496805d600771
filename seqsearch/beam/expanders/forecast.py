"""Expanders: from nodes to flyable hops, with a pruner on a fixed grid or with a predictor."""

import time
from dataclasses import dataclass
from typing import Final, Protocol, final

import numpy as np
from numpy.typing import NDArray

from feasibility import AllOf
from feasibility.classifier.predictor import LegPredictor, lambert_final_mass
from feasibility.orbits import OrbitalNeighbours
from seqsearch.beam.counters import RankCounters
from seqsearch.beam.forecast import Forecast, Prospects, Survey
from seqsearch.beam.frontiers.depth import Frontier
from seqsearch.beam.rankings.protocol import Ranking
from seqsearch.beam.scouting.guide import Guide
from seqsearch.core.candidates import Candidates, expand, reached
from seqsearch.core.margin_curves import flight_times
from seqsearch.core.nodes import Nodes
from seqsearch.core.optimisation import LegOptimiser, Optimised
from seqsearch.core.problem import Hops, TourProblem
from seqsearch.deadline import Deadline
from seqsearch.pruning.audit import RankSample
from seqsearch.settings import SearchSettings

_SHARPENED: Final = 2.5
"""Pairs whose curve gets a good answer, for each node that can go on."""

_SOLVED: Final = 1.3
"""Hops that are optimised, for each node that can go on."""


@final
@dataclass(frozen=True, eq=False)
class Expanded:
    """What an expansion found.

    Attributes
    ----------
    candidates : Candidates
        The hops that were worth optimising.
    optimised : Optimised
        Those of them that can be flown.
    """

    candidates: Candidates
    optimised: Optimised


class Expander(Protocol):
    """Finds flyable hops from nodes."""

    def expand(
        self,
        nodes: Nodes,
        frontier: Frontier,
        settings: SearchSettings,
        counters: RankCounters,
        sample: RankSample | None,
        deadline: Deadline,
    ) -> Expanded | None:
        """Return the hops found; None where nothing was worth optimising.

        Parameters
        ----------
        nodes : Nodes
            Starts only, or none.
        frontier : Frontier
            Tells which nodes would go on.
        settings : SearchSettings
            Settings of the pass.
        counters : RankCounters
            To be filled in.
        sample : RankSample or None
            To be shown the candidates.
        deadline : Deadline
            After it no new work is begun; what is finished counts.
        """
        ...


@final
class GridExpander:
    """Proposes a fixed grid of flight times, asks a pruner, and optimises what survives.

    Parameters
    ----------
    problem : TourProblem
        What hops there are.
    neighbours : OrbitalNeighbours
        Which targets are proposed.
    pruner : AllOf
        What survives.
    ranking : Ranking
        What is optimised first, by Lambert's estimate of the masses.
    optimiser : LegOptimiser
        How it is optimised.
    """

    def __init__(
        self,
        problem: TourProblem,
        neighbours: OrbitalNeighbours,
        pruner: AllOf,
        ranking: Ranking,
        optimiser: LegOptimiser,
    ) -> None:
        self._problem = problem
        self._neighbours = neighbours
        self._pruner = pruner
        self._ranking = ranking
        self._optimiser = optimiser

    def expand(
        self,
        nodes: Nodes,
        frontier: Frontier,  # noqa: ARG002
        settings: SearchSettings,
        counters: RankCounters,
        sample: RankSample | None,
        deadline: Deadline,
    ) -> Expanded | None:
        """Return the hops found; None where nothing was worth optimising."""
        candidates = self._prune(nodes, settings, counters, sample, deadline)
        if candidates is None:
            return None
        clock = time.perf_counter()
        m_final = lambert_final_mass(candidates.hops.stages[-1])
        promise = self._ranking.score(
            reached(self._problem, nodes, candidates, m_final), self._problem
        )
        optimised = self._optimiser.run(candidates, promise, settings, deadline)
        counters.seconds_optimise = time.perf_counter() - clock
        return Expanded(candidates, optimised)

    def _prune(
        self,
        nodes: Nodes,
        settings: SearchSettings,
        counters: RankCounters,
        sample: RankSample | None,
        deadline: Deadline,
    ) -> Candidates | None:
        """Propose candidates and return those that every pruner keeps."""
        kept = []
        clock = time.perf_counter()
        for block in expand(self._problem, nodes, self._neighbours, settings):
            counters.proposed += len(block)
            counters.seconds_expand += time.perf_counter() - clock
            clock = time.perf_counter()
            mask = keep_hops(self._pruner, block.hops, counters)
            counters.seconds_prune += time.perf_counter() - clock
            clock = time.perf_counter()
            if sample is not None:
                sample.offer(block, mask)
            if mask.any():
                kept.append(block.take(mask))
            if deadline.passed():
                break
        return Candidates.concatenate(kept) if kept else None


@final
class ForecastExpander:
    """Asks a predictor for flight times and masses, and optimises what would go on.

    The pruner is asked about the hops that are left. Hops of which the predictor
    knows nothing are proposed on the grid of flight times, as `GridExpander` does.

    Parameters
    ----------
    problem, neighbours, pruner, ranking, optimiser
        As for `GridExpander`.
    predictor : LegPredictor
        Whom to ask.
    threads : int
        Threads that ask.
    guide : Guide, optional
        Keeps the search to its itineraries; the audit sees the other hops too.
    """

    def __init__(
        self,
        problem: TourProblem,
        neighbours: OrbitalNeighbours,
        pruner: AllOf,
        ranking: Ranking,
        optimiser: LegOptimiser,
        predictor: LegPredictor,
        threads: int,
        guide: Guide | None = None,
    ) -> None:
        self._problem = problem
        self._pruner = pruner
        self._ranking = ranking
        self._optimiser = optimiser
        self._guide = guide
        self._forecast = Forecast(problem, predictor, neighbours, threads)

    def expand(
        self,
        nodes: Nodes,
        frontier: Frontier,
        settings: SearchSettings,
        counters: RankCounters,
        sample: RankSample | None,
        deadline: Deadline,
    ) -> Expanded | None:
        """Return the hops found; None where nothing was worth optimising."""
        prospects, unknown = self._survey(nodes, settings, counters, sample, deadline)
        if deadline.passed():
            return None
        clock = time.perf_counter()
        parts = self._best(nodes, prospects, unknown, frontier, settings, counters)
        if not parts:
            counters.count_pruned({"predictor": counters.proposed})
            return None
        candidates = Candidates.concatenate([part for part, _ in parts])
        found = Nodes.concatenate([part for _, part in parts])
        counters.count_pruned({"predictor": counters.proposed - len(candidates)})
        mask = keep_hops(self._pruner, candidates.hops, counters)
        candidates, found = candidates.take(mask), found.take(mask)
        counters.seconds_prune += time.perf_counter() - clock
        if len(candidates) == 0 or deadline.passed():
            return None
        clock = time.perf_counter()
        promise = self._ranking.score(found, self._problem)
        optimised = self._optimiser.run_all(candidates, promise, settings, deadline)
        counters.seconds_optimise = time.perf_counter() - clock
        return Expanded(candidates, optimised)

    def _survey(
        self,
        nodes: Nodes,
        settings: SearchSettings,
        counters: RankCounters,
        sample: RankSample | None,
        deadline: Deadline,
    ) -> tuple[list[Prospects], list[Candidates]]:
        """Return the prospects, and pairs of which nothing is known."""
        prospects, unknown = [], []
        clock = time.perf_counter()
        for survey in self._forecast.surveys(nodes, settings):
            counters.questions += survey.questions
            counters.proposed += survey.proposed
            if sample is not None:
                self._show(sample, nodes, survey, settings)
            known = survey.prospects
            if self._guide is not None:
                known = known.take(self._guide.allows(nodes, known.parent, known.target))
            if len(known):
                prospects.append(known)
            if len(survey.unknown) and self._guide is None:
                unknown.append(survey.longest.take(survey.unknown))
            if deadline.passed():
                break
        counters.seconds_expand += time.perf_counter() - clock
        return prospects, unknown

    def _show(
        self, sample: RankSample, nodes: Nodes, survey: Survey, settings: SearchSettings
    ) -> None:
        """Show the audit some of the hops, at all flight times, and what is thought of them."""
        count = settings.coarse_flight_times
        pairs = survey.longest
        expected = len(nodes) * settings.neighbours * len(settings.departure_delays_days) * count
        pair, k = np.divmod(np.flatnonzero(sample.thin(len(pairs) * count, expected)), count)
        longest = pairs.hops.tof_days[pair]
        times = flight_times(np.full(len(pair), settings.tof_days_min), longest, count)
        parent, target = pairs.parent[pair], pairs.target[pair]
        hops = self._problem.hops(
            nodes, parent, target, pairs.hops.t_dep_mjd2000[pair], times[np.arange(len(pair)), k]
        )
        kept = survey.hopeful[pair]
        rows = np.flatnonzero(kept)
        kept[rows] = self._forecast.flyable(hops.take(rows), settings)
        rows = np.flatnonzero(kept)
        kept[rows] = keep_hops(self._pruner, hops.take(rows))
        sample.offer(Candidates(parent, target, hops), kept)

    def _best(
        self,
        nodes: Nodes,
        prospects: list[Prospects],
        unknown: list[Candidates],
        frontier: Frontier,
        settings: SearchSettings,
        counters: RankCounters,
    ) -> list[tuple[Candidates, Nodes]]:
        """Return hops that seem worth flying, and the nodes they seem to lead to, in parts."""
        parts: list[tuple[Candidates, Nodes]] = []
        if prospects:
            known = Prospects.concatenate(prospects)
            # Quick answers decide whom to ask again; good ones decide what is optimised.
            for sharp, spare in ((False, _SHARPENED), (True, _SOLVED)):
                if sharp:
                    counters.questions += len(known)
                    known = self._forecast.sharpened(nodes, known, settings)
                candidates, m_final, pair = self._forecast.outlook(nodes, known, settings)
                found = reached(self._problem, nodes, candidates, m_final)
                chosen = frontier.admit(found, spare)
                known = known.take(np.unique(pair[chosen]))
            parts.append((candidates.take(chosen), found.take(chosen)))
        if unknown:
            dark = self._forecast.grid(nodes, Candidates.concatenate(unknown), settings)
            counters.unknown += len(dark)
            m_final = lambert_final_mass(dark.hops.stages[-1])
            parts.append((dark, reached(self._problem, nodes, dark, m_final)))
        return parts


def keep_hops(
    pruner: AllOf, hops: Hops, counters: RankCounters | None = None
) -> NDArray[np.bool_]:
    """Return (n,) bool, where all stages survive; each stage is asked about survivors only."""
    mask = np.ones(len(hops), dtype=np.bool_)
    unknown = np.zeros(len(hops), dtype=np.bool_)
    for legs in hops.stages:
        rows = np.flatnonzero(mask)
        answer = pruner.survivors(legs.take(rows))
        mask[rows] = answer.mask
        unknown[rows] |= answer.unknown
        if counters is not None:
            counters.count_pruned(answer.pruned)
    if counters is not None:
        counters.out_of_domain += int(np.count_nonzero(unknown & mask))
    return mask
