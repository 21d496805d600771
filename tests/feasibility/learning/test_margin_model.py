"""The margin model: trained, saved, asked about legs, and used as a pruner."""

import dataclasses
import json
import subprocess
import sys

import numpy as np
import pytest

from feasibility import (
    AllOf,
    ClassifierPruner,
    FeasibilityClassifier,
    InputError,
    KeepAll,
    Legs,
    check_pruner,
    optimise,
)
from feasibility.classifier.margin.calibration import (
    CERTAIN,
    Calibration,
    boundary_scores,
    fit_calibration,
)
from feasibility.commands.cli import main
from feasibility.constants import AU
from feasibility.dataset import Dataset
from feasibility.runtime.workers import own_threads, worker_pool
from tests.helpers.labelled import labelled_dataset

SMALL = {"layers": 2, "width": 32, "epochs": 5, "batch": 200, "device": "cpu", "threads": 1}


@pytest.fixture(scope="module")
def default():
    return FeasibilityClassifier.load("default")


@pytest.fixture(scope="module")
def legs():
    return labelled_dataset(600, seed=1).legs


def small_model(dataset=None, checkpoint=None, on_epoch=None, **changes):
    pytest.importorskip("torch")
    from feasibility.learning.margin.train import MarginRecipe, train_margin

    datasets = [labelled_dataset() if dataset is None else dataset]
    recipe = MarginRecipe(**{**SMALL, **changes})
    return train_margin(datasets, recipe, checkpoint=checkpoint, on_epoch=on_epoch)


@pytest.fixture(scope="module")
def small():
    return small_model()


def with_m0(legs, factor):
    return Legs(
        legs.rv_dep, legs.rv_arr, legs.tof_days, factor * legs.m0, legs.thrust, legs.isp, 0.0
    )


def test_a_heavier_spacecraft_is_never_more_feasible(default, legs):
    for classifier in (default, FeasibilityClassifier(small_model())):
        pruner = ClassifierPruner(classifier, recall=0.99)
        before, kept_before = np.ones(len(legs)), np.ones(len(legs), dtype=bool)
        seen = set()
        for factor in np.geomspace(0.05, 20.0, 60):
            heavier = with_m0(legs, factor)
            probability, kept = classifier.feasible_probability(heavier), pruner.keep(heavier)
            assert (probability <= before).all()
            assert (kept <= kept_before).all()
            before, kept_before = probability, kept
            seen |= set(np.round(probability, 1))
        assert len(seen) > 5
        assert (before < 0.01).mean() > 0.9


def test_the_maximum_mass_is_proportional_to_the_thrust_and_blind_to_the_initial_mass(
    default, legs
):
    stronger = Legs(legs.rv_dep, legs.rv_arr, legs.tof_days, 123.0, 3 * legs.thrust, legs.isp, 0.0)
    np.testing.assert_allclose(
        default.max_initial_mass(stronger), 3 * default.max_initial_mass(legs), rtol=1e-9
    )
    np.testing.assert_array_equal(default.margin_error(stronger), default.margin_error(legs))


def test_the_answer_for_a_leg_does_not_depend_on_the_others(default, legs):
    together = default.feasible_probability(legs)
    alone = [default.feasible_probability(legs.take([row]))[0] for row in range(0, 600, 40)]
    np.testing.assert_array_equal(together[::40], alone)
    order = np.random.default_rng(0).permutation(len(legs))
    np.testing.assert_array_equal(default.feasible_probability(legs.take(order)), together[order])


def test_the_quick_net_settles_legs_as_the_other_one_would(default, legs):
    probability, _ = default.assess(legs)
    settled = (probability == CERTAIN) | (probability == 1 - CERTAIN)
    assert 0.3 < settled.mean() < 1.0
    agree = (default.margin(legs) >= 1.0) == (probability >= 0.5)
    assert agree[settled].mean() > 0.995
    assert agree[~settled].mean() > 0.97


def test_the_pruner_honours_the_contract(default, legs):
    pruner = ClassifierPruner(default)
    check_pruner(pruner)
    check_pruner(pruner, legs.take(np.arange(100)))


def test_probabilities_are_never_nan_and_the_unknown_is_kept(default, legs):
    fast = [2 * AU, 0, 0, 0, 4e4, 0]
    unbound = Legs(fast, [0, 2 * AU, 0, -2e4, 0, 0], 300.0, 1500.0, 0.236, 4190.0, 1000.0)
    assert default.feasible_probability(unbound).tolist() == [0.5]
    assert np.isnan(default.margin(unbound)).all()
    odd = Legs(legs.rv_dep, legs.rv_arr, legs.tof_days, legs.m0, legs.thrust, 19000.0, 0.0)
    assert np.isfinite(default.feasible_probability(odd)).all()
    for strange in (unbound, odd):
        assert not default.in_domain(strange).any()
        assert ClassifierPruner(default).keep(strange).all()
        assert ClassifierPruner(default).keep_with_unknown(strange)[1].all()
        found = AllOf(KeepAll(), AllOf(ClassifierPruner(default))).survivors(strange)
        assert found.unknown.all()
        assert set(found.pruned.values()) == {0}
    kept, unknown = ClassifierPruner(default).keep_with_unknown(legs)
    np.testing.assert_array_equal(unknown, ~default.in_domain(legs))
    assert (kept | ~unknown).all()
    assert (~kept).any()
    assert default.in_domain(legs).mean() > 0.99


def test_the_default_model_knows_the_boundary(default, shared):
    table = np.load(shared / "legs" / "reference_search.npz")
    column = dict(zip(table["columns"], table["rows"].T, strict=True))
    states = [
        np.stack([column[f"{kind}{body}{axis}"] for kind in "rv" for axis in "xyz"], axis=1)
        for body in (1, 2)
    ]
    legs = Legs(*states, column["tof_days"], column["m0_kg"], column["thrust_n"],
                column["isp_s"], 0.0)  # fmt: skip
    error = np.log(default.max_initial_mass(legs) / column["m_star_kg"])
    assert np.median(np.abs(error)) < 0.003
    truth = column["m0_kg"] <= column["m_star_kg"]
    assert np.mean((default.feasible_probability(legs) >= 0.5) == truth) > 0.995


def test_a_saved_model_answers_as_the_one_that_was_trained(small, legs, tmp_path):
    small.save(tmp_path / "m.seqmodel")
    loaded = FeasibilityClassifier.load(tmp_path / "m.seqmodel")
    np.testing.assert_array_equal(
        loaded.feasible_probability(legs), FeasibilityClassifier(small).feasible_probability(legs)
    )
    measures = small.metrics["calibration"]
    assert measures["median_absolute_log_error"] < measures["hint_median_absolute_log_error"]


def test_a_model_of_other_features_is_refused(small):
    for changed in (
        dataclasses.replace(small, feature_set="margin-0"),
        dataclasses.replace(small, features=small.features[1:]),
    ):
        with pytest.raises(InputError, match="features"):
            FeasibilityClassifier(changed)
    arrays = {name: array for name, array in small.arrays.items() if name != "quick/settled"}
    with pytest.raises(InputError, match="settled"):
        FeasibilityClassifier(dataclasses.replace(small, arrays=arrays))


def test_the_same_seed_gives_the_same_model_and_an_interruption_changes_nothing(small, tmp_path):
    class InterruptedTrainingError(Exception):
        pass

    def interrupt(epoch):
        if epoch.number == 3:
            raise InterruptedTrainingError

    checkpoint = tmp_path / "checkpoint"
    with pytest.raises(InterruptedTrainingError):
        small_model(checkpoint=checkpoint, on_epoch=interrupt)
    assert checkpoint.exists()
    again = small_model(checkpoint=checkpoint)
    for name, array in small.arrays.items():
        np.testing.assert_array_equal(again.arrays[name], array)
    with pytest.raises(InputError, match="another training"):
        small_model(checkpoint=checkpoint, seed=1)


def test_datasets_without_margins_or_with_too_few_legs_are_refused():
    dataset = labelled_dataset()
    protocol = dataset.metadata["protocol"] | {"label": "convergence"}
    other = Dataset(dataset.columns, {**dataset.metadata, "protocol": protocol})
    with pytest.raises(InputError, match="convergence"):
        small_model(other)
    with pytest.raises(InputError, match="generate more legs"):
        small_model(dataset.take(np.arange(150)))
    with pytest.raises(InputError, match="width"):
        small_model(width=0)


def test_probabilities_are_the_shares_of_errors_seen():
    rng = np.random.default_rng(0)
    error = rng.uniform(0.001, 0.01, 20_000)
    residual = error * rng.standard_normal(20_000)
    calibration = Calibration(fit_calibration(residual, error))
    one = np.array([1.0])
    for estimate, share in ((0.0, 0.5), (1.0, 0.841), (-1.0, 0.159), (2.0, 0.977)):
        assert calibration.probability(estimate * one, one)[0] == pytest.approx(share, abs=0.01)
    sweep = calibration.probability(np.linspace(-50, 50, 2001), np.ones(2001))
    assert (np.diff(sweep) >= 0).all()
    assert sweep[0] == CERTAIN
    assert sweep[-1] == 1 - CERTAIN
    scores = boundary_scores(calibration, residual, error, rng)
    assert (np.diff(scores) >= 0).all()
    # Of the legs near the boundary that are feasible, most are said to be.
    assert np.mean(scores >= 0.5) > 0.9


def test_the_commands_train_and_evaluate_a_margin_model(tmp_path, monkeypatch, capsys):
    pytest.importorskip("torch")
    monkeypatch.setattr("feasibility.dataset.read_dataset", lambda _: labelled_dataset())
    out = tmp_path / "m.seqmodel"
    settings = [f"--set={name}={SMALL[name]}" for name in ("layers", "width", "batch", "threads")]
    arguments = ["train", "a", "--model", "margin", "--out", str(out), "--epochs", "3", *settings]
    assert main(arguments) == 0
    assert out.with_suffix(".png").stat().st_size > 1000
    assert not list(tmp_path.glob("*.checkpoint"))
    assert main(["evaluate", str(out), "a", "--out", str(tmp_path / "report")]) == 0
    report = json.loads((tmp_path / "report" / "metrics.json").read_text())["metrics"]
    assert report["median_log_margin_error"] > 0
    assert (tmp_path / "report" / "margin.png").exists()
    capsys.readouterr()
    assert main(["train", "a", "b", "--model", "dnn"]) == 2
    assert "several" in capsys.readouterr().err
    assert main([*arguments, "--balance", "adasyn"]) == 2
    assert main([*arguments, "--set", "wings=2"]) == 2


def test_pruning_with_the_default_model_loads_nothing_of_the_training():
    code = """
import json, sys
import feasibility
from feasibility import ClassifierPruner, FeasibilityClassifier, Legs
legs = Legs([4e11, 0, 0, 0, 1.8e4, 0], [0, 4.1e11, 0, -1.8e4, 0, 0], 400.0,
            [800.0, 900.0], 0.3, 3000.0, 800.0)
assert ClassifierPruner(FeasibilityClassifier.load("default")).keep(legs).shape == (2,)
print(json.dumps(sorted(sys.modules)))
"""
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    loaded = {name.partition(".")[0] for name in json.loads(done.stdout)}
    assert not loaded & {"torch", "sklearn", "optuna", "imblearn", "pykep", "pygmo", "matplotlib"}


def test_one_prediction_has_every_answer(default, legs):
    told = default.predict(legs)
    np.testing.assert_array_equal(told.margin, default.margin(legs))
    np.testing.assert_array_equal(told.margin_error, default.margin_error(legs))
    np.testing.assert_array_equal(told.final_mass, default.final_mass(legs))
    flyable = default.feasible_probability(legs) >= 0.5
    assert np.mean((told.probability >= 0.5) == flyable) > 0.995
    assert np.mean(told.in_domain == default.in_domain(legs)) > 0.995


def test_nothing_is_said_of_unbound_orbits(default):
    fast = [2 * AU, 0, 0, 0, 4e4, 0]
    told = default.predict(Legs(fast, fast, 300.0, 1500.0, 0.236, 4190.0, 1000.0))
    assert np.isnan([told.margin, told.margin_error, told.final_mass]).all()
    assert told.probability.tolist() == [0.5]
    assert not told.in_domain.any()


def test_the_final_mass_is_that_of_the_solver_or_of_full_thrust(default, legs):
    some = legs.take(np.arange(150))
    solved = optimise(some)
    told = default.predict(some)
    rows = np.flatnonzero(np.isfinite(solved.m_final) & solved.converged & (told.margin > 1.0))
    assert len(rows) > 30
    error = np.abs(told.final_mass[rows] / solved.m_final[rows] - 1.0)
    assert np.median(error) < 0.01
    heavy = told.margin < 1.0
    left = np.maximum(some.m0 - some.thrust * some.tof_s / some.exhaust_velocity, 0.0)
    np.testing.assert_allclose(told.final_mass[heavy], left[heavy])


def test_threads_change_no_bit_of_the_answers(default, legs):
    many = Legs.concatenate(
        [legs.take(np.random.default_rng(k).permutation(600)) for k in range(16)]
    )
    probability, inside = default.assess(many)
    for threads in (2, 3):
        again = default.assess(many, threads)
        np.testing.assert_array_equal(again[0], probability)
        np.testing.assert_array_equal(again[1], inside)
    one, two = (ClassifierPruner(default, threads=threads) for threads in (1, 2))
    np.testing.assert_array_equal(one.keep(many), two.keep(many))
    with pytest.raises(InputError, match="threads"):
        ClassifierPruner(default, threads=0)


def test_worker_processes_use_one_thread():
    with worker_pool(2) as pool:
        assert pool.submit(own_threads).result() == 1
    assert own_threads() >= 1
