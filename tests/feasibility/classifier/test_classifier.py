"""From labelled legs to a pruner, for each of the five models."""

import json
import pickle
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from feasibility import InputError, Legs, check_pruner
from feasibility.classifier.artefact import Artefact
from feasibility.classifier.classifier import FeasibilityClassifier
from feasibility.constants import AU
from feasibility.evaluation.metrics import auc
from feasibility.learning.paper.models import KINDS
from feasibility.learning.paper.train import Examples, Recipe, train
from feasibility.pruners.classifier import ClassifierPruner
from tests.helpers.labelled import labelled_dataset

pytest.importorskip("sklearn")
pytest.importorskip("torch")
pytest.importorskip("imblearn")

SMALL = {
    "dnn": {"layers": 3, "width": 50, "batch": 100, "epochs": 12, "threads": 1},
    "ensemble": {"max_iter": 40},
}
N_FEATURES = 30


@pytest.fixture(scope="module", params=KINDS)
def artefact(request):
    kind = request.param
    balance = "adasyn" if kind in ("dnn", "tree") else "none"
    recipe = Recipe(kind, SMALL.get(kind, {}), n_features=N_FEATURES, balance=balance)
    return train(labelled_dataset(), recipe)


@pytest.fixture(scope="module")
def path(artefact, tmp_path_factory):
    path = tmp_path_factory.mktemp("models") / f"{artefact.kind}.seqmodel"
    artefact.save(path)
    return path


@pytest.fixture(scope="module")
def classifier(path):
    return FeasibilityClassifier.load(path)


@pytest.fixture(scope="module")
def other():
    """Legs among the same bodies that nothing was trained on."""
    return labelled_dataset(600, seed=1)


def test_a_loaded_model_answers_as_the_one_that_was_trained(artefact, classifier, other):
    before = FeasibilityClassifier(artefact).feasible_probability(other.legs)
    assert np.abs(classifier.feasible_probability(other.legs) - before).max() < 1e-12
    assert auc(other.flyable, before) > (0.6 if artefact.kind == "knn" else 0.75)


def test_the_artefact_says_what_it_needs_and_how_it_was_made(artefact):
    assert len(artefact.features) == len(artefact.units) == N_FEATURES
    assert artefact.config["recipe"]["model"] == artefact.kind
    assert set(artefact.metrics) == {"validation", "calibration"}
    legs = artefact.config["legs"]
    assert legs["training"] + legs["validation"] + legs["calibration"] == 1500
    assert (legs["synthetic"] > 0) == (artefact.config["recipe"]["balance"] == "adasyn")


def test_the_pruner_honours_the_contract(classifier, other):
    pruner = ClassifierPruner(classifier, recall=0.9)
    check_pruner(pruner)
    check_pruner(pruner, other.legs.take(np.arange(80)))


def test_the_threshold_keeps_the_recall_asked_of_the_calibration_legs(artefact, classifier):
    scores = artefact.arrays["calibration/positive_scores"]
    thresholds = []
    for recall in (0.5, 0.9, 0.99, 1.0):
        threshold = classifier.threshold(recall)
        assert np.mean(scores >= threshold) >= recall - 1e-9
        thresholds.append(threshold)
    assert thresholds == sorted(thresholds, reverse=True)
    assert thresholds[-1] == scores.min()


def test_a_recall_out_of_range_is_refused(classifier):
    for recall in (0.0, 1.1, float("nan")):
        with pytest.raises(InputError, match="recall"):
            ClassifierPruner(classifier, recall=recall)


def test_the_pruner_keeps_what_it_does_not_know(classifier, other):
    fast = [2 * AU, 0, 0, 0, 4e4, 0]
    unbound = Legs(fast, [0, 2 * AU, 0, -2e4, 0, 0], 300.0, 1500.0, 0.236, 4190.0, 1000.0)
    assert classifier.feasible_probability(unbound).tolist() == [0.5]
    assert not classifier.in_domain(unbound).any()
    assert ClassifierPruner(classifier).keep(unbound).all()
    legs = other.legs.take(np.arange(20))
    hall = Legs(legs.rv_dep, legs.rv_arr, legs.tof_days, legs.m0, legs.thrust, 1500.0, legs.m_dry)
    assert not classifier.in_domain(hall).any()
    assert ClassifierPruner(classifier).keep(hall).all()
    assert classifier.in_domain(legs).mean() > 0.8


def test_only_thrust_over_mass_counts(classifier, other):
    legs = other.legs
    larger = Legs(
        legs.rv_dep, legs.rv_arr, legs.tof_days, 4 * legs.m0, 4 * legs.thrust, legs.isp, legs.m_dry
    )
    assert np.array_equal(
        classifier.feasible_probability(larger), classifier.feasible_probability(legs)
    )


def test_no_legs_are_no_answers(classifier, other):
    assert classifier.feasible_probability(other.legs.take([])).shape == (0,)


def test_a_classifier_travels_to_other_processes(classifier, other):
    twin = pickle.loads(pickle.dumps(classifier))
    assert np.array_equal(
        twin.feasible_probability(other.legs), classifier.feasible_probability(other.legs)
    )


def test_pruning_with_a_saved_model_loads_nothing_of_the_training(path, other, tmp_path):
    np.savez(
        tmp_path / "legs.npz",
        **{
            name: getattr(other.legs, name)[:50] for name in ("rv_dep", "rv_arr", "tof_days", "m0")
        },
    )
    code = f"""
import json, sys
import numpy as np
import feasibility, seqsearch
from feasibility.classifier.classifier import FeasibilityClassifier
from feasibility.pruners.classifier import ClassifierPruner
rows = np.load({str(tmp_path / "legs.npz")!r})
legs = feasibility.Legs(**rows, thrust=0.236, isp=4190.0, m_dry=1000.0)
kept = ClassifierPruner(FeasibilityClassifier.load({str(path)!r})).keep(legs)
print(json.dumps([sorted(sys.modules), kept.tolist()]))
"""
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    modules, kept = json.loads(done.stdout)
    loaded = {name.partition(".")[0] for name in modules}
    assert not loaded & {"torch", "sklearn", "imblearn", "optuna", "pykep", "pygmo", "pyarrow"}
    assert len(kept) == 50


@pytest.fixture(scope="module")
def tree():
    return train(labelled_dataset(), Recipe("tree", n_features=5))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"feature_set": "another"}, "another"),
        ({"features": ("a", "b", "c", "d", "e")}, "'a'"),
        ({"kind": "oracle"}, "oracle"),
        ({"arrays": {}}, "missing"),
    ],
)
def test_a_model_that_this_version_does_not_know_is_refused(tree, other, changes, message):
    with pytest.raises(InputError, match=message):
        FeasibilityClassifier(replace(tree, **changes)).feasible_probability(other.legs)


def test_the_same_recipe_gives_the_same_model(tree, tmp_path):
    again = train(labelled_dataset(), Recipe("tree", n_features=5))
    assert again.features == tree.features
    assert all(np.array_equal(again.arrays[name], tree.arrays[name]) for name in tree.arrays)


def test_no_pair_of_bodies_is_in_two_parts(monkeypatch):
    import feasibility.learning.paper.train as module

    seen = []

    def spy(pairs, shares, rng):
        part = original(pairs, shares, rng)
        seen.append((pairs, part))
        return part

    original = module.split_pairs
    monkeypatch.setattr(module, "split_pairs", spy)
    train(labelled_dataset(), Recipe("tree", n_features=5))
    [(pairs, part)] = seen
    assert len(set(pairs.tolist())) < len(pairs)
    assert len({(p, q) for p, q in zip(pairs, part, strict=True)}) == len(set(pairs.tolist()))


def test_legs_of_several_engines_are_refused():
    dataset = labelled_dataset()
    thrust = dataset.columns["thrust_n"].copy()
    thrust[::2] *= 2.0
    mixed = replace(dataset, columns=dict(dataset.columns) | {"thrust_n": thrust})
    with pytest.raises(InputError, match="one engine"):
        train(mixed, Recipe("tree", n_features=5))


def test_one_class_is_refused():
    dataset = labelled_dataset()
    margin = np.abs(dataset.columns["log_margin"])
    easy = replace(dataset, columns=dict(dataset.columns) | {"log_margin": margin})
    with pytest.raises(InputError, match="both classes"):
        train(easy, Recipe("tree", n_features=5))


def test_legs_without_a_label_are_left_out():
    dataset = labelled_dataset()
    margin = dataset.columns["log_margin"].copy()
    margin[:100] = np.nan
    holes = replace(dataset, columns=dict(dataset.columns) | {"log_margin": margin})
    assert len(Examples.of(holes).y) == 1400


def test_the_papers_label_is_convergence():
    dataset = labelled_dataset()
    status = np.where(np.arange(1500) % 2 == 0, 0, 1).astype(np.int8)
    protocol = dict(dataset.metadata["protocol"]) | {"label": "convergence"}
    random_start = replace(
        dataset,
        columns=dict(dataset.columns) | {"status": status},
        metadata=dict(dataset.metadata) | {"protocol": protocol},
    )
    assert np.array_equal(random_start.flyable, np.arange(1500) % 2 == 0)


@pytest.mark.parametrize("changes", [{"n_features": 0}, {"n_features": 104}, {"balance": "x"}])
def test_a_recipe_that_makes_no_sense_is_refused(changes):
    with pytest.raises(InputError):
        Recipe("tree", **changes)


def test_an_artefact_from_memory_and_from_disk_is_the_same(tree, tmp_path):
    tree.save(tmp_path / "tree.seqmodel")
    read = Artefact.load(tmp_path / "tree.seqmodel")
    assert read.config == json.loads(json.dumps(tree.config))
    assert read.provenance["dataset"]["protocol"]["name"] == "table1"
