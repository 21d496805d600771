"""Fig. 2: how much each feature matters to an ensemble of trees."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.paper.features import FEATURES
from feasibility.learning.paper.feature_ranking import N_SAMPLES
from feasibility.study import paper_values
from feasibility.study.context import Context
from feasibility.study.figures import panels
from feasibility.study.result import Result, Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SHOWN: Final = 30
_ELEMENTS: Final = ("classical elements", "modified equinoctial elements")
_POSITIONS: Final = (
    "Cartesian position and velocity",
    "spherical position and velocity",
    "cylindrical position and velocity",
)


def run(context: Context) -> Result:
    """Rank the 103 features by equation 6, averaged over several forests."""
    importances = context.importances
    mean = importances.mean(axis=0)
    deviation = importances.std(axis=0, ddof=1) if len(importances) > 1 else np.zeros(len(mean))
    order = context.ranking
    ranks = np.empty(len(order), dtype=np.int64)
    ranks[order] = np.arange(1, len(order) + 1)
    features = Table(
        name="importance",
        title="The features by falling importance (equation 6)",
        columns=("rank", "feature", "unit", "group", "share of importance", "± (1 sd)"),
        rows=tuple(
            (
                int(ranks[column]),
                FEATURES[column].name,
                FEATURES[column].unit,
                FEATURES[column].group,
                float(mean[column] / mean.sum()),
                float(deviation[column] / mean.sum()),
            )
            for column in order
        ),
        most_rows=_SHOWN,
    )
    groups = tuple(dict.fromkeys(feature.group for feature in FEATURES))
    by_group = Table(
        name="groups",
        title="The groups of Table 2",
        columns=(
            "group",
            "features",
            "best rank",
            "mean rank",
            "share of importance",
            f"among the first {paper_values.SELECTED_FEATURES}",
        ),
        rows=tuple(
            (
                group,
                len(columns),
                int(ranks[columns].min()),
                f"{ranks[columns].mean():.1f}",
                float(mean[columns].sum() / mean.sum()),
                int((ranks[columns] <= paper_values.SELECTED_FEATURES).sum()),
            )
            for group, columns in ((group, _columns((group,))) for group in groups)
        ),
    )
    result = Result(
        name="importance",
        title="Importance of the features (Fig. 2)",
        about=(
            f"Forests trained on {min(N_SAMPLES, len(context.data.pool))} legs of the training "
            f"pool each; importances of {len(importances)} forests averaged. The paper names an "
            "order in words only; the sentences below test it."
        ),
        findings=tuple(_findings(ranks)),
        tables=(by_group, features),
        figures=("importance",),
    )
    result.write(context.out, [_draw(order, mean, deviation)])
    return result


def _columns(groups: Sequence[str]) -> list[int]:
    return [column for column, feature in enumerate(FEATURES) if feature.group in groups]


def _named(name: str) -> int:
    return [feature.name for feature in FEATURES].index(name)


def _findings(ranks: NDArray[np.int64]) -> list[str]:
    def mean_rank(groups: Sequence[str]) -> float:
        return float(ranks[_columns(groups)].mean())

    elements, positions = mean_rank(_ELEMENTS), mean_rank(_POSITIONS)
    momentum = mean_rank(("specific angular momentum",))
    energy = mean_rank(("specific orbital energy",))
    place = {name: int(ranks[_named(name)]) for name in ("tof", "m0", "dt_imp", "lambert_dv")}
    return [
        f"Paper: time of flight and initial mass first. Here: ranks {place['tof']} and "
        f"{place['m0']}.",
        f"Paper: dt_imp and Lambert delta-v high. Here: ranks {place['dt_imp']} and "
        f"{place['lambert_dv']}.",
        "Paper: equinoctial and classical elements above position and velocity. Here: mean rank "
        f"{elements:.0f} against {positions:.0f}, {_agrees(elements < positions)}.",
        f"Paper: angular momentum above energy. Here: mean rank {momentum:.0f} against "
        f"{energy:.0f}, {_agrees(momentum < energy)}.",
    ]


def _agrees(same: bool) -> str:
    return "which agrees" if same else "which does not agree"


def _draw(
    order: NDArray[np.int64], mean: NDArray[np.float64], deviation: NDArray[np.float64]
) -> "Figure":
    figure, (axes,) = panels(1, width=6.4, height=6.0)
    shown = order[:_SHOWN][::-1]
    axes.barh(
        [FEATURES[column].name for column in shown],
        mean[shown] / mean.sum(),
        xerr=deviation[shown] / mean.sum(),
        color="#0072B2",
        error_kw={"linewidth": 0.8},
    )
    axes.tick_params(axis="y", labelsize=7)
    axes.margins(y=0.01)
    axes.set(xlabel="share of importance")
    return figure
