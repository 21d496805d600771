"""Fig. 3: accuracy against the number of training samples."""

from typing import TYPE_CHECKING, Final

import numpy as np

from feasibility.study import paper_values
from feasibility.study.context import Context
from feasibility.study.figures import COLOURS, NAMES, error_line, panels
from feasibility.study.fit import Fit, Outcome, over_seeds, run_fit
from feasibility.study.margin import MARGIN, run_margin
from feasibility.study.result import Result, Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_ELBOW_GAIN: Final = 0.01
"""A curve is flat from the size whose accuracy is within this of the last one's."""

_LEAST_FOR_OUTLOOK: Final = 20_000
"""Training legs from which on a curve is drawn out beyond its end."""

Curves = dict[str, dict[int, list[Outcome]]]
"""Outcomes over the seeds, by model and training size."""


def balanced_fit(context: Context, model: str, samples: int, seed: int, n_features: int) -> Fit:
    """Return a fit on a balanced training set, cut to what the data can give."""
    per_class = min(samples // 2, context.data.smaller_class)
    return Fit(model, per_class, per_class, seed, n_features)


def run(context: Context) -> Result:
    """Train every model on balanced sets of growing size and test on the same legs."""
    preset = context.preset
    curves: Curves = {}
    for model, sizes in preset.data_size.items():
        curves[model] = {}
        for size in sizes:
            fits = [
                balanced_fit(context, model, size, seed, paper_values.SELECTED_FEATURES)
                for seed in preset.seeds(preset.data_size_seeds, size)
            ]
            samples = fits[0].feasible + fits[0].infeasible
            if samples not in curves[model]:
                curves[model][samples] = [run_fit(context, fit) for fit in fits]
    curves[MARGIN] = {}
    for size in preset.margin_sizes:
        runs = [run_margin(context, size, seed) for seed in range(preset.data_size_seeds)]
        curves[MARGIN][runs[0].legs] = runs
    rows = []
    for model, curve in curves.items():
        for samples, outcomes in curve.items():
            accuracy = over_seeds(outcomes, "accuracy")
            area = over_seeds(outcomes, "auc")
            published = paper_values.FIGURE_3.get(model, {}).get(samples)
            seconds = float(np.mean([outcome.fit_seconds for outcome in outcomes]))
            rows.append(
                (NAMES[model], samples, len(outcomes), *accuracy, published, *area, seconds)
            )
    table = Table(
        name="data_size",
        title="Accuracy on the balanced test set by number of training legs (balanced)",
        columns=(
            "model",
            "training legs",
            "seeds",
            "accuracy",
            "± (1 sd)",
            "paper",
            "AUC",
            "± (1 sd) AUC",
            "training [s]",
        ),
        rows=tuple(rows),
    )
    elbows = Table(
        name="elbow",
        title=f"Where the curves flatten: within {_ELBOW_GAIN:g} of the accuracy at the last size",
        columns=("model", "ours", "paper"),
        rows=tuple(
            (NAMES[model], _elbow(curve), paper_values.FIGURE_3_ELBOW.get(model))
            for model, curve in curves.items()
            if curve
        ),
    )
    result = Result(
        name="data_size",
        title="Size of the training set (Fig. 3)",
        about=(
            "Every model learns from balanced draws of growing size; the draws of one seed are "
            "nested. Error bars are one standard deviation over the seeds, which change the draw "
            "and the training. The test set is always the same. The margin model "
            "(docs/guide/classifier.md) learns m* of the same draws, of which it holds out its "
            "own validation and calibration legs."
        ),
        findings=tuple(_findings(curves)),
        tables=(table, elbows),
        figures=("data_size",),
    )
    result.write(context.out, [_draw(curves)])
    return result


def _elbow(curve: dict[int, list[Outcome]]) -> str:
    means = {size: over_seeds(outcomes, "accuracy")[0] for size, outcomes in curve.items()}
    last = max(means)
    flat = min(size for size, mean in means.items() if mean >= means[last] - _ELBOW_GAIN)
    return f"not before {last}" if flat == last else f"from {flat}"


def learning_exponent(sizes: list[int], errors: list[float]) -> tuple[float, float]:
    """Return c and b of the power law ``error = c * size ** -b``, fitted in logarithms."""
    slope, intercept = np.polyfit(np.log(sizes), np.log(errors), 1)
    return float(np.exp(intercept)), float(-slope)


def _findings(curves: Curves) -> list[str]:
    findings = []
    network, trees = curves.get("dnn1", {}), curves.get("ensemble", {})
    shared = sorted(set(network) & set(trees))
    better = [
        size
        for size in shared
        if over_seeds(network[size], "accuracy")[0] > over_seeds(trees[size], "accuracy")[0]
    ]
    if shared:
        findings.append(
            f"DNN1 is ahead of the ensemble at {', '.join(map(str, better))} of the sizes both "
            f"were trained on ({', '.join(map(str, shared))})."
            if better
            else "The ensemble is ahead of DNN1 at every size that both were trained on "
            f"({', '.join(map(str, shared))})."
        )
    if len(network) >= 3:
        sizes = sorted(network)[-3:]
        errors = [1.0 - over_seeds(network[size], "accuracy")[0] for size in sizes]
        if min(errors) > 0:
            scale, exponent = learning_exponent(sizes, errors)
            target = 1.0 - paper_values.TABLE_6["dnn1"][0]
            text = (
                f"DNN1's error falls as (legs)^-{exponent:.2f} over its last three sizes, "
                f"{errors[-1]:.4f} at {sizes[-1]}"
            )
            if errors[-1] <= target:
                text += f", below the paper's {target:.4f}."
            elif exponent > 0 and sizes[-1] < _LEAST_FOR_OUTLOOK:
                text += ", too early in the curve to say where it ends."
            elif exponent > 0:
                needed = (scale / target) ** (1.0 / exponent)
                text += f"; at that pace the paper's {target:.4f} takes {needed:.2g} legs."
            else:
                text += ": no sign of falling to the paper's " + f"{target:.4f}."
            findings.append(text)
    findings += _margin_findings(curves.get(MARGIN, {}), network)
    return findings


def _margin_findings(
    margin: dict[int, list[Outcome]], network: dict[int, list[Outcome]]
) -> list[str]:
    published = paper_values.TABLE_6["dnn1"][0]
    means = {size: over_seeds(outcomes, "accuracy")[0] for size, outcomes in margin.items()}
    reached = [size for size, mean in means.items() if mean >= published]
    findings = []
    if reached:
        size = min(reached)
        findings.append(
            f"The margin model is at {means[size]:.4f} with {size} legs; the paper's network is "
            f"at {published:.4f} with {paper_values.TABLE_6_SAMPLES['dnn1']}."
        )
    shared = set(means) & set(network)
    if shared:
        size = max(shared)
        findings.append(
            f"From the same {size} legs the margin model errs on {1.0 - means[size]:.2%} of the "
            f"test legs, DNN1 on {1.0 - over_seeds(network[size], 'accuracy')[0]:.2%}."
        )
    return findings


def _draw(curves: Curves) -> "Figure":
    figure, (axes,) = panels(1, width=6.4, height=4.2)
    for model, curve in curves.items():
        statistics = [over_seeds(outcomes, "accuracy") for outcomes in curve.values()]
        error_line(
            axes,
            list(curve),
            [mean for mean, _ in statistics],
            [deviation for _, deviation in statistics],
            color=COLOURS[model],
            label=NAMES[model],
        )
        published = paper_values.FIGURE_3.get(model, {})
        axes.plot(
            list(published),
            list(published.values()),
            linestyle="none",
            marker="D",
            markerfacecolor="none",
            color=COLOURS[model],
        )
    axes.plot([], [], "D", markerfacecolor="none", color="0.4", label="paper")
    axes.set(xscale="log", xlabel="training legs (balanced)", ylabel="accuracy on the test set")
    axes.legend(fontsize="small")
    return figure
