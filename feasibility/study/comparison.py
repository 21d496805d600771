"""Table 6 and Fig. 10: all models on the same balanced test set, and where they err."""

import itertools
from typing import TYPE_CHECKING

import numpy as np

from feasibility.classifier.paper.features import FEATURES
from feasibility.study import paper_values
from feasibility.study.context import Context
from feasibility.study.data_size import balanced_fit
from feasibility.study.figures import COLOURS, NAMES, panels
from feasibility.study.fit import MARGIN_EDGES, Outcome, over_seeds, roc_grid, run_fit
from feasibility.study.margin import MARGIN, run_margin
from feasibility.study.paper_values import METRICS
from feasibility.study.result import Result, Table, Value, spread

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Outcomes = dict[str, list[Outcome]]


def run(context: Context) -> Result:
    """Train every model at its size of Table 6 and compare with the paper's figures."""
    preset = context.preset
    outcomes: Outcomes = {}
    for model, samples in preset.comparison.items():
        n_features = len(FEATURES) if model == "dnn2" else paper_values.SELECTED_FEATURES
        outcomes[model] = [
            run_fit(context, balanced_fit(context, model, samples, seed, n_features))
            for seed in preset.seeds(preset.comparison_seeds, samples)
        ]
    outcomes[MARGIN] = [
        run_margin(context, max(preset.margin_sizes), seed)
        for seed in range(preset.comparison_seeds)
    ]
    result = Result(
        name="comparison",
        title="Final comparison (Table 6, Fig. 10)",
        about=(
            "All models learn from balanced sets and are tested on the same balanced set of "
            "pairs of bodies that none of them has seen; threshold 0.5. ± is one standard "
            "deviation over the seeds. The margin model is ours "
            "(docs/guide/classifier.md): it learns m* of its legs, a part of DNN1's, of which it "
            "holds out its own validation and calibration legs."
        ),
        findings=tuple(_findings(outcomes)),
        tables=(_table(outcomes), _margin_table(outcomes)),
        figures=("roc", "margin"),
    )
    result.write(context.out, [_draw_roc(outcomes), _draw_margin(outcomes)])
    return result


def _table(outcomes: Outcomes) -> Table:
    rows: list[tuple[Value, ...]] = []
    for model, runs in outcomes.items():
        ours = [spread(*over_seeds(runs, metric)) for metric in METRICS]
        source = f"ours, {len(runs)} seed{'s' if len(runs) > 1 else ''}"
        rows.append((NAMES[model], source, runs[0].legs, *ours))
        if model in paper_values.TABLE_6:
            published = paper_values.TABLE_6[model]
            rows.append((NAMES[model], "paper", paper_values.TABLE_6_SAMPLES[model], *published))
    return Table(
        name="comparison",
        title="Ours beside the paper's Table 6",
        columns=("model", "source", "training legs", *METRICS),
        rows=tuple(rows),
    )


def bin_names() -> list[str]:
    """Return the bins of abs(log(m*/m0)) as text."""
    names = [f"{a:g} to {b:g}" for a, b in itertools.pairwise(MARGIN_EDGES)]
    return [*names, f"above {MARGIN_EDGES[-1]:g}"]


def _margin_table(outcomes: Outcomes) -> Table:
    count = np.array(next(iter(outcomes.values()))[0].margin_count)
    rows: list[tuple[Value, ...]] = []
    for b, name in enumerate(bin_names()):
        accuracies = [_bin_accuracy(runs, b) for runs in outcomes.values()]
        rows.append((name, float(count[b] / count.sum()), *accuracies))
    return Table(
        name="margin",
        title="Accuracy by the distance to the boundary, abs(log(m*/m0))",
        columns=("distance", "share of test", *(NAMES[model] for model in outcomes)),
        rows=tuple(rows),
    )


def _bin_accuracy(runs: list[Outcome], b: int) -> float | None:
    total = sum(outcome.margin_count[b] for outcome in runs)
    return sum(outcome.margin_right[b] for outcome in runs) / total if total else None


def _findings(outcomes: Outcomes) -> list[str]:
    means = {model: over_seeds(runs, "accuracy")[0] for model, runs in outcomes.items()}
    ours = sorted((model for model in means if model != MARGIN), key=lambda model: -means[model])
    theirs = [model for model in paper_values.TABLE_6_ORDER if model in means]
    text = " > ".join(NAMES[model] for model in ours)
    same = (
        "the paper's order"
        if ours == theirs
        else "the paper has " + " > ".join(NAMES[model] for model in theirs)
    )
    findings = [f"By accuracy: {text}; {same}."]
    if "dnn1" in outcomes:
        runs = outcomes["dnn1"]
        for metric, target in (("accuracy", 0), ("auc", 5)):
            mean, deviation = over_seeds(runs, metric)
            published = paper_values.TABLE_6["dnn1"][target]
            findings.append(
                f"DNN1 {metric} {spread(mean, deviation)} from {runs[0].legs} legs; the paper's "
                f"{published:.4f} is {'reached' if mean >= published else 'not reached'}."
            )
        count = sum(runs[0].margin_count)
        near = MARGIN_EDGES.index(0.1)
        wrong = [
            sum(run.margin_count[b] - run.margin_right[b] for run in runs)
            for b in range(len(MARGIN_EDGES))
        ]
        if sum(wrong):
            findings.append(
                f"{sum(wrong[:near]) / sum(wrong):.0%} of DNN1's errors lie within 10 % of the "
                f"boundary, where {sum(runs[0].margin_count[:near]) / count:.0%} of the test legs "
                "are."
            )
    margin = outcomes[MARGIN]
    mean, deviation = over_seeds(margin, "accuracy")
    findings.append(
        f"The margin model is at {spread(mean, deviation)} (AUC "
        f"{over_seeds(margin, 'auc')[0]:.4f}) from {margin[0].legs} legs."
    )
    return findings


def _draw_roc(outcomes: Outcomes) -> "Figure":
    figure, (whole, corner) = panels(2)
    for model, runs in outcomes.items():
        curve = np.mean([outcome.roc for outcome in runs], axis=0)
        label = f"{NAMES[model]} {over_seeds(runs, 'auc')[0]:.4f}"
        if model in paper_values.TABLE_6:
            label += f" (paper {paper_values.TABLE_6[model][5]:.4f})"
        for axes in (whole, corner):
            axes.plot(roc_grid(), curve, color=COLOURS[model], label=label, linewidth=1.2)
    for axes in (whole, corner):
        axes.set(xlabel="false positive rate", ylabel="true positive rate")
    corner.set(xlim=(0.0, 0.2), ylim=(0.8, 1.0))
    whole.legend(fontsize="x-small", title="AUC", loc="lower right")
    return figure


def _draw_margin(outcomes: Outcomes) -> "Figure":
    figure, (axes,) = panels(1, width=6.4, height=3.8)
    names = bin_names()
    for model, runs in outcomes.items():
        accuracies = [_bin_accuracy(runs, b) for b in range(len(names))]
        axes.plot(
            names,
            [np.nan if accuracy is None else accuracy for accuracy in accuracies],
            marker="o",
            markersize=4,
            color=COLOURS[model],
            label=NAMES[model],
        )
    axes.set(xlabel="abs(log(m*/m0))", ylabel="accuracy")
    axes.tick_params(axis="x", labelrotation=30)
    axes.legend(fontsize="small")
    return figure
