"""The ranking that the settings name."""

from feasibility import InputError
from feasibility.classifier.predictor import LegPredictor
from feasibility.orbits import OrbitalNeighbours
from seqsearch.beam.rankings.balanced import BalancedRanking
from seqsearch.beam.rankings.pareto import ParetoRanking
from seqsearch.beam.rankings.potential import PotentialRanking
from seqsearch.beam.rankings.protocol import Ranking
from seqsearch.beam.rankings.time_propellant import TimePropellantRanking
from seqsearch.settings import SearchSettings


def make_ranking(
    settings: SearchSettings, predictor: LegPredictor | None, neighbours: OrbitalNeighbours
) -> Ranking:
    """Return the ranking that the settings ask for.

    Raises
    ------
    InputError
        The ranking needs a predictor and there is none.
    """
    weighted = TimePropellantRanking(settings.time_weight, settings.propellant_weight)
    if settings.ranking == "balanced":
        return BalancedRanking(settings.time_weight, settings.propellant_weight)
    if settings.ranking == "pareto":
        return ParetoRanking(weighted)
    if settings.ranking == "potential":
        if predictor is None:
            raise InputError(
                'search: ranking = "potential" asks a classifier, and the pruner has none; '
                'expected pruner = "default" or a model file'
            )
        return PotentialRanking(weighted, predictor, neighbours, weight=settings.potential_weight)
    return weighted
