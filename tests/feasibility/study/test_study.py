"""The study on tiny data: all tables and figures, nothing done twice, nothing leaked."""

import csv
import dataclasses
import functools
import json
import math
import shutil
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from feasibility import InputError
from feasibility.classifier.paper.features import FEATURES
from feasibility.commands.cli import main
from feasibility.dataset import Dataset
from feasibility.dataset.splits import pair_ids
from feasibility.study import (
    EXPERIMENTS,
    fit,
    labels,
    optimisation,
    paper_values,
    runner,
)
from feasibility.study.cells import Cells
from feasibility.study.context import Context
from feasibility.study.data import N_FOLDS, StudyData
from feasibility.study.data_size import learning_exponent
from feasibility.study.fit import MARGIN_EDGES, Fit, judge, run_fit
from feasibility.study.margin import margin_recipe, run_margin
from feasibility.study.presets import MODELS, PRESETS, find_preset
from feasibility.study.report import BY_HAND, write_document
from feasibility.study.result import Result, Table
from feasibility.study.runner import Settings, run_study
from tests.helpers.labelled import labelled_dataset, write_dataset

TINY = dataclasses.replace(
    PRESETS["quick"],
    name="tiny",
    legs=400,
    test_rows=60,
    epochs=3,
    least_steps=4,
    data_size={
        **dict.fromkeys(("ensemble", "knn", "svm", "tree"), (20, 80)),
        "dnn1": (20, 40, 80),
    },
    data_size_seeds=2,
    margin_sizes=(80,),
    comparison=dict.fromkeys(MODELS, 80),
    comparison_seeds=2,
    n_features=(30, 60, 103),
    n_features_rows=80,
    curve_rows=60,
    curve_seeds=2,
    feasible=dict.fromkeys(("ensemble", "knn", "svm", "tree", "dnn1"), 20),
    ratios=(1.0, 2.0),
    imbalance_seeds=1,
    tuning_model="tree",
    tuning_rows=60,
    tuning_trials=3,
    tuning_epochs=2,
    tuning_workers=2,
    ranking_seeds=2,
    label_legs=100,
    label_models=("tree", "dnn1"),
)


def lucky_start(legs, seed, start, first):
    """Converge by luck where half the mass can be flown: a stand-in for a second of solving."""
    luck = np.random.default_rng([seed, start, first]).uniform(size=len(legs))
    return [bool(value) for value in (luck < 0.7) & (legs.m0 < 2000.0)]


@pytest.fixture(scope="module")
def dataset():
    return labelled_dataset(legs=400)


@pytest.fixture(scope="module")
def data(dataset):
    return StudyData.build(dataset, TINY, seed=0)


@pytest.fixture(scope="module")
def study(dataset, tmp_path_factory):
    """Settings, results and progress of a whole tiny study."""
    folder = tmp_path_factory.mktemp("study")
    tiny = Settings(
        preset=TINY,
        out=folder / "out",
        data=write_dataset(dataset, folder / "legs"),
        workers=1,
        threads=1,
    )
    lines: list[str] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(labels, "converged", lucky_start)
        results = run_study(tiny, tuple(EXPERIMENTS), lines.append)
    return tiny, results, lines


@pytest.fixture
def context(data, tmp_path):
    return Context(
        preset=TINY,
        data=data,
        cells=Cells(tmp_path / "cells", lambda _: None),
        out=tmp_path,
        workers=1,
        threads=1,
        device="cpu",
        precision="auto",
        say=lambda _: None,
    )


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_every_table_and_figure_is_written(study, name):
    tiny, results, _ = study
    result = results[name]
    assert result.tables
    assert result.figures
    assert result.findings
    for table in result.tables:
        with (tiny.out / name / f"{table.name}.csv").open(encoding="utf-8", newline="") as file:
            header, *rows = csv.reader(file)
        assert tuple(header) == table.columns
        assert len(rows) == len(table.rows) > 0
        markdown = (tiny.out / name / f"{table.name}.md").read_text(encoding="utf-8")
        assert len(markdown.splitlines()) == len(table.rows) + 2
    for figure in result.figures:
        png = (tiny.out / name / f"{figure}.png").read_bytes()
        assert png.startswith(b"\x89PNG")
        assert len(png) > 5000
        svg = ElementTree.parse(tiny.out / name / f"{figure}.svg").getroot()
        assert svg.tag.endswith("svg")


def test_a_second_run_repeats_nothing_and_says_the_same(study):
    tiny, results, lines = study
    cells = sorted((tiny.out / "cells").glob("*.json"))
    written = [path.stat().st_mtime_ns for path in cells]
    again: list[str] = []
    repeated = run_study(tiny, tuple(EXPERIMENTS), again.append)
    assert [path.stat().st_mtime_ns for path in cells] == written
    assert sorted((tiny.out / "cells").glob("*.json")) == cells
    assert repeated == results
    computed = [line for line in lines if line.endswith(" s") and "  " in line]
    assert len(computed) == len(cells)
    assert not [line for line in again if line in computed]


def test_an_interrupted_study_computes_only_what_is_missing(study, tmp_path):
    tiny, results, _ = study
    shutil.copytree(tiny.out, tmp_path / "out")
    tiny = dataclasses.replace(tiny, out=tmp_path / "out")
    lost = next((tiny.out / "cells").glob("knn-*-adasyn-*.json"))
    kept = {path: path.stat().st_mtime_ns for path in (tiny.out / "cells").glob("*.json")}
    del kept[lost]
    lost.unlink()
    assert run_study(tiny, ["imbalance"]) == {"imbalance": results["imbalance"]}
    assert lost.exists()
    assert {path: path.stat().st_mtime_ns for path in kept} == kept


def test_a_folder_of_another_study_is_refused(study):
    tiny, _, _ = study
    other = dataclasses.replace(tiny, preset=dataclasses.replace(TINY, epochs=4))
    with pytest.raises(InputError, match="another sizes"):
        run_study(other, ["importance"])
    other = dataclasses.replace(tiny, seed=1)
    with pytest.raises(InputError, match="another seed"):
        run_study(other, ["importance"])


def test_table_6_stands_beside_ours(study):
    _, results, _ = study
    rows = results["comparison"].tables[0].rows
    for model, name in (("dnn1", "DNN1"), ("knn", "KNN")):
        ours, paper = (row for row in rows if row[0] == name)
        assert paper[3:] == paper_values.TABLE_6[model]
        assert [float(value.split(" ± ")[0]) for value in ours[3:]] == pytest.approx(
            [0.75] * 6, abs=0.25
        )


def test_the_margin_model_is_the_last_row_of_table_6_and_a_curve_of_figure_3(study):
    _, results, _ = study
    row = results["comparison"].tables[0].rows[-1]
    assert row[:3] == ("Margin model", "ours, 2 seeds", 80)
    # From 80 legs it knows more than chance: it starts from a physical estimate.
    assert float(row[3].split(" ± ")[0]) > 0.75
    sizes = [row[1] for row in results["data_size"].tables[0].rows if row[0] == "Margin model"]
    assert sizes == [80]
    assert results["comparison"].tables[1].columns[-1] == "Margin model"


def test_a_study_that_was_done_before_the_margin_model_gets_only_its_cells(study, tmp_path):
    tiny, results, _ = study
    shutil.copytree(tiny.out, tmp_path / "out")
    cells = tmp_path / "out" / "cells"
    for path in cells.glob("margin-*.json"):
        path.unlink()
    others = set(cells.glob("*.json"))
    lines: list[str] = []
    again = run_study(dataclasses.replace(tiny, out=cells.parent), ["comparison"], lines.append)
    assert {path.name.split("-")[0] for path in set(cells.glob("*.json")) - others} == {"margin"}
    assert again["comparison"].tables[1] == results["comparison"].tables[1]


def test_the_margin_model_learns_the_same_wherever_it_is_computed(context):
    one = run_margin(context, 60, 0)
    elsewhere = dataclasses.replace(context, threads=2)
    assert run_margin(elsewhere, 60, 0) == one
    assert context.cells.computed == 1
    assert one.legs == 60
    epochs = [margin_recipe(context, legs, 0).epochs for legs in (1000, 100_000, 400_000)]
    assert epochs == sorted(epochs, reverse=True)


def test_an_optimisation_reports_all_trials_of_both_kinds(study):
    _, results, _ = study
    times, _, trials = results["optimisation"].tables
    assert [row[:3] for row in times.rows] == [("sequential", 1, 3), ("parallel", 2, 3)]
    assert len(trials.rows) == 6


def test_the_report_has_all_sections_and_keeps_what_was_written_by_hand(study, tmp_path):
    tiny, results, _ = study
    document = write_document(tiny.out, tmp_path / "study.md")
    text = document.read_text(encoding="utf-8")
    for result in results.values():
        assert f"## {result.title}" in text
        for figure in result.figures:
            assert f"](study/{result.name}/{figure}.png)" in text
            assert (tmp_path / "study" / result.name / f"{figure}.png").exists()
    assert str(tiny.out) not in text
    document.write_text(text + "\nOur conclusion.\n", encoding="utf-8")
    write_document(tiny.out, document)
    assert document.read_text(encoding="utf-8") == text + "\nOur conclusion.\n"
    assert text.count(BY_HAND) == 1


def test_results_read_back_as_written(study):
    tiny, results, _ = study
    for name, result in results.items():
        assert Result.read(tiny.out, name) == result
    assert Result.read(tiny.out, "no-such") is None
    (tiny.out / "broken").mkdir(exist_ok=True)
    (tiny.out / "broken" / "result.json").write_text("{}", encoding="utf-8")
    with pytest.raises(InputError, match="expected the result of an experiment"):
        Result.read(tiny.out, "broken")


def test_no_pair_of_bodies_is_in_two_folds_or_in_fold_and_test(dataset, data):
    pairs = pair_ids(data.legs.dep_id, data.legs.arr_id)
    parts = [set(pairs[data.pool[data.folds == fold]]) for fold in range(N_FOLDS)]
    parts.append(set(pairs[data.test]))
    assert sum(len(part) for part in parts) == len(set().union(*parts))
    # Pairs recur in these legs, so that a split by rows would have been caught.
    assert len(set(pairs)) < len(pairs)


def test_the_test_set_is_balanced(data):
    assert len(data.test) == 60 or len(data.test) == 2 * (~data.y[data.test]).sum()
    assert data.y[data.test].mean() == 0.5
    for fold in range(N_FOLDS):
        assert data.y[data.fold_rows(fold, 0)].mean() == 0.5


@given(
    feasible=st.integers(1, 60),
    infeasible=st.integers(1, 60),
    more=st.integers(0, 60),
    seed=st.integers(0, 5),
    fold=st.none() | st.integers(0, N_FOLDS - 1),
)
@settings(max_examples=30)
def test_draws_are_nested_and_stay_in_the_pool(data, feasible, infeasible, more, seed, fold):
    small = data.draw(feasible, infeasible, seed, without_fold=fold)
    large = data.draw(feasible + more, infeasible + more, seed, without_fold=fold)
    allowed = data.pool if fold is None else data.pool[data.folds != fold]
    assert len(set(large)) == len(large)
    assert set(small) <= set(large) <= set(allowed)
    assert data.y[small].sum() == min(feasible, data.y[allowed].sum())


def test_no_synthetic_row_reaches_the_test(context, data, monkeypatch):
    seen = {}

    class Recorder:
        def __init__(self):
            self.config = {}

        def fit(self, X, y, **_):
            seen.update(X=X, y=y)
            return self

        def predict_probability(self, X):
            seen.update(X_test=X)
            return np.linspace(0.0, 1.0, len(X))

    monkeypatch.setattr(fit, "build_model", lambda *_: Recorder())
    spec = Fit("tree", 20, 60, seed=1, adasyn=True)
    outcome = run_fit(context, spec)
    assert outcome.synthetic > 0
    assert len(seen["X"]) == 80 + outcome.synthetic
    assert seen["y"][80:].all()
    assert len(seen["X_test"]) == len(data.test)
    rows = data.draw(20, 60, 1)
    raw = data.X[np.ix_(rows, context.columns(60))]
    scale, shift = raw.std(axis=0), raw.mean(axis=0)
    np.testing.assert_allclose(seen["X"][:80] * scale + shift, raw, rtol=1e-6, atol=1e-3)
    expected = data.X[np.ix_(data.test, context.columns(60))]
    np.testing.assert_allclose(seen["X_test"] * scale + shift, expected, rtol=1e-6, atol=1e-3)


def test_a_cross_validated_fit_is_tested_on_its_fold_alone(context, data):
    outcome = run_fit(context, Fit("tree", 20, 20, seed=2, fold=2))
    assert outcome.metrics["n"] == len(data.fold_rows(2, 2))


def test_a_dataset_without_margins_is_refused(dataset):
    protocol = {**dataset.metadata["protocol"], "label": "convergence", "name": "paper"}
    other = Dataset(dataset.columns, {**dataset.metadata, "protocol": protocol})
    with pytest.raises(InputError, match="expected 'margin'"):
        StudyData.build(other, TINY, 0)


def test_a_dataset_of_one_class_is_refused(dataset):
    with pytest.raises(InputError, match="too few of a class"):
        StudyData.build(dataset.take(dataset.columns["log_margin"] > 0), TINY, 0)


def test_small_training_sets_get_more_epochs_but_no_fewer(context):
    large, small = (fit.build_model(context, "dnn1", n).config for n in (10_000, 100))
    assert (large["epochs"], large["drop_period"]) == (3, 6)
    assert (small["epochs"], small["drop_period"]) == (4, 8)


def test_cells_come_back_from_the_disk_and_the_executor_alike(tmp_path):
    calls = []

    def compute(k):
        calls.append(k)
        return {"square": k * k}

    wanted = [(f"cell{k}", {"k": k}, functools.partial(compute, k)) for k in range(5)]
    cells = Cells(tmp_path, lambda _: None)
    assert cells.get("cell2", {"k": 2}, functools.partial(compute, 2)) == {"square": 4}
    with ThreadPoolExecutor(2) as executor:
        values = cells.get_many(wanted, executor)
    assert values == [{"square": k * k} for k in range(5)]
    assert sorted(calls) == [0, 1, 2, 3, 4]
    assert (cells.computed, cells.reused) == (5, 1)
    assert Cells(tmp_path, print).get_many(wanted, None) == values
    assert len(calls) == 5


def test_a_damaged_cell_is_named(tmp_path):
    cells = Cells(tmp_path, lambda _: None)
    path = cells.path("cell", {})
    path.write_text("{", encoding="utf-8")
    with pytest.raises(InputError, match="expected a cell of a study"):
        cells.get("cell", {}, lambda: 1)


@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=30))
def test_disagreement_of_two_starts_bounds_the_ideal_error(chances):
    p = np.array(chances)
    disagreement = np.mean(2.0 * p * (1.0 - p))
    ideal = np.mean(np.minimum(p, 1.0 - p))
    assert disagreement / 2.0 - 1e-12 <= ideal <= disagreement + 1e-12


def test_the_labels_table_counts_disagreement(study):
    _, results, _ = study
    noise = dict(results["labels"].tables[0].rows)
    assert noise["legs"] == 100
    low = noise["error of the ideal classifier on the converged label, at least"]
    assert 2.0 * low == noise["two starts disagree"] > 0


def test_predictions_are_counted_in_their_margin_bins():
    y = np.array([True, False, True, False, True, False])
    probability = np.array([0.9, 0.1, 0.2, 0.3, 0.8, 0.9])
    log_margin = np.array([0.005, -0.005, 0.3, -0.3, 3.0, -3.0])
    outcome = judge(
        y,
        probability,
        log_margin,
        legs=1,
        synthetic=0,
        fit_seconds=0.0,
        predict_seconds=0.0,
        epochs=[],
    )
    assert outcome.margin_count == [2, 0, 0, 0, 0, 2, 0, 2]
    assert outcome.margin_right == [2, 0, 0, 0, 0, 1, 0, 1]
    assert len(outcome.margin_count) == len(MARGIN_EDGES)
    assert json.loads(json.dumps(dataclasses.asdict(outcome)))["metrics"]["n"] == 6


@given(st.floats(0.1, 5.0), st.floats(0.05, 1.5))
def test_a_power_law_is_recovered(scale, exponent):
    sizes = [1000, 5000, 20_000]
    errors = [scale * size**-exponent for size in sizes]
    assert learning_exponent(sizes, errors) == pytest.approx((scale, exponent), rel=1e-6)


def test_the_best_so_far_never_falls():
    trials = [{"value": value} for value in (None, 0.5, 0.4, None, 0.7)]
    assert optimisation.best_so_far({"trials": trials}) == [None, 0.5, 0.5, 0.5, 0.7]


@pytest.mark.parametrize("preset", PRESETS.values(), ids=lambda preset: preset.name)
def test_presets_ask_for_what_exists(preset):
    assert {*preset.data_size, *preset.feasible, *preset.label_models} <= set(MODELS)
    assert set(preset.comparison) == set(MODELS)
    assert max(preset.n_features) <= len(FEATURES)
    assert preset.data_size_seeds >= 3
    assert preset.n_features_folds <= N_FOLDS
    assert max(map(max, preset.data_size.values())) < preset.legs
    assert set(preset.margin_sizes) <= set(preset.data_size["dnn1"])
    assert set(preset.n_features) == set(paper_values.TABLE_4)


@pytest.mark.parametrize(
    ("given", "precision", "expected"),
    [(None, "bfloat16", 1), (None, "float32", 6), (3, "bfloat16", 3), (3, "float32", 3)],
)
def test_threads_follow_the_precision_unless_given(monkeypatch, given, precision, expected):
    monkeypatch.setattr(runner, "default_workers", lambda: 6)
    assert runner._threads(Settings(TINY, Path("out"), threads=given), precision) == expected


def test_large_training_sets_are_drawn_less_often():
    few = dataclasses.replace(TINY, large=80, large_seeds=1)
    assert [len(few.seeds(3, samples)) for samples in (79, 80, 400)] == [3, 1, 1]
    assert len(TINY.seeds(2, 10**6)) == 2


def test_a_preset_file_changes_what_it_names(tmp_path):
    path = tmp_path / "evening.toml"
    path.write_text('base = "laptop"\nlegs = 120000\n[data_size]\ndnn1 = [1000, 70000]\n')
    preset = find_preset(str(path))
    laptop = PRESETS["laptop"]
    assert preset == dataclasses.replace(
        laptop,
        name="evening",
        legs=120_000,
        data_size={**laptop.data_size, "dnn1": (1000, 70_000)},
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("legs = ", "not valid TOML"),
        ("leg = 5", "unknown key 'leg'"),
        ('base = "huge"', "expected one of quick"),
        ('legs = "many"', "legs"),
        ("[comparison]\ndnn1 = 1.5", "comparison"),
    ],
)
def test_a_damaged_preset_file_is_named(tmp_path, text, message):
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=f"mine.toml.*{message}"):
        find_preset(str(path))


def test_paper_values_obey_their_own_equations():
    for accuracy, precision, recall, f1, f10, area in paper_values.TABLE_6.values():
        assert f1 == pytest.approx(2 * precision * recall / (precision + recall), abs=2e-4)
        weighted = 101 * precision * recall / (100 * precision + recall)
        assert f10 == pytest.approx(weighted, abs=2e-4)
        # A balanced test set: accuracy follows from precision and recall.
        specificity = 1.0 - recall * (1.0 / precision - 1.0)
        assert accuracy == pytest.approx(0.5 * (recall + specificity), abs=3e-3)
        assert not math.isnan(area)


def test_a_table_of_the_wrong_width_is_refused():
    with pytest.raises(ValueError, match="row of 2"):
        Table("t", "t", ("a",), ((1, 2),))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["study", "all", "--preset", "huge"], "expected one of quick, laptop, paper"),
        (["study", "report", "--out", "OUT"], "expected the record of a study"),
        (["study", "importance", "--data", "OUT"], "no such file"),
        (["study", "importance", "--data", "OUT", "--catalogue", "x"], "expected one of them"),
        (["study", "importance", "--workers", "0"], "expected one or more"),
        (["study", "importance", "--seed", "-1"], "expected zero or more"),
    ],
)
def test_bad_input_ends_with_one_line(arguments, message, tmp_path, capsys):
    words = [str(tmp_path / "none") if word == "OUT" else word for word in arguments]
    assert main(words) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert not (tmp_path / "none").exists()


def test_the_report_command_writes_report_and_document(study, tmp_path, capsys):
    tiny, _, _ = study
    words = ["study", "report", "--out", str(tiny.out), "--docs", str(tmp_path / "study.md")]
    assert main(words) == 0
    assert (tiny.out / "report.md").exists()
    assert (tmp_path / "study.md").exists()


@pytest.mark.slow
def test_convergence_from_a_random_start_is_the_same_for_the_same_seed(data):
    legs = data.legs.take(np.flatnonzero(data.log_margin > 0.5)[:3])
    first, again = (labels.converged(legs, 0, 0, 0) for _ in range(2))
    assert first == again
    assert len(first) == 3
