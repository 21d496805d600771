"""Ensembles in one stack of matrices, packed legs, and a student that learns from teachers."""

import importlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from feasibility import FeasibilityClassifier, InputError
from feasibility.classifier.margin.network import MarginNet
from feasibility.classifier.margin.views import FREE_ENDS, RENDEZVOUS
from feasibility.dataset import read_dataset
from feasibility.dataset.generate import begin
from feasibility.dataset.protocol import read_protocol
from feasibility.dataset.splits import pairs_of_bodies
from feasibility.learning.margin.distil import Distillation, UnsolvedLegs, distil
from feasibility.learning.margin.examples import MarginExamples
from feasibility.learning.margin.packed import pack, unpack
from feasibility.learning.margin.stack import Lessons, StackRecipe, fit_stack, mean_opinion

torch = pytest.importorskip("torch")

TRAINING = Path(__file__).resolve().parents[3] / "training"

SMALL = StackRecipe(count=2, layers=2, width=16, epochs=30, batch=128, device="cpu", threads=1)


def lessons(n: int = 1500) -> Lessons:
    rng = np.random.default_rng(3)
    X = rng.standard_normal((n, 5))
    value = 0.05 * np.sin(X[:, 0]) + 0.02 * X[:, 1]
    return Lessons(X, value, np.ones(n), value)


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory):
    folder = tmp_path_factory.mktemp("legs") / "launch"
    begin(read_protocol("launch"), 300, folder, seed=5).run()
    return read_dataset(folder)


def test_stacked_nets_learn_and_differ():
    told = lessons()
    nets = fit_stack(told, SMALL)
    miss = [np.abs(MarginNet(net)(told.X)[0] - told.target) for net in nets]
    assert max(np.median(one) for one in miss) < 0.2 * np.median(np.abs(told.target))
    assert not np.allclose(nets[0]["weight_0"], nets[1]["weight_0"])


def test_the_second_output_learns_the_size_of_the_error():
    told = lessons(3000)
    rng = np.random.default_rng(4)
    noise = np.where(told.X[:, 2] > 0.0, 0.03, 0.003) * rng.laplace(size=3000)
    noisy = told.target + noise
    recipe = replace(SMALL, count=1, epochs=100, learning_rate=1e-2)
    (net,) = fit_stack(Lessons(told.X, noisy, told.weight, noisy), recipe)
    expected = MarginNet(net)(told.X)[1]
    loud = told.X[:, 2] > 0.5
    quiet = told.X[:, 2] < -0.5
    assert np.median(expected[loud]) > 3.0 * np.median(expected[quiet])


def test_rows_without_weight_or_truth_teach_nothing_about_it():
    told = lessons()
    spoiled = told.target.copy()
    spoiled[1000:] += 1.0
    weight = np.where(np.arange(1500) < 1000, 1.0, 0.0)
    (net,) = fit_stack(Lessons(told.X, spoiled, weight, told.truth), replace(SMALL, count=1))
    assert np.median(np.abs(MarginNet(net)(told.X)[0] - told.target)) < 0.01
    unknown = np.full(1500, np.nan)
    (net,) = fit_stack(Lessons(told.X, told.target, told.weight, unknown), replace(SMALL, count=1))
    # Nothing is known of the errors: the net keeps the size it began with, its unit.
    assert np.median(MarginNet(net)(told.X)[1]) == pytest.approx(0.02, rel=0.5)


def test_the_same_seed_gives_the_same_nets():
    told = lessons(400)
    recipe = replace(SMALL, epochs=2)
    once, again = fit_stack(told, recipe), fit_stack(told, recipe)
    for name in once[0]:
        np.testing.assert_array_equal(once[1][name], again[1][name])
    other = fit_stack(told, replace(recipe, seed=1))
    assert not np.array_equal(once[0]["weight_0"], other[0]["weight_0"])


def test_the_mean_opinion_is_the_mean_of_the_nets():
    told = lessons(700)
    nets = fit_stack(told, replace(SMALL, epochs=3, count=3))
    mean = np.mean([MarginNet(net)(told.X)[0] for net in nets], axis=0)
    np.testing.assert_allclose(mean_opinion(nets, told.X, device="cpu"), mean, atol=1e-6)


def test_bad_recipes_are_refused():
    with pytest.raises(InputError, match="stack epochs: 0"):
        StackRecipe(epochs=0)
    with pytest.raises(InputError, match="device"):
        StackRecipe(device="tpu")
    with pytest.raises(InputError, match="at least one batch of 128"):
        fit_stack(lessons(100), SMALL)


def test_packed_legs_are_the_legs(dataset, tmp_path: Path):
    file = tmp_path / "legs.npz"
    assert pack([dataset, dataset], FREE_ENDS, file) == 600
    found = unpack(file)
    legs = dataset.legs
    np.testing.assert_allclose(found.legs.rv_dep[:300], legs.rv_dep, rtol=1e-6)
    np.testing.assert_allclose(found.legs.vinf_dep[300:], legs.vinf_dep, rtol=1e-6)
    np.testing.assert_allclose(found.m_star[:300], dataset.columns["m_star_kg"], rtol=1e-6)
    np.testing.assert_array_equal(found.dataset, np.repeat([0, 1], 300))
    np.testing.assert_array_equal(found.pairs, np.concatenate(pairs_of_bodies([dataset, dataset])))


def test_packing_refuses_what_has_none_and_unpacking_what_is_none(dataset, tmp_path: Path):
    with pytest.raises(InputError, match="no leg of this sort"):
        pack([dataset], RENDEZVOUS, tmp_path / "legs.npz")
    other = tmp_path / "other.npz"
    other.write_bytes(b"PK\x03\x04 nothing")
    with pytest.raises(InputError, match=r"other\.npz: not a file of packed legs"):
        unpack(other)


def test_a_student_replaces_one_net_and_nothing_else(dataset):
    start = FeasibilityClassifier.load("default").artefact
    examples = MarginExamples.of([dataset], FREE_ENDS)
    unsolved = UnsolvedLegs(
        X=examples.X[:100].astype(np.float32),
        hint=examples.hint[:100],
        least=np.full(100, -np.inf),
        most=np.full(100, np.inf),
    )
    recipe = replace(SMALL, epochs=2, batch=64)
    said = []
    found = distil(
        examples, unsolved, FREE_ENDS, start, Distillation(recipe, recipe),
        on_epoch=lambda who, epoch, loss: said.append((who, epoch)),
    )  # fmt: skip
    assert said == [("teachers", 1), ("teachers", 2), ("student", 1), ("student", 2)]
    changed = {
        name.rsplit("/", 1)[0]
        for name, array in found.model.arrays.items()
        if name not in start.arrays or not np.array_equal(array, start.arrays[name])
    }
    assert changed <= {FREE_ENDS.section("model"), FREE_ENDS.section("calibration")}
    assert FREE_ENDS.section("model") in changed
    assert {len(error) for error in found.errors.values()} == {len(found.held_out)}
    answer = FeasibilityClassifier(found.model).predict(dataset.legs)
    assert np.all(np.isfinite(answer.margin))


def test_the_program_packs_and_trains(shared, tmp_path: Path, monkeypatch, capsys):
    monkeypatch.syspath_prepend(str(TRAINING))
    program = importlib.import_module("distil")
    monkeypatch.setattr(program, "LEGS", {"free-ends": {"launch": 150, "flyby": 150}})
    monkeypatch.setattr(program, "MORE", {"free-ends": {"flyby": 40}})
    monkeypatch.setattr(program, "HARD", {"free-ends": {"flyby": ((40, 103),)}})
    monkeypatch.setattr(program, "_DRAWN_AT_ONCE", 100)
    file, model = tmp_path / "legs.npz", tmp_path / "better.seqmodel"
    common = ["--file", str(file), "--workers", "1", "--shared", str(shared)]
    monkeypatch.setattr(
        "sys.argv", ["distil", "pack", "free-ends", "--out", str(tmp_path / "legs"), *common]
    )
    assert program.main() == 0
    assert "380 legs" in capsys.readouterr().out
    small = [
        "--teachers",
        "2",
        "--width",
        "16",
        "--teacher-epochs",
        "5",
        "--student-epochs",
        "5",
        "--batch",
        "64",
    ]
    monkeypatch.setattr(
        "sys.argv",
        ["distil", "train", "free-ends", "--model", str(model), "--unsolved", "200", "--device",
         "cpu", *small, *common],
    )  # fmt: skip
    assert program.main() == 0
    printed = capsys.readouterr().out
    assert "teachers 5" in printed
    assert "dataset 3" in printed
    record = FeasibilityClassifier.load(str(model)).artefact.provenance["distilled"]["free-ends"]
    assert record["legs"] > 370
    assert record["unsolved"] > 150
