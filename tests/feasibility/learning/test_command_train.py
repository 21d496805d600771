"""``feasibility train`` and ``feasibility evaluate``, as a user types them."""

import json
import re

import numpy as np
import pytest

from feasibility.classifier.classifier import FeasibilityClassifier
from feasibility.commands.cli import main
from tests.helpers.labelled import labelled_dataset, write_dataset

pytest.importorskip("sklearn")
pytest.importorskip("torch")
pytest.importorskip("pyarrow")


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    return str(write_dataset(labelled_dataset(), tmp_path_factory.mktemp("data") / "table1"))


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


SMALL = ["--set", "layers=2", "--set", "width=20", "--set", "threads=1"]


def test_a_network_is_trained_saved_and_judged(data, folder, capsys):
    arguments = ["train", data, "--preset", "dnn1", "--epochs", "3", *SMALL]
    assert main([*arguments, "--features", "12", "--out", "net.seqmodel"]) == 0
    out = capsys.readouterr().out
    assert "epoch   3: rate 3.10e-03" in out
    assert "validation: accuracy" in out
    classifier = FeasibilityClassifier.load("net.seqmodel")
    assert len(classifier.artefact.features) == 12
    config = classifier.artefact.config
    assert config["recipe"]["hyperparameters"]["beta1"] == 0.9041
    assert len(config["epochs"]) == 3
    assert not (folder / "net.seqmodel.checkpoint").exists()

    assert main(["evaluate", "net.seqmodel", data, "--out", "report"]) == 0
    assert re.search(r"\| auc +\| 0\.", capsys.readouterr().out)
    report = json.loads((folder / "report" / "metrics.json").read_text())
    legs = labelled_dataset()
    probability = classifier.feasible_probability(legs.legs)
    feasible = legs.columns["log_margin"] >= 0
    assert report["metrics"]["accuracy"] == pytest.approx(
        np.mean((probability >= 0.5) == feasible)
    )
    near = np.abs(legs.columns["m_star_kg"] / legs.columns["m0_kg"] - 1) <= 0.05
    assert report["metrics"]["accuracy_within_5_percent"] == pytest.approx(
        np.mean((probability >= 0.5)[near] == feasible[near])
    )
    for row in report["pruning"]:
        assert row["recall"] == pytest.approx(np.mean(probability[feasible] >= row["threshold"]))
    for name in ("roc.png", "reliability.png"):
        assert (folder / "report" / name).read_bytes().startswith(b"\x89PNG")
    assert re.search(r"\| recall +\|", (folder / "report" / "metrics.md").read_text())


def test_an_interrupted_training_goes_on(data, folder, capsys, monkeypatch):
    from feasibility.commands import train as command_train

    arguments = ["train", data, "--epochs", "3", "--features", "103", *SMALL]
    printing = command_train._print_epoch

    def interrupt(epoch):
        printing(epoch)
        if epoch.number == 2:
            raise KeyboardInterrupt

    monkeypatch.setattr(command_train, "_print_epoch", interrupt)
    assert main(arguments) == 130
    assert not (folder / "dnn.seqmodel").exists()
    monkeypatch.setattr(command_train, "_print_epoch", printing)
    capsys.readouterr()
    assert main(arguments) == 0
    out = capsys.readouterr().out
    assert "epoch   3" in out
    assert "epoch   2" not in out

    assert main([*arguments, "--out", "whole.seqmodel"]) == 0
    resumed, whole = (
        FeasibilityClassifier.load(f"{name}.seqmodel").artefact for name in ("dnn", "whole")
    )
    for name, array in whole.arrays.items():
        assert np.array_equal(resumed.arrays[name], array)
    assert [epoch["number"] for epoch in resumed.config["epochs"]] == [1, 2, 3]


@pytest.mark.parametrize("balance", ["none", "adasyn"])
def test_a_baseline_is_trained_under_its_own_name(data, folder, capsys, balance):
    assert main(["train", data, "--model", "tree", "--features", "9", "--balance", balance]) == 0
    synthetic = FeasibilityClassifier.load("tree.seqmodel").artefact.config["legs"]["synthetic"]
    assert (synthetic > 0) == (balance == "adasyn")
    assert f"{synthetic} synthetic" in capsys.readouterr().out


@pytest.mark.parametrize("storage", [[], ["--storage", "sqlite:///shared.db"]])
def test_hyperparameters_are_tuned_first_and_the_same_command_goes_on(
    data, folder, capsys, storage
):
    command = ["train", data, "--model", "tree", "--features", "9", *storage]
    command += ["--set", "criterion=entropy"]
    assert main([*command, "--tune", "2"]) == 0
    assert main([*command, "--tune", "3"]) == 0
    out = capsys.readouterr().out
    assert [int(number) for number in re.findall(r"^trial +(\d+): accuracy", out, re.M)] == [
        0,
        1,
        2,
    ]
    assert "best: min_samples_leaf" in out
    recipe = FeasibilityClassifier.load("tree.seqmodel").artefact.config["recipe"]
    assert recipe["hyperparameters"]["criterion"] == "entropy"
    assert f"min_samples_leaf {recipe['hyperparameters']['min_samples_leaf']}" in out
    assert (folder / "tree.seqmodel.trials").exists() == (not storage)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["train", "nowhere"], "nowhere"),
        (["train", "DATA", "--model", "tree", "--epochs", "3"], "--epochs"),
        (["train", "DATA", "--model", "tree", "--preset", "dnn1"], "--preset dnn1"),
        (["train", "DATA", "--model", "tree", "--set", "depth=3"], "depth"),
        (["train", "DATA", "--model", "tree", "--set", "depth"], "NAME=VALUE"),
        (["train", "DATA", "--features", "200"], "200"),
        (["train", "DATA", "--storage", "sqlite:///x.db"], "--storage: goes with --tune"),
        (["train", "DATA", "--model", "margin", "--tune", "3"], "not for margin"),
        (["train", "DATA", "--preset", "dnn1", "--tune", "3"], "not for dnn1"),
        (["train", "DATA", "--tune", "0"], "--tune 0: expected one or more"),
        (["train", "DATA", "--tune", "1", "--storage", "x.db"], "expected the URL of a storage"),
        (["train", "DATA", "--seed", "-1"], "--seed"),
        (["train", "DATA", "--out", "no/such/folder/m.seqmodel"], "no folder"),
        (["evaluate", "none.seqmodel", "DATA"], "none.seqmodel"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(data, folder, capsys, arguments, message):
    assert main([data if word == "DATA" else word for word in arguments]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
