"""Fig. 8: training with the selected and with all features, epoch by epoch."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.paper.features import FEATURES
from feasibility.study import paper_values
from feasibility.study.context import Context
from feasibility.study.data import N_FOLDS
from feasibility.study.figures import panels
from feasibility.study.fit import Fit, Outcome, mean_and_deviation, run_fit
from feasibility.study.result import Result, Table, Value, spread

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_CASES = (
    ("dnn1", paper_values.SELECTED_FEATURES, "DNN1, 60 features", "#0072B2"),
    ("dnn1", len(FEATURES), "DNN1's network, 103 features", "#56B4E9"),
    ("dnn2", len(FEATURES), "DNN2, 103 features", "#D55E00"),
)
"""Model, number of features, name and colour; the first two differ in the features alone."""


def run(context: Context) -> Result:
    """Follow accuracy and loss on training and validation legs through the epochs."""
    preset, data = context.preset, context.data
    fold = 0
    rows = data.pool[data.folds != fold]
    smallest = min(int(data.y[rows].sum()), int((~data.y[rows]).sum()))
    per_class = min(preset.curve_rows // 2, smallest)
    outcomes = {
        name: [
            run_fit(
                context,
                Fit(model, per_class, per_class, seed, n_features, fold=fold),
                validate=True,
            )
            for seed in range(preset.curve_seeds)
        ]
        for model, n_features, name, _ in _CASES
    }
    statistics = {name: _statistics(runs) for name, runs in outcomes.items()}
    table = Table(
        name="training_curves",
        title=f"The ends of the curves, {2 * per_class} training legs, {preset.curve_seeds} seeds",
        columns=(
            "network",
            "validation accuracy, last epoch",
            "best epoch",
            "validation loss, last epoch",
            "lowest",
            "jitter of validation loss",
            "training accuracy, last epoch",
        ),
        rows=tuple((name, *values) for name, (values, _) in statistics.items()),
    )
    jitters = [jitter for _, jitter in statistics.values()]
    calmer = "calmer" if jitters[0] < jitters[1] else "not calmer"
    result = Result(
        name="training_curves",
        title="Training curves with and without feature selection (Fig. 8)",
        about=(
            "Loss and accuracy on the training legs and on a balanced draw of one fold held out "
            f"(one of {N_FOLDS}), epoch by epoch; the held-out fold decides nothing. Bands are "
            "one standard deviation over the seeds. Jitter is the mean absolute change of the "
            "validation loss from one epoch to the next, before the first drop of the rate."
        ),
        findings=(
            f"With the selected features training is {calmer}: jitter {jitters[0]:.4f} against "
            f"{jitters[1]:.4f} for the same network with all features.",
        ),
        tables=(table,),
        figures=("training_curves",),
    )
    result.write(context.out, [_draw(outcomes)])
    return result


def _series(runs: list[Outcome], quantity: str) -> NDArray[np.float64]:
    """Return (seeds, epochs)."""
    return np.array([[epoch[quantity] for epoch in outcome.epochs] for outcome in runs])


def _statistics(runs: list[Outcome]) -> tuple[tuple[Value, ...], float]:
    accuracy = _series(runs, "validation_accuracy")
    loss = _series(runs, "validation_loss")
    rate = _series(runs, "learning_rate")[0]
    first = max(int(np.sum(rate == rate[0])), 2)
    changes = np.abs(np.diff(loss[:, :first], axis=1))
    jitter = float(changes.mean()) if changes.size else 0.0
    values = (
        spread(*mean_and_deviation(list(accuracy[:, -1]))),
        spread(*mean_and_deviation(list(accuracy.max(axis=1)))),
        spread(*mean_and_deviation(list(loss[:, -1]))),
        spread(*mean_and_deviation(list(loss.min(axis=1)))),
        jitter,
        spread(*mean_and_deviation(list(_series(runs, "train_accuracy")[:, -1]))),
    )
    return values, jitter


def _draw(outcomes: dict[str, list[Outcome]]) -> "Figure":
    figure, both = panels(2, height=3.6)
    for axes, quantity in zip(both, ("accuracy", "loss"), strict=True):
        for _, _, name, colour in _CASES:
            for part, style in (("validation", "-"), ("train", ":")):
                series = _series(outcomes[name], f"{part}_{quantity}")
                numbers = np.arange(1, series.shape[1] + 1)
                mean, deviation = series.mean(axis=0), series.std(axis=0)
                label = name if part == "validation" else None
                axes.plot(numbers, mean, style, color=colour, label=label)
                if part == "validation":
                    axes.fill_between(
                        numbers, mean - deviation, mean + deviation, color=colour, alpha=0.2
                    )
        axes.set(xlabel="epoch", ylabel=quantity)
    both[0].legend(fontsize="x-small", title="validation; dotted: training")
    both[1].set_yscale("log")
    return figure
