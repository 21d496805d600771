"""`ClassifierPruner`: a trained classifier with a threshold for a wanted recall."""

from dataclasses import dataclass, field
from typing import final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.classifier import FeasibilityClassifier
from feasibility.errors import InputError
from feasibility.legs import Legs
from feasibility.runtime.workers import own_threads


@final
@dataclass(frozen=True)
class ClassifierPruner:
    """Keeps a leg that is likely enough to be feasible, or that the classifier does not know.

    A leg outside the classifier's domain is kept: nothing is known against it.
    `keep_with_unknown` says which legs these are, so that a search can count them.

    Parameters
    ----------
    classifier : FeasibilityClassifier
        The trained model.
    recall : float
        Share of the feasible legs to keep, above 0 and at most 1. The threshold
        follows from calibration legs that were not trained on, so the share is
        met on legs like those of the training.
    threads : int, optional
        Threads that share the work on a large batch; by default one for each processor, but one
        in a worker process, whose siblings use the others. The answers do not depend on it.

    Attributes
    ----------
    threshold : float
        Least probability of a leg from rest to rest that is kept; legs with free ends have
        thresholds by kind, `FeasibilityClassifier.thresholds`.

    Raises
    ------
    InputError
        `recall` or `threads` is out of range.
    """

    classifier: FeasibilityClassifier
    recall: float = 0.99
    threads: int | None = None
    threshold: float = field(init=False)

    def __post_init__(self) -> None:
        if self.threads is not None and self.threads < 1:
            raise InputError(f"threads: {self.threads}, expected 1 or more")
        object.__setattr__(self, "threshold", self.classifier.threshold(self.recall))

    @property
    def name(self) -> str:
        """Name in counters and reports."""
        return "classifier"

    def keep(self, legs: Legs, /) -> NDArray[np.bool_]:
        """Return (n,) bool, True where the leg survives."""
        return self.keep_with_unknown(legs)[0]

    def keep_with_unknown(self, legs: Legs, /) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Return the mask of `keep` and which legs are kept because they are not known.

        Row-wise and pure as `keep` is: who counts the second mask keeps the count.

        Returns
        -------
        mask : (n,) bool
            True where the leg survives.
        unknown : (n,) bool
            True where it is outside the classifier's domain, and so survives in any case.
        """
        threads = self.threads or own_threads()
        probability, inside = self.classifier.assess(legs, threads)
        threshold = self.thresholds(legs) if legs.free_ends.any() else self.threshold
        return (probability >= threshold) | ~inside, ~inside

    def thresholds(self, legs: Legs) -> NDArray[np.float64]:
        """Return (n,) the least probability with which each leg is kept."""
        return self.classifier.thresholds(self.recall, legs)
