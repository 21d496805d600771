"""The expander that fits a problem and what is known of its legs."""

from feasibility import InputError
from feasibility.classifier.predictor import LegPredictor
from seqsearch.beam.expanders.custom_moves import CustomMovesExpander
from seqsearch.beam.expanders.forecast import ForecastExpander
from seqsearch.beam.expanders.grid import GridExpander
from seqsearch.beam.expanders.protocol import Expander, ExpanderTools
from seqsearch.beam.scouting.guide import Guide


def make_expander(tools: ExpanderTools, predictor: LegPredictor | None, guide: Guide) -> Expander:
    """Return an expander.

    Parameters
    ----------
    tools : ExpanderTools
        What it works with.
    predictor : LegPredictor or None
        Predicts margins and masses, where there is a trained model.
    guide : Guide
        Keeps the search to some hops.

    Raises
    ------
    InputError
        The problem has moves of its own, which need a predictor, and there is none.
    """
    moves = tools.problem.custom_moves
    if predictor is None:
        if moves is not None:
            raise InputError(
                f"problem {tools.problem.name}: its moves need a trained model, such as the "
                "pruner default:0.99"
            )
        return GridExpander(tools)
    if moves is not None:
        return CustomMovesExpander(tools, moves, predictor)
    return ForecastExpander(tools, predictor, guide)
