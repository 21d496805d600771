"""Fig. 9: Bayesian optimisation of the hyperparameters, one after another and in parallel."""

import functools
import math
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from feasibility.classifier.paper.standardise import Standardiser
from feasibility.errors import InputError
from feasibility.learning.paper.models import PRESETS, make_model
from feasibility.learning.paper.tune import Task, Tuning, tune
from feasibility.study import paper_values
from feasibility.study.context import Context
from feasibility.study.figures import panels
from feasibility.study.result import Result, Table, Value

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_FOLD: Final = 0
_SEED: Final = 0
_COLOURS: Final = ("#0072B2", "#E69F00")

Run = dict[str, Any]
"""Plain data of one optimisation: trials, best trial, wall-clock seconds, workers."""


def run(context: Context) -> Result:
    """Optimise with one worker and with several; same legs, same number of trials."""
    preset = context.preset
    task = _task(context)
    workers = {"sequential": 1, "parallel": preset.tuning_workers}
    runs = {name: _optimise(context, task, name, count) for name, count in workers.items()}
    table_5 = _accuracy_of_table_5(context, task)
    result = Result(
        name="optimisation",
        title="Bayesian optimisation (Fig. 9)",
        about=(
            f"{preset.tuning_trials} trials over the space of Table 3 (tree-structured Parzen "
            f"estimator, poor trials ended early), each {preset.tuning_epochs} epochs on "
            f"{len(task.y)} balanced legs of four folds; the objective is the accuracy on a "
            f"balanced draw of the fifth, {len(task.y_val)} legs. Every trial has one thread, so "
            "that the times compare processes; starting the processes counts. The paper's hours "
            "are of its own machines and sizes: only the ratio compares."
        ),
        findings=tuple(_findings(runs, table_5)),
        tables=(_time_table(runs, table_5), _best_table(runs), _trial_table(runs)),
        figures=("optimisation",),
    )
    result.write(context.out, [_draw(runs, table_5)])
    return result


def _task(context: Context) -> Task:
    data, preset = context.data, context.preset
    half = preset.tuning_rows // 2
    train = data.draw(half, half, _SEED, without_fold=_FOLD)
    validation = data.fold_rows(_FOLD, _SEED)
    columns = context.columns(paper_values.SELECTED_FEATURES)
    X = data.X[np.ix_(train, columns)]
    standardiser = Standardiser.fit(X)
    fixed: dict[str, Any] = {}
    if preset.tuning_model == "dnn":
        fixed = {
            "epochs": preset.tuning_epochs,
            "threads": 1,
            "device": context.device,
            "precision": context.precision,
        }
    return Task(
        model=preset.tuning_model,
        X=standardiser.transform(X),
        y=data.y[train],
        X_val=standardiser.transform(data.X[np.ix_(validation, columns)]),
        y_val=data.y[validation],
        fixed=fixed,
        seed=_SEED,
    )


def _key(context: Context, task: Task, **settings: object) -> dict[str, Any]:
    # Where it is computed does not decide what comes out, but decides how long it takes.
    return context.cell_key(
        model=task.model, fixed=dict(task.fixed), rows=len(task.y), seed=task.seed, **settings
    )


def _optimise(context: Context, task: Task, name: str, workers: int) -> Run:
    trials = context.preset.tuning_trials
    key = _key(context, task, kind="optimisation", trials=trials, workers=workers)
    label = f"optimisation-{name}"
    journal = context.cells.path(label, key).with_suffix(".journal")
    compute = functools.partial(_compute, task, journal, trials, workers)
    outcome: Run = context.cells.get(label, key, compute)
    return outcome


def _compute(task: Task, journal: Path, trials: int, workers: int) -> Run:
    began = time.perf_counter()
    tuning = tune(task, journal, n_trials=trials, workers=workers)
    elapsed = time.perf_counter() - began
    # Goes beyond the elapsed time only where an interrupted optimisation was completed.
    spent = sum(trial.seconds for trial in tuning.trials) / workers
    return {
        "workers": workers,
        "seconds": max(elapsed, spent),
        "best": dict(tuning.best.hyperparameters),
        "best_value": tuning.best.value,
        "trials": _plain(tuning),
    }


def _plain(tuning: Tuning) -> list[dict[str, Any]]:
    return [
        {
            "state": trial.state,
            "value": None if math.isnan(trial.value) else trial.value,
            "seconds": trial.seconds,
            "hyperparameters": dict(trial.hyperparameters),
        }
        for trial in tuning.trials
    ]


def _accuracy_of_table_5(context: Context, task: Task) -> float | None:
    """Return what DNN1's hyperparameters give on the same task."""
    if task.model != "dnn":
        return None

    def compute() -> float:
        model = make_model("dnn1", **task.fixed)
        model.fit(task.X, task.y, rng=np.random.default_rng(task.seed))
        return float(((model.predict_probability(task.X_val) >= 0.5) == task.y_val).mean())

    value: float = context.cells.get(
        "optimisation-table5", _key(context, task, kind="table5"), compute
    )
    return value


def best_so_far(run: Run) -> list[float | None]:
    """Return the best accuracy after each trial, None before the first complete one."""
    best: float | None = None
    history = []
    for trial in run["trials"]:
        value = trial["value"]
        if value is not None and (best is None or value > best):
            best = value
        history.append(best)
    return history


def _trials_to_best(run: Run) -> int:
    history = best_so_far(run)
    if history[-1] is None:
        raise InputError("optimisation: no trial was completed; expected at least one")
    return history.index(history[-1]) + 1


def _time_table(runs: dict[str, Run], table_5: float | None) -> Table:
    rows: list[tuple[Value, ...]] = [
        (
            name,
            run["workers"],
            len(run["trials"]),
            sum(trial["state"] == "pruned" for trial in run["trials"]),
            _trials_to_best(run),
            run["best_value"],
            run["seconds"],
            paper_values.FIGURE_9_HOURS[name] * 3600.0,
        )
        for name, run in runs.items()
    ]
    if table_5 is not None:
        rows.append(("Table 5's DNN1, same legs", None, 1, None, None, table_5, None, None))
    return Table(
        name="optimisation",
        title="Time and outcome",
        columns=(
            "optimisation",
            "workers",
            "trials",
            "ended early",
            "trials to the best",
            "best accuracy",
            "seconds",
            "paper, seconds",
        ),
        rows=tuple(rows),
    )


def _best_table(runs: dict[str, Run]) -> Table:
    published = PRESETS["dnn1"][0]
    names = [name for name in runs["sequential"]["best"] if name in published] or [
        name for name in runs["sequential"]["best"] if name != "epochs"
    ]
    return Table(
        name="best",
        title="Best hyperparameters",
        columns=("hyperparameter", *runs, "Table 5, DNN1"),
        rows=tuple(
            (name, *(run["best"].get(name) for run in runs.values()), published.get(name))
            for name in names
        ),
    )


def _trial_table(runs: dict[str, Run]) -> Table:
    return Table(
        name="trials",
        title="All trials",
        columns=("optimisation", "trial", "state", "accuracy", "best so far", "seconds"),
        rows=tuple(
            (name, number, trial["state"], trial["value"], best, trial["seconds"])
            for name, run in runs.items()
            for number, (trial, best) in enumerate(
                zip(run["trials"], best_so_far(run), strict=True), start=1
            )
        ),
        most_rows=0,
    )


def _findings(runs: dict[str, Run], table_5: float | None) -> list[str]:
    sequential, parallel = runs["sequential"], runs["parallel"]
    hours = paper_values.FIGURE_9_HOURS
    findings = [
        f"{parallel['workers']} workers take {parallel['seconds']:.0f} s instead of "
        f"{sequential['seconds']:.0f} s, {sequential['seconds'] / parallel['seconds']:.1f} times "
        f"faster; in the paper {hours['sequential'] / hours['parallel']:.1f} times.",
        f"The best of {len(sequential['trials'])} trials is number {_trials_to_best(sequential)} "
        f"(sequential) and {_trials_to_best(parallel)} of {len(parallel['trials'])} (parallel); "
        f"the paper found its optimum within {paper_values.FIGURE_9_TRIALS}.",
    ]
    if table_5 is not None:
        best = max(sequential["best_value"], parallel["best_value"])
        findings.append(
            f"Best accuracy {best:.4f} where Table 5's hyperparameters give {table_5:.4f}."
        )
    return findings


def _draw(runs: dict[str, Run], table_5: float | None) -> "Figure":
    figure, (left, right) = panels(2)
    for (name, run), colour in zip(runs.items(), _COLOURS, strict=True):
        numbers = np.arange(1, len(run["trials"]) + 1)
        values = np.array([trial["value"] for trial in run["trials"]], dtype=np.float64)
        best = np.array(best_so_far(run), dtype=np.float64)
        left.plot(numbers, values, "o", color=colour, markersize=3, alpha=0.6)
        left.step(numbers, best, where="post", color=colour, label=f"{name}, best so far")
    if table_5 is not None:
        left.axhline(table_5, color="0.4", linestyle="--", linewidth=0.8, label="Table 5's DNN1")
    left.set(xlabel="trial", ylabel="accuracy on the held-out fold")
    left.legend(fontsize="x-small")
    hours = paper_values.FIGURE_9_HOURS
    for k, (name, run) in enumerate(runs.items()):
        ours = run["seconds"] / runs["sequential"]["seconds"]
        right.bar(k - 0.2, ours, 0.4, color=_COLOURS[0], label=None if k else "ours")
        paper = hours[name] / hours["sequential"]
        right.bar(k + 0.2, paper, 0.4, color="0.7", label=None if k else "paper")
        right.text(k - 0.2, ours, f"{run['seconds']:.0f} s", ha="center", va="bottom", fontsize=8)
        right.text(k + 0.2, paper, f"{hours[name]:g} h", ha="center", va="bottom", fontsize=8)
    right.set(xticks=range(len(runs)), xticklabels=list(runs), ylabel="time, sequential = 1")
    right.legend(fontsize="small")
    return figure
