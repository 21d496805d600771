"""`feasibility retrain`: never worse, resumable, honest about what it did."""

import json
import re

import numpy as np
import pytest

from feasibility import FeasibilityClassifier
from feasibility.commands.cli import main
from feasibility.dataset import Dataset, read_dataset
from feasibility.spacecraft import retrain as module
from feasibility.spacecraft.retrain import (
    FINE_TUNED,
    RECALIBRATED,
    UNCHANGED,
    RetrainSettings,
    choose,
    few_flyable,
    joined,
    retrain,
)
from feasibility.spacecraft.spacecraft_file import SpacecraftFile
from tests.helpers.labelled import labelled_dataset

pytest.importorskip("torch")
pytest.importorskip("pyarrow")

from feasibility.learning.margin.train import MarginRecipe, train_margin

CRAFT = SpacecraftFile(dry_mass_kg=1000.0, thrust_n=0.236, isp_s=4190.0, m0_kg=(1000.0, 3000.0))
SMALL = RetrainSettings(epochs=4, threads=1, device="cpu", learning_rate=2e-3)


@pytest.fixture(scope="module")
def start():
    recipe = MarginRecipe(
        layers=2, width=32, epochs=5, batch=200, device="cpu", threads=1, learning_rate=5e-3
    )
    return train_margin([labelled_dataset()], recipe)


def lied(dataset):
    """Return the legs with masses m* that belong to others."""
    m_star = dataset.columns["m_star_kg"][::-1] * 3.0
    columns = {**dataset.columns, "m_star_kg": m_star}
    columns["log_margin"] = np.log(m_star / columns["m0_kg"])
    return Dataset(columns, dataset.metadata)


@pytest.fixture
def legs_without_solving(monkeypatch):
    """Replace the solver: test legs are labelled legs, training legs what the test wants."""

    def prepare(training):
        def make(parts, folder, workers):
            return [
                training if part.name.startswith("train") else labelled_dataset(500, seed=9)
                for part in parts
            ]

        monkeypatch.setattr(module, "make", make)

    return prepare


def test_what_is_learned_from_good_legs_is_saved(start, legs_without_solving, tmp_path):
    legs_without_solving(labelled_dataset(seed=4))
    done = retrain(CRAFT, [], start, tmp_path, SMALL, say=lambda _: None)
    assert done.choice == FINE_TUNED
    for figure in ("wrong", "log_loss", "mean_log_margin_error_near"):
        assert done.own[FINE_TUNED][figure] <= done.own[UNCHANGED][figure]
    weights = done.artefact.arrays["model/weight_0"]
    assert not np.array_equal(weights, start.arrays["model/weight_0"])
    np.testing.assert_array_equal(done.artefact.arrays["model/mean"], start.arrays["model/mean"])
    assert (done.artefact.arrays["domain/low"] <= start.arrays["domain/low"]).all()
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["choice"] == FINE_TUNED
    assert set(report["general"]) == {UNCHANGED, RECALIBRATED, FINE_TUNED}
    assert done.artefact.provenance["retrain"]["spacecraft"]["isp_s"] == 4190.0
    assert not (tmp_path / "checkpoint").exists()


def test_what_is_learned_from_bad_legs_is_not_saved(start, legs_without_solving, tmp_path):
    legs_without_solving(lied(labelled_dataset(seed=4)))
    done = retrain(CRAFT, [], start, tmp_path, SMALL, say=lambda _: None)
    assert done.choice != FINE_TUNED
    assert done.own[FINE_TUNED]["wrong"] > done.own[UNCHANGED]["wrong"]
    for name in ("model/weight_0", "model/bias_1", "quick/weight_1"):
        np.testing.assert_array_equal(done.artefact.arrays[name], start.arrays[name])
    assert "fine-tuned model is saved" not in done.verdict()


def scaled(dataset, factor):
    """Return the legs with masses m* times a factor."""
    m_star = dataset.columns["m_star_kg"] * factor
    columns = {**dataset.columns, "m_star_kg": m_star}
    columns["log_margin"] = np.log(m_star / columns["m0_kg"])
    return Dataset(columns, dataset.metadata)


def test_a_spacecraft_with_hardly_a_leg_to_fly_is_told():
    dataset = labelled_dataset(seed=4)
    assert few_flyable([dataset]) is None
    assert re.match(r"of 1500 solved legs \d+ can be flown", few_flyable([scaled(dataset, 0.01)]))
    assert re.match(r"of 1500 solved legs 0 cannot be flown", few_flyable([scaled(dataset, 1e3)]))


def test_the_warning_is_said_before_the_training(
    start, legs_without_solving, tmp_path, monkeypatch
):
    legs_without_solving(labelled_dataset(seed=4))
    monkeypatch.setattr(module, "few_flyable", lambda _: "hardly a leg")
    said = []
    retrain(CRAFT, [], start, tmp_path, SMALL, say=said.append)
    assert said.index("warning: hardly a leg") < said.index("fine-tuning")


def test_a_new_calibration_keeps_the_nets(start):
    recipe = MarginRecipe(epochs=0, device="cpu", threads=1, batch=64)
    again = train_margin([labelled_dataset(seed=4)], recipe, start=start)
    for name in ("model/weight_0", "quick/weight_0", "model/mean"):
        np.testing.assert_array_equal(again.arrays[name], start.arrays[name])
    assert again.arrays["quick/settled"][0] <= start.arrays["quick/settled"][0]
    assert again.arrays["quick/settled"][1] >= start.arrays["quick/settled"][1]
    assert not np.array_equal(
        again.arrays["calibration/quantiles"], start.arrays["calibration/quantiles"]
    )


FIGURES = {"wrong": 10.0, "log_loss": 0.01, "mean_log_margin_error_near": 0.003}


@pytest.mark.parametrize(
    ("tuned", "recalibrated", "choice"),
    [
        ({}, {}, FINE_TUNED),
        ({"wrong": 9.0}, {}, FINE_TUNED),
        ({"wrong": 11.0}, {}, RECALIBRATED),
        ({"log_loss": 0.011, "wrong": 0.0}, {}, RECALIBRATED),
        ({"mean_log_margin_error_near": 0.0031}, {"log_loss": 0.012}, UNCHANGED),
    ],
)
def test_only_what_is_no_worse_in_any_figure_is_chosen(tuned, recalibrated, choice):
    own = {
        UNCHANGED: FIGURES,
        RECALIBRATED: {**FIGURES, **recalibrated},
        FINE_TUNED: {**FIGURES, **tuned},
    }
    assert choose(own) == choice


def test_rows_of_several_datasets_are_joined_in_order():
    a, b = labelled_dataset(500, seed=9), labelled_dataset()
    both = joined([a, b])
    assert len(both) == len(a) + len(b)
    np.testing.assert_array_equal(both.columns["m0_kg"][500:], b.columns["m0_kg"])


def test_the_command_goes_on_after_an_interruption(tmp_path, capsys, monkeypatch):
    file = tmp_path / "probe.toml"
    file.write_text(
        "dry_mass_kg = 800\nthrust_n = 0.3\nisp_s = 3000\nm0_kg = [800, 2000]\n"
        "[sampling]\nsearch_share = 0.0\n"
    )
    words = ["retrain", str(file), "--out", str(tmp_path / "probe.seqmodel"), "--legs", "90"]
    words += ["--test-legs", "60", "--general-legs", "40", "--general-test-legs", "40"]
    words += ["--epochs", "2", "--workers", "1", "--threads", "1", "--device", "cpu"]

    def interrupt(*_, **__):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(module, "train_margin", interrupt)
        assert main(words) == 130
    folder = tmp_path / "probe.seqmodel.retrain"
    made = {path: path.stat().st_mtime_ns for path in folder.rglob("*.parquet")}
    assert len(made) == 4
    assert not (tmp_path / "probe.seqmodel").exists()
    capsys.readouterr()
    assert main(words) == 0
    assert {path: path.stat().st_mtime_ns for path in folder.rglob("*.parquet")} == made
    text = capsys.readouterr().out
    assert "saved" in text
    assert "fresh legs of any spacecraft" in text
    report = json.loads((folder / "report.json").read_text())
    assert len(read_dataset(folder / "train-pairs")) == 90
    # Never worse than the model it started from, on the legs that judged.
    own, choice = report["own"], report["choice"]
    assert own[choice]["wrong"] <= own[UNCHANGED]["wrong"]
    classifier = FeasibilityClassifier.load(tmp_path / "probe.seqmodel")
    assert classifier.artefact.provenance["retrain"]["choice"] == choice
    assert str(tmp_path) not in json.dumps(classifier.artefact.provenance)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["none.toml", "--out", "m.seqmodel"], "none.toml: cannot be read"),
        (["FILE", "--out", "m.seqmodel", "--epochs", "0"], "--epochs 0: expected one or more"),
        (["FILE", "--out", "no/folder/m.seqmodel"], "no folder"),
        (["FILE", "--out", "m.seqmodel", "--start", "none.seqmodel"], "none.seqmodel"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(tmp_path, capsys, words, message):
    file = tmp_path / "probe.toml"
    file.write_text("dry_mass_kg = 800\nthrust_n = 0.3\nisp_s = 3000\nm0_kg = [800, 2000]\n")
    assert main(["retrain", *(str(file) if word == "FILE" else word for word in words)]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
