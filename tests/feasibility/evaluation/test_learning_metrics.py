"""Metrics against scikit-learn's."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from feasibility import InputError
from feasibility.evaluation.metrics import (
    Confusion,
    auc,
    calibration_error,
    log_loss,
    reliability,
    roc_curve,
    summary,
)

reference = pytest.importorskip("sklearn.metrics")


@st.composite
def answers(draw):
    """Labels of both classes and probabilities, with ties."""
    n = draw(st.integers(2, 60))
    y = draw(st.lists(st.booleans(), min_size=n, max_size=n))
    y[0], y[1] = True, False
    p = draw(st.lists(st.integers(0, 12), min_size=n, max_size=n))
    return np.array(y), np.array(p) / 12.0


@given(answers())
def test_equations_11_to_14_are_those_of_scikit_learn(case):
    y, p = case
    answer = p >= 0.5
    counts = Confusion.of(y, answer)
    options = {"zero_division": 0.0}
    assert counts.accuracy == pytest.approx(reference.accuracy_score(y, answer))
    assert counts.precision == pytest.approx(reference.precision_score(y, answer, **options))
    assert counts.recall == pytest.approx(reference.recall_score(y, answer, **options))
    assert counts.balanced_accuracy == pytest.approx(reference.balanced_accuracy_score(y, answer))
    for k in (1.0, 10.0):
        assert counts.f_score(k) == pytest.approx(
            reference.fbeta_score(y, answer, beta=k, **options)
        )


@given(answers())
def test_roc_and_its_area_are_those_of_scikit_learn(case):
    y, p = case
    false_rate, true_rate, thresholds = roc_curve(y, p)
    expected = reference.roc_curve(y, p, drop_intermediate=False)
    for ours, theirs in zip((false_rate, true_rate, thresholds), expected, strict=True):
        assert np.allclose(ours, theirs)
    assert auc(y, p) == pytest.approx(reference.roc_auc_score(y, p))


@given(answers())
def test_log_loss_is_that_of_scikit_learn(case):
    y, p = case
    p = np.clip(p, 0.01, 0.99)
    assert log_loss(y, p) == pytest.approx(reference.log_loss(y, p, labels=[False, True]))


def test_a_calibrated_forecast_has_no_calibration_error_and_a_boast_has():
    y = np.repeat([True, False], [30, 70])
    assert calibration_error(y, np.full(100, 0.3)) == pytest.approx(0.0, abs=1e-12)
    assert calibration_error(y, np.ones(100)) == pytest.approx(0.7)


def test_the_reliability_diagram_counts_every_leg():
    rng = np.random.default_rng(0)
    _, _, count = reliability(rng.random(99) < 0.5, rng.random(99))
    assert count.sum() == 99


def test_a_certain_error_has_a_finite_log_loss():
    assert np.isfinite(log_loss([True, False], [0.0, 0.0]))


def test_a_missing_class_is_refused_where_a_rate_needs_it():
    with pytest.raises(InputError, match="only one class"):
        summary([True, True], [0.2, 0.8])


def test_shapes_that_differ_are_refused():
    with pytest.raises(InputError, match=r"\(2,\)"):
        Confusion.of([True, False], [True])
