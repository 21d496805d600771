"""`feasibility assess`: shares with intervals, and a verdict by a stated rule."""

import json
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from feasibility import ClassifierPruner, FeasibilityClassifier, InputError
from feasibility.commands.cli import main
from feasibility.dataset import Dataset
from feasibility.spacecraft.assess import EXIT_CODES, Share, assess, judgement
from tests.helpers.labelled import labelled_dataset

GOOD = {
    "sides": [Share(500, 500), Share(500, 500)],
    "balanced_accuracy": 1.0,
    "within_15_percent": Share(300, 300),
    "in_domain": Share(1000, 1000),
    "recall_asked": 0.99,
    "recall": Share(500, 500),
}


@pytest.fixture(scope="module")
def default():
    return FeasibilityClassifier.load("default")


def as_the_model_says(classifier, dataset, *, wrong=0):
    """Return the legs with the model's own m*, but of the first ones the opposite."""
    log_margin = np.log(classifier.margin(dataset.legs))
    log_margin[:wrong] *= -1.0
    columns = {**dataset.columns, "log_margin": log_margin}
    return Dataset(columns, dataset.metadata)


@given(st.integers(0, 400), st.integers(1, 400))
def test_the_interval_holds_the_share_and_shrinks_with_the_count(count, of):
    share = Share(min(count, of), of)
    low, high = share.interval
    assert 0.0 <= low <= share.value <= high <= 1.0
    more = Share(100 * share.count, 100 * of).interval
    assert more[1] - more[0] < high - low


def test_wilsons_interval_is_that_of_the_books():
    # Agresti & Coull 1998: 0 of 10 gives an upper end of z^2 / (n + z^2).
    assert Share(0, 10).interval == pytest.approx((0.0, 0.27753), abs=1e-5)
    assert Share(0, 0).interval == (0.0, 1.0)


@pytest.mark.parametrize(
    ("change", "verdict", "reason"),
    [
        ({}, "good enough", None),
        ({"in_domain": Share(949, 1000)}, "retrain", "in domain"),
        ({"balanced_accuracy": 0.9899}, "retrain", "balanced accuracy"),
        ({"within_15_percent": Share(290, 300)}, "retrain", "within 15 %"),
        ({"recall": Share(480, 500)}, "retrain", "recall surely below"),
        ({"recall": Share(493, 500)}, "good enough", None),
        ({"within_15_percent": Share(99, 99)}, "too few legs", "99 legs near"),
        ({"sides": [Share(49, 49), Share(500, 500)]}, "too few legs", "49 feasible"),
    ],
)
def test_the_verdict_follows_the_rule(change, verdict, reason):
    said, reasons = judgement(**{**GOOD, **change})
    assert said == verdict
    assert (reason is None) == (not reasons)
    assert reason is None or reason in reasons[0]


def test_too_few_legs_say_how_many_are_needed():
    change = {"sides": [Share(20, 20), Share(400, 400)], "in_domain": Share(600, 600)}
    _, reasons = judgement(**{**GOOD, **change})
    # 50 of a class from 20 of 600, and a quarter more.
    assert reasons[-1].startswith("about 1900 legs are needed: give --legs 1900")
    _, reasons = judgement(**{**GOOD, "sides": [Share(0, 0), Share(400, 400)]})
    assert "of one kind there was none" in reasons[-1]


@pytest.mark.parametrize(
    ("verdict", "code"), [("good enough", 0), ("retrain", 3), ("too few legs", 4)]
)
def test_each_verdict_has_an_exit_code_that_the_help_tells(verdict, code, capsys):
    assert EXIT_CODES[verdict] == code
    with pytest.raises(SystemExit):
        main(["assess", "--help"])
    assert f"{code} {verdict}" in capsys.readouterr().out


def test_a_model_that_is_always_right_is_good_enough_and_one_that_errs_is_not(default):
    dataset = labelled_dataset()
    right = assess(default, [as_the_model_says(default, dataset)])
    assert right.verdict == "good enough"
    assert right.balanced_accuracy > 0.999
    err = assess(default, [as_the_model_says(default, dataset, wrong=200)])
    assert err.verdict == "retrain"
    assert err.within_15_percent.value < right.within_15_percent.value


def test_recall_and_precision_are_those_of_the_pruner(default):
    dataset = as_the_model_says(default, labelled_dataset(), wrong=200)
    outcome = assess(default, [dataset], recall=0.95)
    kept = ClassifierPruner(default, 0.95).keep(dataset.legs)
    feasible = dataset.columns["log_margin"] >= 0
    assert (outcome.recall.count, outcome.recall.of) == (np.sum(kept & feasible), feasible.sum())
    assert (outcome.precision.count, outcome.precision.of) == (
        np.sum(kept & feasible),
        kept.sum(),
    )


def test_masses_drawn_near_the_boundary_do_not_enter_the_balanced_accuracy(default):
    dataset = as_the_model_says(default, labelled_dataset(), wrong=200)
    drawn = np.arange(len(dataset)) < 200
    columns = {**dataset.columns, "boundary_draw": drawn}
    outcome = assess(default, [Dataset(columns, dataset.metadata)])
    assert outcome.balanced_accuracy > 0.99
    assert outcome.recall.of == np.sum(dataset.columns["log_margin"] >= 0)


def test_unsolved_legs_are_counted_and_no_solved_leg_is_an_error(default):
    dataset = as_the_model_says(default, labelled_dataset())
    log_margin = np.where(np.arange(len(dataset)) < 10, np.nan, dataset.columns["log_margin"])
    part = Dataset({**dataset.columns, "log_margin": log_margin}, dataset.metadata)
    assert assess(default, [part]).unsolved == 10
    with pytest.raises(InputError, match="of no leg"):
        assess(default, [part.take(np.arange(10))])


def test_the_command_solves_legs_and_says_its_verdict(tmp_path, capsys):
    pytest.importorskip("pyarrow")
    file = tmp_path / "probe.toml"
    file.write_text("dry_mass_kg = 800\nthrust_n = 0.3\nisp_s = 3000\nm0_kg = [800, 2000]\n")
    out = tmp_path / "figures.json"
    words = ["assess", str(file), "--legs", "30", "--workers", "1", "--out", str(out)]
    assert main(words) == EXIT_CODES["too few legs"] == 4
    text = capsys.readouterr().out
    assert "verdict: too few legs" in text
    assert re.search(r"about \d+00 legs are needed|of one kind there was none", text)
    record = json.loads(out.read_text())
    assert record["in_domain"]["of"] + record["unsolved"] == 30
    assert record["spacecraft"]["thrust_n"] == 0.3
    assert str(tmp_path) not in out.read_text()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["none.toml"], "none.toml: cannot be read"),
        (["FILE", "--legs", "0"], "--legs 0: expected one or more"),
        (["FILE", "--seed", "-1"], "--seed -1"),
        (["FILE", "--recall", "2"], "recall: 2"),
        (["FILE", "--model", "none.seqmodel"], "none.seqmodel"),
        (["FILE", "--catalogue", "none.txt"], "none.txt: cannot be read"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(tmp_path, capsys, words, message):
    file = tmp_path / "probe.toml"
    file.write_text("dry_mass_kg = 800\nthrust_n = 0.3\nisp_s = 3000\nm0_kg = [800, 2000]\n")
    assert main(["assess", *(str(file) if word == "FILE" else word for word in words)]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
