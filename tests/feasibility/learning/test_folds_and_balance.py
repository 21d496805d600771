"""No leg, no pair and no synthetic row is on both sides of a split."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from feasibility import InputError
from feasibility.dataset import pair_ids, split_pairs
from feasibility.learning.paper.balance import adasyn, balanced_rows


@st.composite
def bodies(draw):
    """Ids of both ends of 20 to 80 legs among a few bodies."""
    n = draw(st.integers(20, 80))
    ids = st.lists(st.integers(1, 9), min_size=n, max_size=n)
    return np.array(draw(ids)), np.array(draw(ids))


@settings(max_examples=25)
@given(bodies(), st.integers(0, 1000), st.booleans())
def test_no_augmented_or_duplicated_row_reaches_a_validation_fold(ends, seed, balance):
    pytest.importorskip("imblearn")
    dep, arr = ends
    pairs = pair_ids(dep, arr)
    if pairs.max() < 4:
        return
    rng = np.random.default_rng(seed)
    X = rng.normal(size=(len(dep), 3))
    # Legs of one pair are twins: a copy in another fold would give the label away.
    X = X[pairs]
    y = rng.random(len(dep)) < 0.25
    y[:4] = True, True, True, False
    folds = split_pairs(pairs, [0.2] * 5, rng)
    for fold in range(5):
        inside, outside = X[folds == fold], folds != fold
        if y[outside].sum() < 2:
            return
        X_train, y_train = X[outside], y[outside]
        filled, labels = adasyn(X_train, y_train, rng) if balance else (X_train, y_train)
        a = len(X_train)
        assert np.array_equal(filled[:a], X_train)
        assert np.array_equal(labels[:a], y_train)
        rows = {row.tobytes() for row in filled}
        assert not rows & {row.tobytes() for row in inside}
        # Synthetic rows lie between training rows: they span no new ground.
        assert (filled.min(axis=0) >= X_train.min(axis=0) - 1e-12).all()
        assert (filled.max(axis=0) <= X_train.max(axis=0) + 1e-12).all()


def imbalanced(n=400, share=0.1):
    rng = np.random.default_rng(1)
    y = rng.random(n) < share
    return rng.normal(size=(n, 4)) + y[:, None], y


def test_adasyn_fills_up_the_smaller_class_and_keeps_what_was_there():
    pytest.importorskip("imblearn")
    X, y = imbalanced()
    X_more, y_more = adasyn(X, y, np.random.default_rng(0))
    assert np.array_equal(X_more[:400], X)
    assert np.array_equal(y_more[:400], y)
    assert y_more[400:].all()
    assert abs(y_more.mean() - 0.5) < 0.05
    again, _ = adasyn(X, y, np.random.default_rng(0))
    assert np.array_equal(again, X_more)


def test_adasyn_adds_nothing_to_balanced_or_separate_classes():
    pytest.importorskip("imblearn")
    X, y = imbalanced()
    rows = balanced_rows(y, np.random.default_rng(0))
    assert len(adasyn(X[rows], y[rows], np.random.default_rng(0))[1]) == len(rows)
    apart = X + 1000.0 * y[:, None]
    assert len(adasyn(apart, y, np.random.default_rng(0))[1]) == len(y)


def test_adasyn_refuses_a_single_row():
    X, y = imbalanced()
    y = np.arange(len(y)) == 3
    with pytest.raises(InputError, match="1 rows"):
        adasyn(X, y, np.random.default_rng(0))


def test_a_balanced_subset_has_all_of_the_smaller_class_and_as_many_others():
    _, y = imbalanced()
    rows = balanced_rows(y, np.random.default_rng(0))
    assert y[rows].sum() == y.sum() == len(rows) / 2
    assert len(set(rows.tolist())) == len(rows)
    few = balanced_rows(y, np.random.default_rng(0), most=11)
    assert y[few].sum() == len(few) / 2 == 5
