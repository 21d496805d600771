"""Figs 4 to 7: growing numbers of infeasible legs, with and without ADASYN."""

from typing import TYPE_CHECKING, Final

from feasibility.study import paper_values
from feasibility.study.context import Context
from feasibility.study.figures import COLOURS, NAMES, error_line, legend, panels
from feasibility.study.fit import Fit, Outcome, over_seeds, run_fit
from feasibility.study.result import Result, Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SHOWN: Final = ("accuracy", "precision", "recall", "f10")

Grid = dict[tuple[str, int, bool], list[Outcome]]
"""Outcomes over the seeds, by model, infeasible legs and whether ADASYN filled up."""


def run(context: Context) -> Result:
    """Keep the feasible training legs and add infeasible ones; test on balanced legs."""
    grid = _grid(context)
    table = Table(
        name="imbalance",
        title="On the balanced test set, by infeasible training legs",
        columns=(
            "model",
            "feasible",
            "infeasible",
            "ADASYN",
            "synthetic",
            *(text for metric in _SHOWN for text in (metric, f"± {metric}")),
        ),
        rows=tuple(
            (
                NAMES[model],
                runs[0].legs - infeasible,
                infeasible,
                "yes" if filled else "no",
                runs[0].synthetic,
                *(value for metric in _SHOWN for value in over_seeds(runs, metric)),
            )
            for (model, infeasible, filled), runs in grid.items()
        ),
    )
    effect = _effect_table(grid)
    result = Result(
        name="imbalance",
        title="Imbalance and ADASYN (Figs 4 to 7)",
        about=(
            "The number of feasible training legs is fixed, that of infeasible ones grows. ADASYN "
            "fills up the feasible class with synthetic rows, made from training rows alone. All "
            f"are tested on the same balanced legs; {context.preset.imbalance_seeds} seeds. "
            "The threshold stays at 0.5."
        ),
        findings=tuple(_findings(grid)),
        tables=(effect, table),
        figures=("imbalance",),
    )
    result.write(context.out, [_draw(grid)])
    return result


def _grid(context: Context) -> Grid:
    preset, data = context.preset, context.data
    flyable = int(data.y[data.pool].sum())
    most = len(data.pool) - flyable
    grid: Grid = {}
    for model, wanted in preset.feasible.items():
        feasible = min(wanted, flyable)
        for ratio in preset.ratios:
            infeasible = min(round(ratio * feasible), most)
            # Where the classes are balanced there is nothing for ADASYN to add.
            for filled in (False, True) if infeasible > feasible else (False,):
                grid[model, infeasible, filled] = [
                    run_fit(context, Fit(model, feasible, infeasible, seed, adasyn=filled))
                    for seed in range(preset.imbalance_seeds)
                ]
    return grid


def _ends(grid: Grid, model: str) -> tuple[int, int]:
    counts = [infeasible for name, infeasible, _ in grid if name == model]
    return min(counts), max(counts)


def _models(grid: Grid) -> list[str]:
    return list(dict.fromkeys(model for model, _, _ in grid))


def _effect_table(grid: Grid) -> Table:
    rows = []
    for model in _models(grid):
        first, last = _ends(grid, model)
        if (model, last, True) not in grid:
            continue
        for metric in ("precision", "recall", "accuracy"):
            values = [
                over_seeds(grid[key], metric)[0]
                for key in ((model, first, False), (model, last, False), (model, last, True))
            ]
            rows.append(
                (NAMES[model], metric, *values, values[1] - values[0], values[2] - values[1])
            )
    return Table(
        name="effect",
        title="From the fewest to the most infeasible legs, then with ADASYN",
        columns=("model", "metric", "fewest", "most", "most, ADASYN", "bias", "ADASYN's change"),
        rows=tuple(rows),
    )


def _findings(grid: Grid) -> list[str]:
    findings = []
    for model in _models(grid):
        first, last = _ends(grid, model)
        if (model, last, True) not in grid:
            continue
        start, biased, filled = (
            {metric: over_seeds(grid[key], metric)[0] for metric in ("recall", "precision")}
            for key in ((model, first, False), (model, last, False), (model, last, True))
        )
        text = (
            f"{NAMES[model]}: from {first} to {last} infeasible legs recall changes by "
            f"{biased['recall'] - start['recall']:+.4f} and precision by "
            f"{biased['precision'] - start['precision']:+.4f}; ADASYN gives back "
            f"{filled['recall'] - biased['recall']:+.4f} of recall at "
            f"{filled['precision'] - biased['precision']:+.4f} of precision."
        )
        if model == "dnn1":
            text += (
                f" The paper's network lost about {paper_values.RECALL_LOSS_OF_BIAS:.0%} of "
                "recall and next to nothing with ADASYN, which cost about "
                f"{paper_values.ACCURACY_LOSS_OF_ADASYN:.0%} of accuracy and precision."
            )
        findings.append(text)
    return findings


def _draw(grid: Grid) -> "Figure":
    figure, all_axes = panels(len(_SHOWN))
    for axes, metric in zip(all_axes, _SHOWN, strict=True):
        for model in _models(grid):
            for filled in (False, True):
                points = {
                    infeasible / (runs[0].legs - infeasible): over_seeds(runs, metric)
                    for (name, infeasible, with_adasyn), runs in grid.items()
                    # Balanced legs need no filling up: both lines begin there.
                    if name == model
                    and (with_adasyn == filled or (name, infeasible, filled) not in grid)
                }
                error_line(
                    axes,
                    list(points),
                    [mean for mean, _ in points.values()],
                    [deviation for _, deviation in points.values()],
                    color=COLOURS[model],
                    linestyle="--" if filled else "-",
                    markerfacecolor="none" if filled else COLOURS[model],
                    label=None if filled else NAMES[model],
                )
        axes.set(xlabel="infeasible for each feasible (dashed: ADASYN)", ylabel=metric)
    legend(figure, all_axes[0])
    return figure
