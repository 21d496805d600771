"""No pair of bodies is on both sides of a split."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from feasibility import InputError
from feasibility.dataset import pair_ids, split_pairs
from feasibility.dataset.splits import pairs_of_bodies
from tests.helpers.labelled import labelled_dataset


@st.composite
def bodies(draw):
    """Ids of both ends of 20 to 80 legs among a few bodies."""
    n = draw(st.integers(20, 80))
    ids = st.lists(st.integers(1, 9), min_size=n, max_size=n)
    return np.array(draw(ids)), np.array(draw(ids))


def unordered(dep, arr, rows):
    return {frozenset(pair) for pair in zip(dep[rows].tolist(), arr[rows].tolist(), strict=True)}


@given(bodies(), st.integers(0, 1000))
def test_both_directions_of_a_pair_are_in_one_fold_and_no_fold_is_empty(ends, seed):
    dep, arr = ends
    pairs = pair_ids(dep, arr)
    if pairs.max() < 4:
        return
    folds = split_pairs(pairs, [0.2] * 5, np.random.default_rng(seed))
    assert set(folds) == set(range(5))
    for fold in range(5):
        inside, outside = folds == fold, folds != fold
        assert not unordered(dep, arr, inside) & unordered(dep, arr, outside)


def test_folds_are_of_nearly_equal_size():
    rng = np.random.default_rng(0)
    pairs = pair_ids(rng.integers(0, 60, 5000), rng.integers(0, 60, 5000))
    sizes = np.bincount(split_pairs(pairs, [0.2] * 5, rng))
    assert sizes.min() > 950
    assert sizes.max() < 1050


def test_parts_have_their_shares():
    parts = split_pairs(np.arange(10_000), (0.8, 0.1, 0.1), np.random.default_rng(0))
    assert np.bincount(parts).tolist() == [8000, 1000, 1000]


def test_drawn_bodies_make_pairs_of_their_own():
    pairs = pair_ids([-1, -1, 3, 4, 3], [-1, -1, 4, 3, -1])
    assert pairs[2] == pairs[3]
    assert len(set(pairs.tolist())) == 4


def test_the_same_ids_are_other_bodies_in_another_catalogue():
    pairs = pair_ids([3, 3, 4, -1, 3], [4, 4, 3, 4, 4], [0, 1, 0, 1, 1])
    assert pairs[0] == pairs[2]
    assert pairs[1] == pairs[4]
    assert len(set(pairs.tolist())) == 3


def test_datasets_from_one_catalogue_share_their_pairs():
    one, two, other = (
        labelled_dataset(60, seed, bodies) for seed, bodies in ((0, 5), (1, 5), (2, 6))
    )
    numbers = pairs_of_bodies([one, two, other])
    ends = [
        unordered(data.columns["dep_id"], data.columns["arr_id"], np.arange(60))
        for data in (one, two, other)
    ]
    assert len(set(numbers[0]) | set(numbers[1])) == len(ends[0] | ends[1])
    assert not set(numbers[2]) & (set(numbers[0]) | set(numbers[1]))
    alone = pairs_of_bodies([two])[0]
    np.testing.assert_array_equal(alone, pair_ids(two.columns["dep_id"], two.columns["arr_id"]))


def test_fewer_pairs_than_parts_are_refused_or_leave_parts_empty():
    pairs = np.array([0, 0, 1])
    with pytest.raises(InputError, match="2 different pairs"):
        split_pairs(pairs, [0.2] * 5, np.random.default_rng(0))
    parts = split_pairs(pairs, [0.2] * 5, np.random.default_rng(0), allow_empty=True)
    assert len(set(parts.tolist())) == 2
    assert parts[0] == parts[1]
