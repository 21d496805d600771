"""Measures of a binary classifier: equations 11 to 14 of the paper, ROC, calibration.

Everywhere n is the number of legs, `y` (n,) bool whether a leg is feasible
(the positive class) and `probability` (n,) float64 in [0, 1] the estimate of
it. A ratio whose denominator is zero is 0.
"""

from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from feasibility.errors import InputError

_LEAST_PROBABILITY: Final = 1e-15
"""Log loss counts a certain error as one with this probability."""


@final
@dataclass(frozen=True)
class Confusion:
    """Counts of right and wrong answers."""

    true_positive: int
    false_positive: int
    true_negative: int
    false_negative: int

    @classmethod
    def of(cls, y: ArrayLike, predicted: ArrayLike) -> "Confusion":
        """Count for labels and answers, both (n,) bool.

        Raises
        ------
        InputError
            The shapes differ, or there is no row.
        """
        truth, answer = np.asarray(y, dtype=np.bool_), np.asarray(predicted, dtype=np.bool_)
        _check(truth, answer)
        return cls(
            int(np.sum(truth & answer)),
            int(np.sum(~truth & answer)),
            int(np.sum(~truth & ~answer)),
            int(np.sum(truth & ~answer)),
        )

    @property
    def accuracy(self) -> float:
        """Equation 11: share of right answers."""
        right = self.true_positive + self.true_negative
        return right / (right + self.false_positive + self.false_negative)

    @property
    def precision(self) -> float:
        """Equation 12: share of feasible legs among those said to be feasible."""
        return _ratio(self.true_positive, self.true_positive + self.false_positive)

    @property
    def recall(self) -> float:
        """Equation 13: share of the feasible legs that are found."""
        return _ratio(self.true_positive, self.true_positive + self.false_negative)

    @property
    def specificity(self) -> float:
        """Share of the infeasible legs that are found."""
        return _ratio(self.true_negative, self.true_negative + self.false_positive)

    @property
    def balanced_accuracy(self) -> float:
        """Mean of recall and specificity."""
        return 0.5 * (self.recall + self.specificity)

    def f_score(self, k: float) -> float:
        """Equation 14: F_k = (1 + k^2) P R / (k^2 P + R); large k weighs recall."""
        precision, recall = self.precision, self.recall
        return _ratio((1.0 + k * k) * precision * recall, k * k * precision + recall)


def roc_curve(
    y: ArrayLike, probability: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return the receiver operating characteristic.

    Returns
    -------
    false_positive_rate, true_positive_rate, thresholds : (t,) float64
        For the answers ``probability >= threshold``, thresholds falling from
        infinity through the distinct probabilities.

    Raises
    ------
    InputError
        The shapes differ, or a class is missing.
    """
    truth, score = np.asarray(y, dtype=np.bool_), np.asarray(probability, dtype=np.float64)
    _check(truth, score)
    positives = int(truth.sum())
    if positives in (0, len(truth)):
        raise InputError("ROC: only one class is there, expected feasible and infeasible legs")
    order = np.argsort(-score, kind="stable")
    truth, score = truth[order], score[order]
    last_of_value = np.append(score[1:] != score[:-1], True)
    hits = np.cumsum(truth)[last_of_value]
    answered = np.flatnonzero(last_of_value) + 1
    true_rate = np.append(0.0, hits / positives)
    false_rate = np.append(0.0, (answered - hits) / (len(truth) - positives))
    return false_rate, true_rate, np.append(np.inf, score[last_of_value])


def auc(y: ArrayLike, probability: ArrayLike) -> float:
    """Return the area under the ROC curve by the trapezoidal rule.

    Raises
    ------
    InputError
        As for `roc_curve`.
    """
    false_rate, true_rate, _ = roc_curve(y, probability)
    return float(np.trapezoid(true_rate, false_rate))


def log_loss(y: ArrayLike, probability: ArrayLike) -> float:
    """Return the mean cross-entropy in nats."""
    truth, score = np.asarray(y, dtype=np.bool_), np.asarray(probability, dtype=np.float64)
    _check(truth, score)
    right = np.where(truth, score, 1.0 - score)
    return float(-np.mean(np.log(np.maximum(right, _LEAST_PROBABILITY))))


def reliability(
    y: ArrayLike, probability: ArrayLike, n_bins: int = 15
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Return what a reliability diagram shows, by bins of equal width.

    Returns
    -------
    mean_probability, share_feasible : (b,) float64
        Of the bins that are not empty.
    count : (b,) int64
        Legs in each.
    """
    truth, score = np.asarray(y, dtype=np.bool_), np.asarray(probability, dtype=np.float64)
    _check(truth, score)
    bins = np.minimum((score * n_bins).astype(np.int64), n_bins - 1)
    count = np.bincount(bins, minlength=n_bins)
    used = count > 0
    mean = np.bincount(bins, weights=score, minlength=n_bins)[used] / count[used]
    share = np.bincount(bins, weights=truth, minlength=n_bins)[used] / count[used]
    return mean, share, count[used].astype(np.int64)


def calibration_error(y: ArrayLike, probability: ArrayLike, n_bins: int = 15) -> float:
    """Return the expected calibration error: mean gap of the reliability diagram.

    Guo et al. 2017, "On calibration of modern neural networks", equation 3.
    """
    mean, share, count = reliability(y, probability, n_bins)
    return float(np.sum(count * np.abs(mean - share)) / np.sum(count))


def summary(y: ArrayLike, probability: ArrayLike, threshold: float = 0.5) -> dict[str, float]:
    """Return all measures of the paper's Table 6 and some more.

    Returns
    -------
    dict of str to float
        n, share_feasible, accuracy, precision, recall, f1, f10, auc,
        balanced_accuracy, log_loss, calibration_error.

    Raises
    ------
    InputError
        The shapes differ, or a class is missing.
    """
    truth, score = np.asarray(y, dtype=np.bool_), np.asarray(probability, dtype=np.float64)
    area = auc(truth, score)
    counts = Confusion.of(truth, score >= threshold)
    return {
        "n": float(len(truth)),
        "share_feasible": float(truth.mean()),
        "accuracy": counts.accuracy,
        "precision": counts.precision,
        "recall": counts.recall,
        "f1": counts.f_score(1.0),
        "f10": counts.f_score(10.0),
        "auc": area,
        "balanced_accuracy": counts.balanced_accuracy,
        "log_loss": log_loss(truth, score),
        "calibration_error": calibration_error(truth, score),
    }


def one_class_summary(
    y: ArrayLike, probability: ArrayLike, threshold: float = 0.5
) -> dict[str, float]:
    """Return those measures of `summary` that need no legs of the other class.

    Returns
    -------
    dict of str to float
        n, share_feasible, accuracy, log_loss, calibration_error.

    Raises
    ------
    InputError
        The shapes differ.
    """
    truth, score = np.asarray(y, dtype=np.bool_), np.asarray(probability, dtype=np.float64)
    return {
        "n": float(len(truth)),
        "share_feasible": float(truth.mean()),
        "accuracy": Confusion.of(truth, score >= threshold).accuracy,
        "log_loss": log_loss(truth, score),
        "calibration_error": calibration_error(truth, score),
    }


def has_both_classes(y: ArrayLike) -> bool:
    """Tell whether there are feasible legs and infeasible ones."""
    truth = np.asarray(y, dtype=np.bool_)
    return bool(truth.any() and not truth.all())


def _ratio(part: float, whole: float) -> float:
    return part / whole if whole > 0 else 0.0


def _check(truth: NDArray[np.bool_], answer: NDArray[np.bool_] | NDArray[np.float64]) -> None:
    if truth.ndim != 1 or truth.shape != answer.shape or len(truth) == 0:
        raise InputError(
            f"metrics: labels of shape {truth.shape} and answers of shape {answer.shape}, "
            "expected (n,) both, with n at least 1"
        )
