"""Bayesian optimisation: counted, resumable, shared by workers and by processes."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from feasibility import InputError, MissingDependencyError
from feasibility.learning.paper import tune as module
from feasibility.learning.paper.tune import SPACES, Task, tune

pytest.importorskip("optuna")
pytest.importorskip("sklearn")

ROOT = Path(__file__).resolve().parents[3]
RNG = np.random.default_rng(0)
X = RNG.normal(size=(500, 4))
Y = X[:, 0] * X[:, 1] > 0
TASK = Task("tree", X[:300], Y[:300], X[300:], Y[300:])


@pytest.fixture
def journal(tmp_path):
    return tmp_path / "study.journal"


def test_the_best_trial_is_the_best_of_all(journal):
    tuning = tune(TASK, journal, n_trials=6)
    assert [trial.number for trial in tuning.trials] == list(range(6))
    assert tuning.best.value == max(trial.value for trial in tuning.trials)
    assert tuning.best_so_far()[-1] == tuning.best.value
    assert (np.diff(tuning.best_so_far()) >= 0).all()
    assert set(tuning.best.hyperparameters) == {"min_samples_leaf", "max_leaf_nodes", "criterion"}


def test_an_optimisation_goes_on_where_it_ended(journal):
    first = tune(TASK, journal, n_trials=3)
    longer = tune(TASK, journal, n_trials=5)
    assert longer.trials[:3] == first.trials
    assert len(longer.trials) == 5
    assert len({str(trial.hyperparameters) for trial in longer.trials}) == 5
    assert tune(TASK, journal, n_trials=5).trials == longer.trials


def test_an_interrupted_trial_is_done_again(journal, monkeypatch):
    space = SPACES["tree"]
    calls = []

    def interrupted(trial):
        calls.append(trial.number)
        if len(calls) == 2:
            raise KeyboardInterrupt
        return space(trial)

    monkeypatch.setitem(module.SPACES, "tree", interrupted)
    with pytest.raises(KeyboardInterrupt):
        tune(TASK, journal, n_trials=3)
    tuning = tune(TASK, journal, n_trials=3)
    assert [trial.state for trial in tuning.trials].count("complete") == 3


def test_f10_can_be_the_objective(journal):
    task = replace(TASK, f_score=10.0)
    assert 0 < tune(task, journal, n_trials=2).best.value <= 1


def test_fixed_hyperparameters_are_not_varied(journal):
    tuning = tune(replace(TASK, fixed={"criterion": "entropy"}), journal, n_trials=3)
    assert {trial.hyperparameters["criterion"] for trial in tuning.trials} == {"entropy"}


@pytest.mark.parametrize("kind", ["ensemble", "knn", "svm"])
def test_each_baseline_has_a_space_that_its_model_takes(kind, journal):
    fixed = {"max_iter": 5} if kind == "ensemble" else {}
    assert tune(replace(TASK, model=kind, fixed=fixed), journal, n_trials=1).best.value > 0


def test_poor_networks_are_ended_early(journal, monkeypatch):
    pytest.importorskip("torch")

    def first_good_then_hopeless(trial):
        trial.suggest_float("unused", 0.0, 1.0)
        return {"learning_rate": 5e-3 if trial.number < 6 else 1e-9}

    monkeypatch.setitem(module.SPACES, "dnn", first_good_then_hopeless)
    fixed = {"layers": 2, "width": 20, "batch": 50, "epochs": 8, "threads": 1, "drop_factor": 1.0}
    tuning = tune(replace(TASK, model="dnn", fixed=fixed), journal, n_trials=8)
    states = [trial.state for trial in tuning.trials]
    assert states[:6] == ["complete"] * 6
    assert "pruned" in states[6:]
    assert np.isnan(tuning.trials[states.index("pruned")].value)


def test_a_network_s_space_is_that_of_table_3():
    optuna = pytest.importorskip("optuna")
    study = optuna.create_study(sampler=optuna.samplers.RandomSampler(seed=0))
    drawn = [SPACES["dnn"](study.ask()) for _ in range(200)]
    for name, (low, high) in {
        "layers": (5, 10),
        "width": (200, 500),
        "beta1": (0.85, 0.95),
        "beta2": (0.9, 0.999),
        "batch": (200, 800),
        "learning_rate": (0.001, 0.01),
        "drop_period": (2, 8),
        "drop_factor": (0.0, 0.8),
    }.items():
        values = [draw[name] for draw in drawn]
        assert low <= min(values) < low + 0.2 * (high - low)
        assert high - 0.2 * (high - low) < max(values) <= high


@pytest.mark.slow
def test_workers_share_the_trials(journal):
    tuning = tune(TASK, journal, n_trials=5, workers=2)
    assert [trial.state for trial in tuning.trials] == ["complete"] * 5


def test_a_journal_of_another_study_or_damaged_is_refused(journal):
    tune(TASK, journal, n_trials=1)
    with pytest.raises(InputError, match="knn accuracy"):
        tune(replace(TASK, model="knn"), journal, n_trials=2)
    journal.write_text("not a journal\n")
    with pytest.raises(InputError, match="not a journal"):
        tune(TASK, journal, n_trials=2)


SHARING = """
import sys
from tests.feasibility.learning.test_tune import TASK, tune

tuning = tune(TASK, sys.argv[1], n_trials=int(sys.argv[2]))
print(len(tuning.trials))
"""


@pytest.mark.parametrize("scheme", ["sqlite", "journal"])
def test_processes_share_a_study_by_its_url(tmp_path, scheme):
    url = f"{scheme}:///{tmp_path / 'study'}"
    processes = [
        subprocess.Popen(
            [sys.executable, "-c", SHARING, url, "12"],
            cwd=ROOT,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        for _ in range(2)
    ]
    for process in processes:
        _, errors = process.communicate(timeout=120)
        assert process.returncode == 0, errors
    tuning = tune(TASK, url, n_trials=12)
    assert 12 <= len(tuning.trials) <= 13
    assert [trial.number for trial in tuning.trials] == list(range(len(tuning.trials)))
    # No process draws what another one drew.
    assert len({str(trial.hyperparameters) for trial in tuning.trials}) == len(tuning.trials)


def test_each_task_has_its_own_study_in_a_shared_storage(tmp_path):
    url = f"sqlite:///{tmp_path / 'study.db'}"
    tune(TASK, url, n_trials=2)
    assert len(tune(replace(TASK, seed=1), url, n_trials=1).trials) == 1
    assert len(tune(TASK, url, n_trials=2).trials) == 2


def test_another_process_s_running_trial_is_left_alone(tmp_path):
    url = f"sqlite:///{tmp_path / 'study.db'}"
    tune(TASK, url, n_trials=1)
    study = module._open(pytest.importorskip("optuna"), TASK, url, 0, 1)
    study.ask()
    assert len(tune(TASK, url, n_trials=3).trials) == 3
    assert [trial.state.name for trial in study.get_trials()].count("RUNNING") == 1


@pytest.mark.parametrize(
    ("url", "error", "message"),
    [
        ("study.db", InputError, "expected the URL of a storage, sqlite:///FILE"),
        ("oracle-of-delphi://x", InputError, "cannot be used"),
        ("sqlite:////no/such/folder/study.db", InputError, "unable to open database file"),
        ("postgresql+nodriver://me:secret@x/y", InputError, "cannot be used"),
    ],
)
def test_a_storage_of_no_use_is_one_line_without_its_password(url, error, message):
    with pytest.raises(error, match=message) as caught:
        tune(TASK, url, n_trials=1)
    assert "\n" not in str(caught.value)
    assert "secret" not in str(caught.value)


def test_a_driver_that_is_not_installed_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "psycopg2", None)
    with pytest.raises(MissingDependencyError, match="psycopg2") as caught:
        tune(TASK, "postgresql+psycopg2://me:secret@localhost/x", n_trials=1)
    assert "\n" not in str(caught.value)
    assert "secret" not in str(caught.value)


def test_an_unknown_model_is_refused(journal):
    with pytest.raises(InputError, match="oracle"):
        tune(replace(TASK, model="oracle"), journal)
