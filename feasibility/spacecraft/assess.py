"""Whether a model is good enough for a spacecraft, judged on freshly solved legs of it."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.classifier import FeasibilityClassifier
from feasibility.dataset import Dataset
from feasibility.errors import InputError
from feasibility.pruners.classifier import ClassifierPruner

LEAST_IN_DOMAIN: Final = 0.95
LEAST_BALANCED_ACCURACY: Final = 0.99
LEAST_WITHIN_15_PERCENT: Final = 0.97
"""A model is good enough from these shares on, where its pruner's recall is as asked."""

EXIT_CODES: Final = {"good enough": 0, "retrain": 3, "too few legs": 4}
"""Of the command, by verdict; 1 and 2 are failures of any command."""

LEAST_OF_A_CLASS: Final = 50
LEAST_NEAR: Final = 100
"""With fewer legs of a class, or within 15 % of the boundary, nothing is said."""

CONFIDENCE: Final = 0.95
"""Probability with which an interval holds the true share."""


@final
@dataclass(frozen=True)
class Share:
    """A share that was counted.

    Attributes
    ----------
    count, of : int
        How often it was so, and of how many.
    """

    count: int
    of: int

    @property
    def value(self) -> float:
        """The share; 0 of nothing."""
        return self.count / self.of if self.of else 0.0

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's interval that holds the true share with probability `CONFIDENCE`.

        Wilson 1927, "Probable inference, the law of succession, and statistical inference".
        """
        if not self.of:
            return 0.0, 1.0
        from scipy.stats import binomtest

        interval = binomtest(self.count, self.of).proportion_ci(CONFIDENCE, method="wilson")
        # Rounding must not leave the share itself out.
        return min(float(interval.low), self.value), max(float(interval.high), self.value)

    def __str__(self) -> str:
        low, high = self.interval
        return f"{self.value:.4f} ({low:.4f} to {high:.4f}; {self.count} of {self.of})"


@final
@dataclass(frozen=True)
class Assessment:
    """How a model does on legs of one spacecraft; intervals hold with probability 0.95.

    Attributes
    ----------
    legs, unsolved : int
        Legs judged, and those whose m* the solver did not find.
    balanced_accuracy : float
        Mean of the shares of feasible and of infeasible legs that are judged rightly at
        probability 0.5, among legs that were not drawn near the boundary.
    balanced_interval : pair of float
        Mean of the ends of both shares' intervals.
    within_15_percent, within_5_percent : Share
        Right answers among legs so near to the boundary, by abs(m*/m0 - 1).
    in_domain : Share
        Legs that the model knows.
    recall_asked, threshold : float
        Of the pruner.
    recall, precision : Share
        Feasible legs that the pruner keeps, and kept legs that are feasible.
    verdict : str
        "good enough", "retrain" or "too few legs".
    reasons : tuple of str
        What speaks against "good enough".
    """

    legs: int
    unsolved: int
    balanced_accuracy: float
    balanced_interval: tuple[float, float]
    within_15_percent: Share
    within_5_percent: Share
    in_domain: Share
    recall_asked: float
    threshold: float
    recall: Share
    precision: Share
    verdict: str
    reasons: tuple[str, ...]

    def text(self) -> str:
        """Return the figures and the verdict as lines for people."""
        from tabulate import tabulate

        low, high = self.balanced_interval
        rows = [
            ("legs", f"{self.legs} solved, {self.unsolved} without m*"),
            ("balanced accuracy", f"{self.balanced_accuracy:.4f} ({low:.4f} to {high:.4f})"),
            ("within 15 % of the boundary", self.within_15_percent),
            ("within 5 % of the boundary", self.within_5_percent),
            ("in the model's domain", self.in_domain),
            ("recall of the pruner", f"{self.recall}, {self.recall_asked:g} asked"),
            ("precision of the pruner", self.precision),
        ]
        table = tabulate(rows, tablefmt="plain", disable_numparse=True)
        reasons = "".join(f"\n  {reason}" for reason in self.reasons)
        return f"{table}\n\nverdict: {self.verdict}{reasons}\n"

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain data."""
        plain = asdict(self)
        for name, value in vars(self).items():
            if isinstance(value, Share):
                plain[name] |= {"value": value.value, "interval": list(value.interval)}
        return plain


def assess(
    classifier: FeasibilityClassifier, datasets: Sequence[Dataset], recall: float = 0.99
) -> Assessment:
    """Judge a model on solved legs of one spacecraft.

    Parameters
    ----------
    classifier : FeasibilityClassifier
        The model.
    datasets : sequence of Dataset
        Legs with m*, some of them drawn near the boundary.
    recall : float
        Recall of the pruner that is judged.

    Raises
    ------
    InputError
        `recall` is out of range, or no leg has an m*.
    """
    pruner = ClassifierPruner(classifier, recall)
    solved = [dataset.take(np.flatnonzero(dataset.labelled)) for dataset in datasets]
    if not sum(len(part) for part in solved):
        raise InputError("assess: the solver found m* of no leg; expected legs that can be solved")
    log_margin = np.concatenate([part.columns["log_margin"] for part in solved])
    drawn_near = np.concatenate([part.columns["boundary_draw"] for part in solved])
    answers = [classifier.assess(part.legs) for part in solved]
    probability, inside = (np.concatenate(column) for column in zip(*answers, strict=True))
    feasible = log_margin >= 0.0
    likely = probability >= 0.5
    kept = (probability >= pruner.threshold) | ~inside
    natural = ~drawn_near
    sides = [_share(likely, feasible & natural), _share(~likely, ~feasible & natural)]
    near = {
        width: _share(likely == feasible, np.abs(np.expm1(log_margin)) <= width)
        for width in (0.15, 0.05)
    }
    figures: dict[str, Any] = {
        "balanced_accuracy": 0.5 * (sides[0].value + sides[1].value),
        "within_15_percent": near[0.15],
        "in_domain": _share(inside, np.ones(len(inside), dtype=np.bool_)),
        "recall_asked": recall,
        "recall": _share(kept, feasible),
    }
    verdict, reasons = judgement(sides=sides, **figures)
    return Assessment(
        legs=len(feasible),
        unsolved=sum(len(dataset) for dataset in datasets) - len(feasible),
        balanced_interval=(
            0.5 * sum(side.interval[0] for side in sides),
            0.5 * sum(side.interval[1] for side in sides),
        ),
        within_5_percent=near[0.05],
        threshold=pruner.threshold,
        precision=_share(feasible, kept),
        verdict=verdict,
        reasons=reasons,
        **figures,
    )


def judgement(
    *,
    sides: Sequence[Share],
    balanced_accuracy: float,
    within_15_percent: Share,
    in_domain: Share,
    recall_asked: float,
    recall: Share,
) -> tuple[str, tuple[str, ...]]:
    """Return the verdict and its reasons: docs/guide/spacecraft.md states the rule.

    Parameters are those of `Assessment`; `sides` are the shares behind the balanced accuracy.
    """
    few = [
        f"{side.of} {name} legs, {LEAST_OF_A_CLASS} needed"
        for side, name in zip(sides, ("feasible", "infeasible"), strict=True)
        if side.of < LEAST_OF_A_CLASS
    ]
    if within_15_percent.of < LEAST_NEAR:
        few.append(f"{within_15_percent.of} legs near the boundary, {LEAST_NEAR} needed")
    if few:
        few.append(_advice([*sides, within_15_percent], legs=in_domain.of))
        return "too few legs", tuple(few)
    against = []
    if in_domain.value < LEAST_IN_DOMAIN:
        against.append(f"in domain {in_domain.value:.4f}, below {LEAST_IN_DOMAIN:g}")
    if balanced_accuracy < LEAST_BALANCED_ACCURACY:
        against.append(
            f"balanced accuracy {balanced_accuracy:.4f}, below {LEAST_BALANCED_ACCURACY:g}"
        )
    if within_15_percent.value < LEAST_WITHIN_15_PERCENT:
        against.append(
            f"within 15 % {within_15_percent.value:.4f}, below {LEAST_WITHIN_15_PERCENT:g}"
        )
    if recall.interval[1] < recall_asked:
        against.append(f"recall surely below {recall_asked:g}: at most {recall.interval[1]:.5f}")
    return ("retrain" if against else "good enough"), tuple(against)


def _advice(counted: Sequence[Share], legs: int) -> str:
    """Return how many legs are probably enough; each share needs as many as its class has."""
    needed = (LEAST_OF_A_CLASS, LEAST_OF_A_CLASS, LEAST_NEAR)
    missing = [share.of == 0 for share in counted]
    if any(missing):
        return "give more --legs, or a wider m0_kg or [sampling]: of one kind there was none"
    factor = max(least / share.of for least, share in zip(needed, counted, strict=True))
    # A quarter more: counts scatter.
    enough = int(np.ceil(1.25 * factor * legs / 100.0)) * 100
    return f"about {enough} legs are needed: give --legs {enough}, or a wider m0_kg or [sampling]"


def _share(right: NDArray[np.bool_], among: NDArray[np.bool_]) -> Share:
    return Share(int(np.sum(right & among)), int(np.sum(among)))
