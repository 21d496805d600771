"""Nets for free ends: trained beside the others or added to them, saved, and taken along."""

import dataclasses
import json

import numpy as np
import pytest

from feasibility import ClassifierPruner, FeasibilityClassifier, InputError, Legs
from feasibility.classifier.margin.ends import KINDS, kinds_of_ends
from feasibility.commands.cli import main
from feasibility.evaluation.evaluate import evaluate
from feasibility.evaluation.training_legs import trained_on
from tests.helpers.labelled import labelled_dataset, labelled_free_dataset

SMALL = {"layers": 2, "width": 32, "epochs": 5, "batch": 200, "device": "cpu", "threads": 1}


@pytest.fixture(scope="module")
def training():
    pytest.importorskip("torch")
    from feasibility.learning.margin import train

    return train


@pytest.fixture(scope="module")
def alone(training):
    return training.train_margin([labelled_dataset()], training.MarginRecipe(**SMALL))


@pytest.fixture(scope="module")
def both(training):
    datasets = [labelled_dataset(), labelled_free_dataset()]
    return training.train_margin(datasets, training.MarginRecipe(**SMALL))


@pytest.fixture(scope="module")
def legs():
    parts = [labelled_dataset(300, seed=1).legs, labelled_free_dataset(300, seed=1).legs]
    return Legs.concatenate(parts)


def test_nets_for_free_ends_leave_the_others_as_they_are(training, alone, both, legs):
    recipe = training.MarginRecipe(**SMALL)
    added = training.train_free_ends(alone, [labelled_free_dataset()], recipe)
    assert set(added.arrays) == set(both.arrays)
    for name, array in both.arrays.items():
        np.testing.assert_array_equal(added.arrays[name], array)
    for name, array in alone.arrays.items():
        np.testing.assert_array_equal(both.arrays[name], array)
    old, new = FeasibilityClassifier(alone), FeasibilityClassifier(both)
    assert not old.knows_free_ends
    assert new.knows_free_ends
    rest = np.arange(300)
    for answer in ("feasible_probability", "margin", "quick_margin", "final_mass"):
        before = getattr(old, answer)(legs)
        after = getattr(new, answer)(legs)
        np.testing.assert_array_equal(after[rest], before[rest])
        assert np.isfinite(after[300:]).mean() > 0.8
    np.testing.assert_array_equal(old.in_domain(legs)[300:], False)
    np.testing.assert_array_equal(old.feasible_probability(legs)[300:], 0.5)
    assert ClassifierPruner(old).keep(legs)[300:].all()


def test_the_nets_travel_to_another_model(training, alone, both, legs, tmp_path):
    taken = training.with_free_ends_of(alone, both)
    taken.save(tmp_path / "m.seqmodel")
    loaded = FeasibilityClassifier.load(tmp_path / "m.seqmodel")
    np.testing.assert_array_equal(loaded.margin(legs), FeasibilityClassifier(both).margin(legs))
    told, kept = (m.provenance["free_ends"] for m in (loaded.artefact, both))
    assert told == json.loads(json.dumps(kept))
    with pytest.raises(InputError, match="free ends"):
        training.with_free_ends_of(alone, alone)


def test_answers_in_mixed_batches_are_those_for_each_leg(both, legs):
    classifier = FeasibilityClassifier(both)
    order = np.random.default_rng(0).permutation(len(legs))
    mixed = legs.take(order)
    for answer in ("feasible_probability", "margin", "quick_margin", "final_mass", "in_domain"):
        whole = getattr(classifier, answer)(legs)
        np.testing.assert_array_equal(getattr(classifier, answer)(mixed), whole[order])
        for row in (7, 320, 555):
            one = getattr(classifier, answer)(legs.take([row]))
            np.testing.assert_array_equal(one, whole[[row]])
    told = classifier.predict(mixed)
    np.testing.assert_array_equal(told.margin, classifier.margin(mixed))
    np.testing.assert_array_equal(told.final_mass_error, classifier.final_mass_error(mixed))


def test_threads_change_no_bit_of_mixed_answers(both, legs):
    many = Legs.concatenate([legs] * 18)
    classifier = FeasibilityClassifier(both)
    probability, inside = classifier.assess(many)
    again = classifier.assess(many, 3)
    np.testing.assert_array_equal(again[0], probability)
    np.testing.assert_array_equal(again[1], inside)


def test_legs_that_need_no_thrust_have_finite_margins_and_are_kept(both):
    data = labelled_free_dataset(3000, seed=2)
    ballistic = data.take(np.flatnonzero(np.isinf(data.columns["m_star_kg"]))).legs
    assert len(ballistic) >= 5
    classifier = FeasibilityClassifier(both)
    margin = classifier.margin(ballistic)
    known = np.isfinite(margin)
    assert not np.isinf(margin).any()
    assert known.mean() > 0.5
    assert ClassifierPruner(classifier).keep(ballistic).mean() > 0.9
    told = classifier.predict(ballistic)
    assert (told.final_mass[known] <= ballistic.m0[known]).all()


def test_a_heavier_spacecraft_with_free_ends_is_never_more_feasible(both):
    free = labelled_free_dataset(300, seed=3).legs
    classifier = FeasibilityClassifier(both)
    before = np.ones(len(free))
    for factor in np.geomspace(0.3, 5.0, 25):
        heavier = Legs(
            free.rv_dep, free.rv_arr, free.tof_days, factor * free.m0, free.thrust, free.isp, 0.0,
            vinf_dep=free.vinf_dep, vinf_arr=free.vinf_arr,
        )  # fmt: skip
        probability = classifier.feasible_probability(heavier)
        assert (probability <= before).all()
        before = probability


def test_the_pruner_asks_the_threshold_of_the_kind(both, legs):
    classifier = FeasibilityClassifier(both)
    thresholds = classifier.thresholds(0.9, legs)
    np.testing.assert_array_equal(thresholds[:300], classifier.threshold(0.9))
    kinds = kinds_of_ends(legs)
    scores = both.arrays["free_calibration/positive_scores"]
    for number in range(len(KINDS)):
        of_kind = np.unique(thresholds[kinds == number])
        assert len(of_kind) == 1
        assert of_kind[0] in scores[number]
    pruner = ClassifierPruner(classifier, recall=0.9)
    probability, inside = classifier.assess(legs)
    np.testing.assert_array_equal(pruner.keep(legs), (probability >= thresholds) | ~inside)
    with pytest.raises(InputError, match="recall"):
        classifier.thresholds(0.0, legs)


def test_kinds_that_were_not_learned_are_outside_the_domain(training, alone):
    data = labelled_free_dataset()
    kinds = kinds_of_ends(data.legs)
    some = data.take(np.flatnonzero(kinds < 3))
    model = training.train_free_ends(alone, [some], training.MarginRecipe(**SMALL))
    inside = FeasibilityClassifier(model).in_domain(data.legs)
    assert inside[kinds < 3].mean() > 0.8
    assert not inside[kinds >= 3].any()


def test_datasets_without_a_sort_of_legs_are_refused(training, alone):
    recipe = training.MarginRecipe(**SMALL)
    with pytest.raises(InputError, match="all legs have free ends"):
        training.train_margin([labelled_free_dataset()], recipe)
    with pytest.raises(InputError, match="no leg of the datasets has any"):
        training.train_free_ends(alone, [labelled_dataset()], recipe)


def test_a_model_learns_and_says_on_what(both):
    measures = both.metrics["free_ends"]["calibration"]
    assert measures["median_absolute_log_error"] < measures["hint_median_absolute_log_error"]
    metadata = labelled_free_dataset().metadata
    assert trained_on(both, metadata)
    outcome = evaluate(FeasibilityClassifier(both), labelled_free_dataset(400, seed=5))
    assert outcome.metrics["balanced_accuracy"] > 0.7
    assert outcome.metrics["in_domain"] > 0.8
    assert "|" in outcome.table()


@pytest.mark.parametrize(
    ("name", "array", "message"),
    [
        ("free_model/mean", None, "mean' is missing"),
        ("free_quick/settled", np.zeros(2), "array settled"),
        ("free_quick/std", np.zeros(3), "array std"),
        ("free_domain/low", np.zeros(2), "array high"),
        ("free_domain/kinds", np.ones(2), "array kinds"),
        ("free_domain/feature_set", np.array("other"), "features 'other'"),
        ("free_domain/feature_set", np.array(3.0), "feature_set, expected a word"),
        ("free_calibration/positive_scores", np.ones(5), "array positive_scores"),
        ("free_calibration/positive_scores", -np.ones((5, 7)), "rising probabilities"),
        ("free_calibration/levels", np.ones((5, 3)), "array quantiles"),
        ("free_final_mass/weight_0", np.ones((2, 3)), "is missing"),
    ],
)
def test_sections_that_do_not_fit_are_refused(both, tmp_path, name, array, message):
    arrays = {key: value for key, value in both.arrays.items() if key != name}
    if array is not None:
        arrays[name] = array
    path = tmp_path / "strange.seqmodel"
    dataclasses.replace(both, arrays=arrays).save(path)
    with pytest.raises(InputError, match=message) as caught:
        FeasibilityClassifier.load(path)
    assert "\n" not in str(caught.value)


def test_the_commands_add_nets_for_free_ends(tmp_path, monkeypatch, alone, capsys):
    monkeypatch.setattr("feasibility.dataset.read_dataset", lambda _: labelled_free_dataset())
    start, out = tmp_path / "start.seqmodel", tmp_path / "more.seqmodel"
    alone.save(start)
    settings = [f"--set={name}={SMALL[name]}" for name in ("layers", "width", "batch", "threads")]
    arguments = ["train", "a", "--model", "free-margin", "--epochs", "2", *settings]
    assert main([*arguments, "--out", str(out)]) == 2
    assert "--start" in capsys.readouterr().err
    assert main([*arguments, "--start", str(start), "--out", str(out)]) == 0
    assert "free ends: " in capsys.readouterr().out
    assert FeasibilityClassifier.load(out).knows_free_ends
    assert not list(tmp_path.glob("*.checkpoint*"))
