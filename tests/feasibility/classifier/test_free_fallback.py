"""Rough hints where the paths of legs with free ends lead nowhere."""

import numpy as np

from feasibility.classifier.margin.free_fallback import known_features, known_features_and_excess
from feasibility.classifier.margin.free_features import FREE_FEATURES, features_and_excess
from feasibility.dataset import read_protocol
from feasibility.legs import Legs
from feasibility.orbits import synthetic_main_belt


def fly_bys(n=600, seed=4):
    made = read_protocol("flyby")
    catalogue = synthetic_main_belt(100, np.random.default_rng(5))
    rng = np.random.default_rng(seed)
    return made.sampler.draw(n, rng, catalogue, None, made.impulsive_grid).legs


def test_legs_that_no_path_suits_have_a_rough_hint_and_the_others_keep_theirs():
    legs = fly_bys()
    X, hint, excess = features_and_excess(legs)
    known = np.isfinite(hint)
    assert 0 < (~known).sum() < 60
    all_X, all_hint, all_excess = known_features_and_excess(legs)
    np.testing.assert_array_equal(all_X[known], X[known])
    np.testing.assert_array_equal(all_hint[known], hint[known])
    np.testing.assert_array_equal(all_excess[known], excess[known])
    assert np.isfinite(all_hint).mean() > 0.995
    assert np.isfinite(all_X[np.isfinite(all_hint)]).all()
    # Such legs need much: more than nearly all engines have.
    assert np.median(np.exp(all_hint[~known])) > 2e-4


def test_rough_hints_do_not_depend_on_other_legs():
    legs = fly_bys()
    X, hint = known_features(legs)
    rough = np.flatnonzero(X[:, FREE_FEATURES.index("log_round_0")] == 3.0)
    for row in rough[:5]:
        alone, one = known_features(legs.take([row]))
        np.testing.assert_array_equal(one, hint[[row]])
        np.testing.assert_array_equal(alone, X[[row]])


def test_nothing_is_said_of_unbound_departures():
    fast = [3e11, 0, 0, 0, 4e4, 0]
    legs = Legs(fast, [0, 3e11, 0, -2e4, 0, 0], 300.0, 1500.0, 0.2, 4000.0, 1000.0, vinf_dep=50.0,
                vinf_arr=np.inf)  # fmt: skip
    X, hint = known_features(legs)
    assert np.isnan(hint).all()
    assert np.isnan(X).all()
