"""Limits and what is left of them."""

import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from feasibility import InputError
from seqsearch.budget import Budget, Limits


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"workers": 0}, "--workers 0: expected one or more"),
        ({"workers": -3}, "--workers -3"),
        ({"max_solves": 0}, "--max-solves 0"),
    ],
)
def test_limits_below_one_are_refused(changes, words):
    with pytest.raises(InputError, match=words):
        Limits(**changes)


def test_limits_may_be_left_out():
    assert Limits() == Limits(time_limit_s=None, max_solves=None, workers=None)
    assert Limits(workers=1, max_solves=1).max_solves == 1


def test_without_limits_a_budget_is_never_used_up():
    budget = Budget()
    budget.charge(10**9)
    assert not budget.limited
    assert not budget.used_up()
    assert budget.affordable(500) == 500
    assert budget.ending() == "complete"


@given(st.integers(1, 50), st.integers(0, 50), st.lists(st.integers(0, 20), max_size=6))
def test_solves_are_counted_over_all_sessions(limit, before, charges):
    budget = Budget(max_solves=limit, solves=before)
    spent = before
    for solves in charges:
        budget.charge(solves)
        spent += solves
        assert budget.solves == spent
        assert budget.used_up() == (spent >= limit)
        assert budget.affordable(7) == min(7, limit - spent)
    assert budget.limited
    assert budget.ending() == ("solve limit" if spent >= limit else "complete")


def test_time_is_counted_over_all_sessions():
    budget = Budget(time_limit_s=100.0, spent_s=90.0)
    assert 9.0 < budget.deadline.remaining_s() <= 10.0
    assert 90.0 <= budget.spent_s < 91.0
    assert not budget.used_up()
    assert budget.ending() == "complete"
    over = Budget(time_limit_s=100.0, max_solves=5, spent_s=100.0, solves=5)
    assert over.used_up()
    assert over.deadline.remaining_s() == 0.0
    assert over.ending() == "time limit"


def test_a_budget_ends_by_the_clock():
    budget = Budget(time_limit_s=0.05)
    before = budget.spent_s
    time.sleep(0.06)
    assert budget.used_up()
    assert budget.spent_s > before
    assert budget.ending() == "time limit"
