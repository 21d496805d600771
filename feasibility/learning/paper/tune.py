"""Bayesian optimisation of hyperparameters with optuna (Table 3 of the paper)."""

import hashlib
import multiprocessing
import uuid
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.errors import InputError
from feasibility.evaluation.metrics import Confusion
from feasibility.learning.paper.models import Epoch, make_model
from feasibility.learning.paper.tune_storage import open_study, without_password
from feasibility.runtime.extras import load_extra

N_TRIALS: Final = 30
"""Evaluations within which the paper's optimisation found its optimum."""

# Table 3 of the paper.
LAYERS: Final = (5, 10)
WIDTH: Final = (200, 500)
ACTIVATION: Final = ("relu", "leaky_relu", "elu")
BETA1: Final = (0.85, 0.95)
BETA2: Final = (0.9, 0.999)
BATCH: Final = (200, 800)
LEARNING_RATE: Final = (0.001, 0.01)
DROP_PERIOD: Final = (2, 8)
DROP_FACTOR: Final = (0.0, 0.8)

_WARM_UP_EPOCHS: Final = 3
_WARM_UP_TRIALS: Final = 5
_RANDOM_TRIALS: Final = 8


@final
@dataclass(frozen=True, eq=False)
class Task:
    """What is optimised.

    Attributes
    ----------
    model : str
        "dnn", "ensemble", "knn", "svm" or "tree".
    X, y, X_val, y_val : arrays
        Standardised training and validation rows, (n, k), (n,), (m, k) and (m,).
    f_score : float, optional
        Maximise F_k for this k instead of the accuracy.
    fixed : mapping
        Hyperparameters that are not varied, such as the number of epochs.
    seed : int
        Seed of the sampler and of every training.
    """

    model: str
    X: NDArray[np.float64]
    y: NDArray[np.bool_]
    X_val: NDArray[np.float64]
    y_val: NDArray[np.bool_]
    f_score: float | None = None
    fixed: Mapping[str, Any] = field(default_factory=dict)
    seed: int = 0


@final
@dataclass(frozen=True)
class Trial:
    """One evaluation; `state` is "complete", "pruned" or "fail", `value` NaN unless complete."""

    number: int
    state: str
    value: float
    seconds: float
    hyperparameters: Mapping[str, Any]


@final
@dataclass(frozen=True)
class Tuning:
    """All trials in the order of their numbers, and the best of them."""

    trials: tuple[Trial, ...]
    best: Trial

    def best_so_far(self) -> NDArray[np.float64]:
        """Return (t,) the best value after each trial; NaN before the first complete one."""
        return np.fmax.accumulate([trial.value for trial in self.trials])


def tune(
    task: Task,
    storage: Path | str,
    *,
    n_trials: int = N_TRIALS,
    workers: int = 1,
    on_trial: Callable[[Trial], None] | None = None,
) -> Tuning:
    """Find hyperparameters by the tree-structured Parzen estimator; poor trials end early.

    Parameters
    ----------
    task : Task
        What is optimised.
    storage : Path or str
        Path of a journal file that all workers share. An optimisation goes on from it where it
        exists: trials that were interrupted are counted as failed and done again. Or the URL
        of a storage that several calls share, on any number of machines: those with the same
        task work on the same study, and each other task has its own.
    n_trials : int
        Trials in all, with those already there. Of several calls each ends the trial that it
        has begun, so that there may be a few more.
    workers : int
        Processes; trials differ between numbers of workers, as each waits for no other.
    on_trial : callable, optional
        Called with each trial that this process ends; with several workers it ends none.

    Raises
    ------
    InputError
        Unknown model, a `storage` that cannot be used or is of another task, or no trial that
        was completed.
    MissingDependencyError
        The extra ``train`` is not installed.
    """
    if task.model not in SPACES:
        raise InputError(f"tune: model {task.model!r}, expected one of {', '.join(SPACES)}")
    optuna = load_extra("optuna")
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    study = _open(optuna, task, storage, worker=0, workers=workers)
    states = optuna.trial.TrialState
    if isinstance(storage, Path):
        for trial in study.get_trials(states=(states.RUNNING, states.WAITING)):
            study.tell(trial.number, state=states.FAIL)
    missing = n_trials - len(study.get_trials(states=(states.COMPLETE, states.PRUNED)))
    most = n_trials if isinstance(storage, str) else None
    shares = [len(part) for part in np.array_split(np.arange(max(missing, 0)), workers)]
    if workers == 1:
        _optimise(task, storage, 0, 1, shares[0], most, on_trial)
    else:
        context = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(workers, mp_context=context) as pool:
            jobs = [
                pool.submit(_optimise, task, storage, worker, workers, share, most)
                for worker, share in enumerate(shares)
                if share
            ]
            for job in jobs:
                job.result()
    ended = (trial for trial in study.get_trials() if trial.state.is_finished())
    trials = tuple(_plain(task, trial) for trial in ended)
    complete = [trial for trial in trials if trial.state == "complete"]
    if not complete:
        raise InputError(
            f"{without_password(storage)}: no trial was completed; expected at least one"
        )
    return Tuning(trials, max(complete, key=lambda trial: trial.value))


def _optimise(
    task: Task,
    storage: Path | str,
    worker: int,
    workers: int,
    n_trials: int,
    most: int | None,
    on_trial: Callable[[Trial], None] | None = None,
) -> None:
    """Do some trials, in this process; no more are begun once the study has `most` of them."""
    if n_trials == 0:
        return
    optuna = load_extra("optuna")
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    study = _open(optuna, task, storage, worker, workers)
    states = optuna.trial.TrialState
    callbacks: list[Any] = []
    if most is not None:
        callbacks.append(
            optuna.study.MaxTrialsCallback(most, states=(states.COMPLETE, states.PRUNED))
        )
    if on_trial is not None:
        callbacks.append(lambda _, trial: on_trial(_plain(task, trial)))
    study.optimize(
        lambda trial: _objective(optuna, task, trial), n_trials=n_trials, callbacks=callbacks
    )


def _plain(task: Task, trial: Any) -> Trial:
    """Return a finished trial of optuna as a record of ours."""
    state = trial.state.name.lower()
    return Trial(
        trial.number,
        state,
        trial.value if state == "complete" else float("nan"),
        trial.duration.total_seconds(),
        {**trial.params, **task.fixed},
    )


def _open(optuna: Any, task: Task, storage: Path | str, worker: int, workers: int) -> Any:
    objective = "accuracy" if task.f_score is None else f"f{task.f_score:g}"
    name = f"{task.model} {objective}"
    others = isinstance(storage, str)
    study = open_study(optuna, storage, f"{name} {_digest(task)}" if others else name)
    # Resumed, the sampler must not draw again what it drew at first, nor what others draw.
    numbers = [task.seed, worker, len(study.trials)] + [uuid.uuid4().int] * others
    seed = np.random.default_rng(numbers).integers(2**31)
    study.sampler = optuna.samplers.TPESampler(
        seed=int(seed), n_startup_trials=_RANDOM_TRIALS, constant_liar=workers > 1 or others
    )
    study.pruner = optuna.pruners.MedianPruner(
        n_startup_trials=_WARM_UP_TRIALS, n_warmup_steps=_WARM_UP_EPOCHS
    )
    return study


def _digest(task: Task) -> str:
    """Return by what calls with the same task know each other, on whatever machine.

    The rows themselves do not count: their last digits may differ between processors.
    """
    settings = (task.X.shape, task.X_val.shape, sorted(task.fixed.items()), task.seed)
    digest = hashlib.sha256(repr(settings).encode())
    for labels in (task.y, task.y_val):
        digest.update(np.packbits(labels).tobytes())
    return digest.hexdigest()[:12]


def _objective(optuna: Any, task: Task, trial: Any) -> float:
    model = make_model(task.model, **{**SPACES[task.model](trial), **task.fixed})

    def report(epoch: Epoch) -> None:
        trial.report(epoch.validation_accuracy, epoch.number)
        if trial.should_prune():
            raise optuna.TrialPruned

    model.fit(
        task.X,
        task.y,
        rng=np.random.default_rng(task.seed),
        X_val=task.X_val,
        y_val=task.y_val,
        on_epoch=report,
    )
    counts = Confusion.of(task.y_val, model.predict_probability(task.X_val) >= 0.5)
    return counts.accuracy if task.f_score is None else counts.f_score(task.f_score)


def _dnn(trial: Any) -> dict[str, Any]:
    return {
        "layers": trial.suggest_int("layers", *LAYERS),
        "width": trial.suggest_int("width", *WIDTH),
        "activation": trial.suggest_categorical("activation", ACTIVATION),
        "beta1": trial.suggest_float("beta1", *BETA1),
        "beta2": trial.suggest_float("beta2", *BETA2),
        "batch": trial.suggest_int("batch", *BATCH),
        "learning_rate": trial.suggest_float("learning_rate", *LEARNING_RATE, log=True),
        "drop_period": trial.suggest_int("drop_period", *DROP_PERIOD),
        "drop_factor": trial.suggest_float("drop_factor", *DROP_FACTOR),
    }


def _ensemble(trial: Any) -> dict[str, Any]:
    return {
        "learning_rate": trial.suggest_float("learning_rate", 0.02, 0.3, log=True),
        "max_iter": trial.suggest_int("max_iter", 100, 600),
        "max_leaf_nodes": trial.suggest_int("max_leaf_nodes", 15, 127, log=True),
        "min_samples_leaf": trial.suggest_int("min_samples_leaf", 5, 100, log=True),
        "l2_regularization": trial.suggest_float("l2_regularization", 1e-6, 10.0, log=True),
    }


def _knn(trial: Any) -> dict[str, Any]:
    return {
        "neighbours": trial.suggest_int("neighbours", 1, 100, log=True),
        "weighting": trial.suggest_categorical("weighting", ("uniform", "distance")),
    }


def _svm(trial: Any) -> dict[str, Any]:
    return {
        "C": trial.suggest_float("C", 0.1, 1000.0, log=True),
        "gamma": trial.suggest_float("gamma", 1e-4, 1.0, log=True),
    }


def _tree(trial: Any) -> dict[str, Any]:
    return {
        "min_samples_leaf": trial.suggest_int("min_samples_leaf", 1, 100, log=True),
        "max_leaf_nodes": trial.suggest_int("max_leaf_nodes", 10, 4000, log=True),
        "criterion": trial.suggest_categorical("criterion", ("gini", "entropy")),
    }


SPACES: Final[Mapping[str, Callable[[Any], dict[str, Any]]]] = {
    "dnn": _dnn,
    "ensemble": _ensemble,
    "knn": _knn,
    "svm": _svm,
    "tree": _tree,
}
"""Search spaces: Table 3 for the network; for the baselines, what decides their complexity."""
