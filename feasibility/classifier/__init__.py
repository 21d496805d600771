"""The trained model as a search asks it: margins, final masses and probabilities of legs.

Needs numpy, scipy and numba alone; training, which makes such models, is `feasibility.learning`.
"""

from feasibility.classifier.classifier import FeasibilityClassifier

__all__ = ["FeasibilityClassifier"]
