"""The default model knows nothing of free ends, and says so."""

import numpy as np

from feasibility.classifier.classifier import FeasibilityClassifier
from feasibility.legs import Legs
from feasibility.pruners import ClassifierPruner
from tests.helpers.free_legs import free_legs


def test_the_default_classifier_knows_nothing_of_free_ends_and_says_so():
    classifier = FeasibilityClassifier.load("default")
    legs = Legs.concatenate([free_legs(5, 2), free_legs(5, 2, 0.0, np.inf)])
    np.testing.assert_array_equal(classifier.in_domain(legs)[5:], False)
    assert np.isnan(classifier.margin(legs)[5:]).all()
    assert np.isnan(classifier.quick_margin(legs)[5:]).all()
    assert np.isnan(classifier.final_mass(legs)[5:]).all()
    np.testing.assert_array_equal(classifier.feasible_probability(legs)[5:], 0.5)
    assert ClassifierPruner(classifier).keep(legs)[5:].all()
    alone = classifier.margin(legs.take(np.arange(5)))
    np.testing.assert_array_equal(classifier.margin(legs)[:5], alone)
