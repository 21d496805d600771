"""`ForecastExpander`: a predictor finds flight times and masses, the best hops are optimised."""

import time
from typing import Final, final

import numpy as np

from feasibility.classifier.predictor import LegPredictor, lambert_final_mass
from seqsearch.beam.counters import RankCounters
from seqsearch.beam.expanders.finish import fly_best
from seqsearch.beam.expanders.protocol import ExpanderTools
from seqsearch.beam.forecast import Forecast, PairCurves, Survey
from seqsearch.beam.frontiers.protocol import Frontier
from seqsearch.beam.scouting.guide import Guide, NoGuide
from seqsearch.core.candidates import Candidates, Pairs, on_grid, reached
from seqsearch.core.flown_hops import FlownHops
from seqsearch.core.margin_curves import flight_times
from seqsearch.core.nodes import Nodes
from seqsearch.deadline import Deadline
from seqsearch.pruning.audit import NoSample, Sample
from seqsearch.pruning.hop_pruning import keep_hops
from seqsearch.settings import SearchSettings

_SHARPENED: Final = 2.5
"""Pairs whose curve gets a good answer, for each node that can go on."""

_SOLVED: Final = 1.3
"""Hops that are optimised, for each node that can go on."""


@final
class ForecastExpander:
    """Asks a predictor for flight times and masses, and optimises what would go on.

    The pruner is asked about the hops that are left. Pairs of which the predictor
    knows nothing are proposed on the grid of flight times, as `GridExpander` does.

    Parameters
    ----------
    tools : ExpanderTools
        What it works with.
    predictor : LegPredictor
        Predicts margins and masses.
    guide : Guide, optional
        Keeps the search to some hops; the audit sees the others too.
    """

    def __init__(
        self, tools: ExpanderTools, predictor: LegPredictor, guide: Guide | None = None
    ) -> None:
        self._tools = tools
        self._guide = guide or NoGuide()
        self._forecast = Forecast(tools.problem, predictor, tools.neighbours, tools.threads)

    def expand(
        self,
        nodes: Nodes,
        frontier: Frontier,
        settings: SearchSettings,
        counters: RankCounters,
        sample: Sample,
        deadline: Deadline,
    ) -> FlownHops:
        """Return the flyable hops found and what it took."""
        tools = self._tools
        pairs, unknown = self._survey(nodes, settings, counters, sample, deadline)
        if deadline.passed():
            return FlownHops.none()
        clock = time.perf_counter()
        parts = self._best(nodes, pairs, unknown, frontier, settings, counters)
        if not parts:
            counters.count_pruned({"predictor": counters.proposed})
            return FlownHops.none()
        candidates = Candidates.concatenate([part for part, _ in parts])
        found = Nodes.concatenate([part for _, part in parts])
        counters.count_pruned({"predictor": counters.proposed - len(candidates)})
        counters.seconds_prune += time.perf_counter() - clock
        # The audit has seen all candidates by now, not only the best.
        best = candidates, found
        return fly_best(tools, nodes, best, settings, counters, NoSample(), deadline)

    def _survey(
        self,
        nodes: Nodes,
        settings: SearchSettings,
        counters: RankCounters,
        sample: Sample,
        deadline: Deadline,
    ) -> tuple[list[PairCurves], list[Pairs]]:
        """Return the pairs with their curves, and pairs of which nothing is known."""
        pairs, unknown = [], []
        clock = time.perf_counter()
        # The audit looks beyond the guide, so that it sees what any pass would have pruned.
        allows = None if sample.wanted or self._guide.free else self._guide.allows
        for survey in self._forecast.surveys(nodes, settings, allows):
            counters.questions += survey.questions
            counters.proposed += survey.proposed
            if sample.wanted:
                self._show(sample, nodes, survey, settings)
            known = survey.pairs
            known = known.take(self._guide.allows(nodes, known.parent, known.target))
            if len(known):
                pairs.append(known)
            if len(survey.unknown) and self._guide.free:
                unknown.append(survey.unknown)
            if deadline.passed():
                break
        counters.seconds_expand += time.perf_counter() - clock
        return pairs, unknown

    def _show(
        self, sample: Sample, nodes: Nodes, survey: Survey, settings: SearchSettings
    ) -> None:
        """Show the audit some of the hops, at all flight times, and what is thought of them."""
        count = settings.coarse_flight_times
        pairs = survey.all_pairs
        expected = len(nodes) * settings.neighbours * len(settings.departure_delays_days) * count
        pair, k = np.divmod(np.flatnonzero(sample.thin(len(pairs) * count, expected)), count)
        longest = pairs.days_left[pair]
        times = flight_times(np.full(len(pair), settings.tof_days_min), longest, count)
        parent, target = pairs.parent[pair], pairs.target[pair]
        hops = self._tools.problem.hops(
            nodes, parent, target, pairs.t_dep_mjd2000[pair], times[np.arange(len(pair)), k]
        )
        kept = survey.hopeful[pair]
        rows = np.flatnonzero(kept)
        kept[rows] = self._forecast.flyable(hops.take(rows), settings)
        rows = np.flatnonzero(kept)
        kept[rows] = keep_hops(self._tools.pruner, hops.take(rows)).mask
        sample.offer(Candidates(parent, target, hops), kept)

    def _best(
        self,
        nodes: Nodes,
        pairs: list[PairCurves],
        unknown: list[Pairs],
        frontier: Frontier,
        settings: SearchSettings,
        counters: RankCounters,
    ) -> list[tuple[Candidates, Nodes]]:
        """Return hops that seem worth flying, and the nodes they seem to lead to, in parts."""
        problem = self._tools.problem
        parts: list[tuple[Candidates, Nodes]] = []
        if pairs:
            known = PairCurves.concatenate(pairs)
            # Quick answers decide which pairs get a good answer; those decide what is optimised.
            for sharp, spare in ((False, _SHARPENED), (True, _SOLVED)):
                if sharp:
                    counters.questions += len(known)
                    known = self._forecast.sharpened(nodes, known, settings)
                candidates, m_final, pair = self._forecast.outlook(nodes, known, settings)
                found = reached(problem, nodes, candidates, m_final)
                chosen = frontier.admit(found, settings.beam_width, spare)
                known = known.take(np.unique(pair[chosen]))
            parts.append((candidates.take(chosen), found.take(chosen)))
        if unknown:
            dark = on_grid(problem, nodes, Pairs.concatenate(unknown), settings)
            if dark is not None:
                counters.unknown += len(dark)
                m_final = lambert_final_mass(dark.hops.legs[-1])
                parts.append((dark, reached(problem, nodes, dark, m_final)))
        return parts
