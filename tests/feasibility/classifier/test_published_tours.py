"""Legs of published tours, which were flown: the default pruner has to keep what it can.

Nothing here was used for training.
"""

import importlib
from pathlib import Path

import numpy as np
import pytest

from feasibility import ClassifierPruner, FeasibilityClassifier, max_initial_mass

BENCHMARKS = Path(__file__).parents[3] / "benchmarks"
RECALL = 0.99


@pytest.fixture(scope="module")
def pruner():
    return ClassifierPruner(FeasibilityClassifier.load("default"), recall=RECALL)


@pytest.fixture
def read(monkeypatch):
    """The readers of the benchmark that prints more about these legs."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    return importlib.import_module("classifier")


def not_kept(pruner, legs, name, record_property):
    """Return the margins by the solver of the legs that are pruned, and report them."""
    rows = np.flatnonzero(~pruner.keep(legs))
    if not len(rows):
        return np.empty(0)
    pruned = legs.take(rows)
    solved = max_initial_mass(pruned) / pruned.m0
    modelled = pruner.classifier.margin(pruned)
    for row, by_solver, by_model in zip(rows, solved, modelled, strict=True):
        text = f"m*/m0 {by_solver:.4f} by the solver, {by_model:.4f} by the model"
        record_property(f"{name} leg {row} not kept", text)
        print(f"{name} leg {row} ({legs.tof_days[row]:.0f} d): not kept, {text}")
    return solved


def test_every_gtoc7_leg_that_can_be_flown_is_kept(pruner, read, shared, record_property):
    legs = read.read_tour(
        shared / "legs" / "gtoc7_jpl_36.csv", shared / "gtoc" / "official" / "GTOC7-DATA.txt"
    )
    assert len(legs) == 33
    solved = not_kept(pruner, legs, "GTOC7, JPL", record_property)
    # Dates rounded to the day make some legs too heavy by a per cent.
    assert (solved < 1.0).all()
    assert len(solved) <= 3


def test_every_gtoc12_leg_is_kept(pruner, read, shared, record_property):
    legs = read.read_antipodes(shared / "legs" / "gtoc12_antipodes_legs.csv")
    assert len(legs) == 37
    assert not len(not_kept(pruner, legs, "GTOC12, Antipodes", record_property))


def test_what_is_kept_for_being_unknown_is_told_apart(pruner, read, shared):
    legs = read.read_antipodes(shared / "legs" / "gtoc12_antipodes_legs.csv")
    kept, unknown = pruner.keep_with_unknown(legs)
    np.testing.assert_array_equal(kept, pruner.keep(legs))
    assert not unknown[pruner.classifier.in_domain(legs)].any()
