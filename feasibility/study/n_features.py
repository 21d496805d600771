"""Table 4: how many features of the ranking the network should get."""

from typing import TYPE_CHECKING

from feasibility.study import paper_values
from feasibility.study.context import Context
from feasibility.study.data import N_FOLDS
from feasibility.study.figures import COLOURS, error_line, panels
from feasibility.study.fit import Fit, Outcome, over_seeds, run_fit
from feasibility.study.result import Result, Table, spread

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def run(context: Context) -> Result:
    """Cross-validate DNN1's network on the first k features of the ranking."""
    preset, data = context.preset, context.data
    per_class = preset.n_features_rows // 2 * (N_FOLDS - 1) // N_FOLDS
    smallest = min(
        min(int(data.y[rows].sum()), int((~data.y[rows]).sum()))
        for rows in (data.pool[data.folds != fold] for fold in range(preset.n_features_folds))
    )
    per_class = min(per_class, smallest)
    outcomes = {
        k: [
            run_fit(context, Fit("dnn1", per_class, per_class, fold, k, fold=fold))
            for fold in range(preset.n_features_folds)
        ]
        for k in preset.n_features
    }
    table = Table(
        name="n_features",
        title=(
            f"DNN1's network on the first k features, {2 * per_class} training legs, "
            f"{preset.n_features_folds} of {N_FOLDS} folds"
        ),
        columns=("features", "accuracy", "± (1 sd)", "paper", "AUC", "± (1 sd) AUC", "paper AUC"),
        rows=tuple(
            (
                k,
                *over_seeds(folds, "accuracy"),
                paper_values.TABLE_4.get(k, (None, None))[0],
                *over_seeds(folds, "auc"),
                paper_values.TABLE_4.get(k, (None, None))[1],
            )
            for k, folds in outcomes.items()
        ),
    )
    result = Result(
        name="n_features",
        title="Number of features (Table 4)",
        about=(
            "The network of DNN1 learns from the first k features of the ranking (Fig. 2). Each "
            "pair of bodies is in one of five folds; a network learns from four of them and is "
            "tested on a balanced draw of the fifth, so that the choice of k never sees the test "
            "set. The same folds serve every k."
        ),
        findings=tuple(_findings(outcomes)),
        tables=(table,),
        figures=("n_features",),
    )
    result.write(context.out, [_draw(outcomes)])
    return result


def _findings(outcomes: dict[int, list[Outcome]]) -> list[str]:
    means = {k: over_seeds(folds, "accuracy") for k, folds in outcomes.items()}
    best = max(means, key=lambda k: means[k][0])
    findings = [f"Best with {best} features: accuracy {spread(*means[best])}; the paper's is 60."]
    chosen, everything = paper_values.SELECTED_FEATURES, max(means)
    if chosen in means and everything != chosen:
        gains = [
            a.metrics["accuracy"] - b.metrics["accuracy"]
            for a, b in zip(outcomes[chosen], outcomes[everything], strict=True)
        ]
        published = paper_values.TABLE_4[chosen][0] - paper_values.TABLE_4[103][0]
        findings.append(
            f"{chosen} instead of {everything} features gain {sum(gains) / len(gains):+.4f} in "
            f"accuracy, fold by fold {', '.join(f'{gain:+.4f}' for gain in gains)}; in the paper "
            f"{published:+.4f}."
        )
    return findings


def _draw(outcomes: dict[int, list[Outcome]]) -> "Figure":
    figure, both = panels(2)
    for axes, metric, column in zip(both, ("accuracy", "auc"), (0, 1), strict=True):
        statistics = [over_seeds(folds, metric) for folds in outcomes.values()]
        error_line(
            axes,
            list(outcomes),
            [mean for mean, _ in statistics],
            [deviation for _, deviation in statistics],
            color=COLOURS["dnn1"],
            label="ours",
        )
        axes.plot(
            list(paper_values.TABLE_4),
            [row[column] for row in paper_values.TABLE_4.values()],
            "D--",
            markerfacecolor="none",
            color="0.4",
            linewidth=0.8,
            label="paper",
        )
        axes.set(xlabel="features", ylabel="AUC" if metric == "auc" else metric)
    both[0].legend(fontsize="small")
    return figure
