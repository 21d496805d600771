"""What models say of legs with free ends: with nets for them, and without."""

import dataclasses

import numpy as np
import pytest

from feasibility.classifier.check import check_predictor
from feasibility.classifier.classifier import FeasibilityClassifier
from feasibility.dataset import read_protocol
from feasibility.legs import Legs
from feasibility.orbits import synthetic_main_belt
from feasibility.pruners import ClassifierPruner, check_pruner
from tests.helpers.free_legs import free_legs, with_ends

TOLERANCE = 0.02
"""By how much an estimated margin may fall where an excess grows, of 99 in 100 legs."""


@pytest.fixture(scope="module")
def without():
    artefact = FeasibilityClassifier.load("default").artefact
    arrays = {k: v for k, v in artefact.arrays.items() if not k.startswith("free_")}
    return FeasibilityClassifier(dataclasses.replace(artefact, arrays=arrays))


@pytest.fixture(scope="module")
def default():
    classifier = FeasibilityClassifier.load("default")
    if not classifier.knows_free_ends:
        pytest.skip("the default model has no nets for free ends")
    return classifier


def drawn(protocol, legs=200, seed=9):
    made = read_protocol(protocol)
    rng = np.random.default_rng(seed)
    catalogue = synthetic_main_belt(300, np.random.default_rng(5))
    return made.sampler.draw(legs, rng, catalogue, None, made.impulsive_grid).legs


def test_a_model_without_nets_for_free_ends_knows_nothing_of_them_and_says_so(without):
    legs = Legs.concatenate([free_legs(5, 2), free_legs(5, 2, 0.0, np.inf)])
    np.testing.assert_array_equal(without.in_domain(legs)[5:], False)
    assert np.isnan(without.margin(legs)[5:]).all()
    assert np.isnan(without.quick_margin(legs)[5:]).all()
    assert np.isnan(without.final_mass(legs)[5:]).all()
    np.testing.assert_array_equal(without.feasible_probability(legs)[5:], 0.5)
    assert ClassifierPruner(without).keep(legs)[5:].all()
    alone = without.margin(legs.take(np.arange(5)))
    np.testing.assert_array_equal(without.margin(legs)[:5], alone)


@pytest.mark.parametrize("protocol", ["launch", "arrival", "launch-flyby", "flyby"])
def test_the_default_model_knows_legs_with_free_ends(default, protocol):
    legs = drawn(protocol)
    told = default.predict(legs)
    known = np.isfinite(told.margin)
    assert known.mean() > 0.98
    assert told.in_domain.mean() > 0.95
    assert (told.margin[known] > 0.0).all()
    flown = known & (told.margin >= 1.0)
    assert flown.any()
    assert (told.final_mass[flown] <= legs.m0[flown]).all()
    check_predictor(default, legs.take(np.arange(64)))
    check_pruner(ClassifierPruner(default), legs.take(np.arange(64)))


def test_legs_from_rest_to_rest_are_answered_as_without_the_other_nets(default, without):
    legs = Legs.concatenate([drawn("general", 100), drawn("flyby", 100)])
    for answer in ("margin", "quick_margin", "feasible_probability", "final_mass"):
        np.testing.assert_array_equal(
            getattr(default, answer)(legs)[:100], getattr(without, answer)(legs)[:100]
        )


@pytest.mark.parametrize("protocol", ["launch", "arrival", "flyby"])
def test_more_excess_is_hardly_ever_less_feasible(default, protocol):
    legs = drawn(protocol, 150)
    before = np.full(len(legs), -np.inf)
    falls = []
    for step in np.linspace(0.0, 5000.0, 26)[1:]:
        if protocol == "launch":
            eased = with_ends(legs, step, 0.0)
        else:
            eased = with_ends(legs, legs.vinf_dep, step)
        # Where little thrust is needed at all, a percent of it decides nothing.
        now = np.minimum(np.log(default.margin(eased)), 1.0)
        falls.append(before - now)
        before = now
    known = np.concatenate(falls)
    known = known[np.isfinite(known)]
    assert len(known) > 3000
    assert np.quantile(known, 0.99) < TOLERANCE
