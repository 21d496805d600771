"""Which ranks are audited, and how much of them."""

from typing import Protocol, final

import numpy as np

from feasibility import AllOf
from feasibility.classifier.predictor import LegPredictor
from seqsearch.beam.pacing import Pacing
from seqsearch.beam.state import SearchState
from seqsearch.pruning.audit import NoSample, RankSample, Sample


class Auditor(Protocol):
    """Provides the sample of each rank's candidates that the audit looks at."""

    def sample(self, state: SearchState) -> Sample:
        """Return the sample of the next rank."""
        ...


@final
class NoAudit:
    """Audits nothing; an `Auditor`."""

    def sample(self, state: SearchState) -> Sample:  # noqa: ARG002
        """Return a sample that stays empty."""
        return NoSample()


@final
class RankAuditor:
    """Audits each rank for which there is time; an `Auditor`.

    Parameters
    ----------
    solves : int
        Pruned candidates of a rank that are solved.
    predictor : LegPredictor or None
        Sorts candidates by how likely it is that they can be flown.
    pacing : Pacing
        Tells whether there is time.
    rng : numpy.random.Generator
        Stream of the search; it is not advanced.
    """

    def __init__(
        self,
        solves: int,
        predictor: LegPredictor | None,
        pacing: Pacing,
        rng: np.random.Generator,
    ) -> None:
        self._solves = solves
        self._predictor = predictor
        self._pacing = pacing
        self._rng = rng

    def sample(self, state: SearchState) -> Sample:
        """Return the sample of the next rank."""
        if not self._pacing.audits(state.counters):
            return NoSample()
        return RankSample(self._rng, len(state.counters), self._solves, self._predictor)


def make_auditor(
    solves: int,
    pruner: AllOf,
    predictor: LegPredictor | None,
    pacing: Pacing,
    rng: np.random.Generator,
) -> Auditor:
    """Return an auditor; without pruners nothing is pruned that could be audited."""
    if solves == 0 or pruner.pruners == ():
        return NoAudit()
    return RankAuditor(solves, predictor, pacing, rng)
