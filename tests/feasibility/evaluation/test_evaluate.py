"""`feasibility evaluate`: a model beside closed forms and a public network, by family."""

import json
import sys
import types

import numpy as np
import pytest

from feasibility import FeasibilityClassifier, LambertPruner, Mima2Pruner, MimaPruner
from feasibility.commands.cli import main
from feasibility.constants import MU_SUN
from feasibility.dataset import Dataset
from feasibility.evaluation.evaluate import by_family, evaluate
from feasibility.evaluation.peers import NEURAL, Peer, ask, known_peers, lambert_score
from feasibility.legs import Legs
from tests.helpers.labelled import labelled_dataset, write_dataset

PACKAGE = FeasibilityClassifier.load("default")


@pytest.fixture(scope="module")
def dataset():
    return labelled_dataset(500, seed=3)


@pytest.fixture(autouse=True)
def no_network(monkeypatch):
    """Let no test depend on whether the package is installed."""
    monkeypatch.setitem(sys.modules, NEURAL, None)


def cells(line):
    """Return the entries of a line of a Markdown table."""
    return [cell.strip() for cell in line.strip("|").split("|")]


def scores(legs):
    peers, _ = known_peers()
    return {peer.name: peer.score(legs) for peer in peers}


def test_scores_of_closed_forms_decide_as_the_pruners_do(dataset):
    legs = dataset.legs
    found = scores(legs)
    for name, pruner in (("MIMA", MimaPruner()), ("MIMA2", Mima2Pruner())):
        kept = pruner.keep(legs)
        assert 0 < kept.sum() < len(kept)
        np.testing.assert_array_equal(found[name] >= 0, kept)


@pytest.mark.parametrize("dry_share", [0.0, 0.5, 0.9])
def test_the_lambert_score_decides_as_the_lambert_pruner_does(dataset, dry_share):
    old = dataset.legs
    dry = dry_share * old.m0
    legs = Legs(old.rv_dep, old.rv_arr, old.tof_days, old.m0, old.thrust, old.isp, dry)
    kept = LambertPruner().keep(legs)
    assert kept.any()
    np.testing.assert_array_equal(lambert_score(legs) >= 0, kept)


def test_figures_of_a_peer_are_those_of_its_answers(dataset):
    rng = np.random.default_rng(0)
    log_margin = dataset.columns["log_margin"].copy()
    y = log_margin >= 0
    score = log_margin + 0.3 * rng.standard_normal(len(y))
    score[7] = np.nan
    outcome = ask(Peer("noisy", lambda legs: score[: len(legs)]), dataset.legs, y, log_margin)
    said = score >= 0
    assert outcome.metrics["accuracy"] == pytest.approx(np.mean(said == y))
    assert outcome.metrics["recall"] == pytest.approx(said[y].mean())
    near = np.abs(np.expm1(log_margin)) <= 0.15
    assert outcome.metrics["accuracy_within_15_percent"] == pytest.approx(
        np.mean((said == y)[near])
    )
    assert outcome.metrics["accuracy"] < outcome.metrics["auc"] < 1.0


def test_the_public_network_is_left_out_with_a_reason_where_it_is_not_installed():
    peers, reason = known_peers()
    assert [peer.name for peer in peers] == ["Lambert", "MIMA", "MIMA2"]
    assert "neural_lowthrust is left out" in reason


def test_the_public_network_is_asked_in_si_with_the_specific_impulse_in_s(
    dataset, monkeypatch, tmp_path
):
    rows = []

    class Predictor:
        def __init__(self, folder):
            assert folder.endswith("eigen_model_tmin_large")

        def fast_predict_vector_tmin(self, row):
            return 0.5 * row[12] if row[13] < 2000.0 else float("nan")

    def lambert(row):
        rows.append(row)
        return row

    package = types.ModuleType(NEURAL)
    package.__file__ = str(tmp_path / "__init__.py")
    package.EigenFastPredictor = Predictor
    package.nn_input_1_rotate_lambert = lambert
    monkeypatch.setitem(sys.modules, NEURAL, package)
    peers, reason = known_peers()
    assert reason is None
    legs = dataset.legs
    score = peers[-1].score(legs)
    np.testing.assert_allclose(score[legs.m0 < 2000.0], np.log(2.0))
    assert np.isnan(score[legs.m0 >= 2000.0]).all()
    expected = [legs.tof_s[3], legs.m0[3], legs.thrust[3], legs.isp[3], MU_SUN]
    assert rows[3] == [*legs.rv_dep[3], *legs.rv_arr[3], *expected]


def test_the_error_of_the_final_mass_is_judged_where_the_dataset_has_it(dataset):
    rows = np.flatnonzero(PACKAGE.margin(dataset.legs) > 1.0)
    part = dataset.take(rows)
    m_final = 1.01 * PACKAGE.final_mass(part.legs)
    m_final[:5] = np.nan
    # Legs of both classes are needed.
    columns = {**part.columns, "m_final_kg": m_final}
    columns["log_margin"] = np.where(np.arange(len(rows)) % 2, 0.3, -0.3)
    metrics = evaluate(PACKAGE, Dataset(columns, part.metadata)).metrics
    assert metrics["median_final_mass_error"] == pytest.approx(1 - 1 / 1.01, rel=1e-6)
    assert "median_final_mass_error" not in evaluate(PACKAGE, dataset).metrics


def test_families_stand_side_by_side(dataset, tmp_path, capsys):
    pytest.importorskip("pyarrow")
    folders = [str(write_dataset(dataset, tmp_path / name)) for name in ("near", "far")]
    out = tmp_path / "report"
    assert main(["evaluate", "default", *folders, "--out", str(out)]) == 0
    text = capsys.readouterr().out
    assert ["MIMA2"] in [cells(line)[:1] for line in text.splitlines()]
    assert "neural_lowthrust is left out" in text
    report = json.loads((out / "evaluation.json").read_text())
    assert list(report) == ["near", "far"]
    alone = evaluate(PACKAGE, dataset)
    assert report["far"]["metrics"]["accuracy"] == alone.metrics["accuracy"]
    assert set(report["near"]["peers"]) == {"Lambert", "MIMA", "MIMA2"}
    for figure in ("f1", "f10", "auc", "balanced_accuracy", "accuracy_within_5_percent"):
        assert 0.0 <= report["near"]["peers"]["MIMA"][figure] <= 1.0
    markdown = (out / "evaluation.md").read_text()
    headings = [cells(line) for line in markdown.splitlines()]
    assert ["balanced accuracy", "this model", "Lambert", "MIMA", "MIMA2"] in headings
    for name in ("roc.png", "reliability.png", "margin.png", "metrics.json"):
        assert (out / "far" / name).stat().st_size > 1000
    assert str(tmp_path) not in (out / "far" / "metrics.json").read_text()


def test_alone_asks_nobody_else_and_equal_names_are_refused(dataset, tmp_path, capsys):
    pytest.importorskip("pyarrow")
    folder = str(write_dataset(dataset, tmp_path / "near"))
    assert main(["evaluate", "default", folder, "--alone"]) == 0
    assert "MIMA" not in capsys.readouterr().out
    assert main(["evaluate", "default", folder, folder]) == 2
    assert "different names" in capsys.readouterr().err


def test_legs_that_can_all_be_flown_are_judged_without_what_needs_others(dataset, tmp_path):
    part = dataset.take(np.flatnonzero(dataset.flyable))
    peers, _ = known_peers()
    found = evaluate(PACKAGE, part, peers)
    assert found.metrics["share_feasible"] == 1.0
    assert not {"auc", "balanced_accuracy"} & set(found.metrics)
    assert found.pruning == ()
    assert "recall asked" not in found.table()
    assert all("auc" not in peer.metrics for peer in found.peers)
    written = {path.name for path in found.write(tmp_path / "report", "flown")}
    assert "roc.png" not in written
    assert {"metrics.json", "reliability.png", "margin.png"} <= written
    table = by_family({"all": evaluate(PACKAGE, dataset, peers), "flown": found})
    assert "–" in table.splitlines()[3]
