"""The paper's label beside ours: how much of its error is noise of the label."""

import functools
import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.paper.standardise import Standardiser
from feasibility.dataset.convergence import converge_from_random_start
from feasibility.evaluation.metrics import Confusion, auc
from feasibility.legs import Legs
from feasibility.runtime.workers import worker_pool
from feasibility.study import paper_values
from feasibility.study.context import Context
from feasibility.study.figures import NAMES, panels
from feasibility.study.fit import build_model, mean_and_deviation, recipe
from feasibility.study.result import Result, Table, Value, spread

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LEGS_PER_CELL: Final = 10
_STARTS: Final = 2
_SEEDS: Final = 3
_LABELS: Final = ("converged", "margin")
_EDGES: Final = (-np.inf, -0.5, -0.2, -0.05, 0.0, 0.05, 0.2, 0.5, 1.0, np.inf)
_CHOICE, _START, _MODEL = 5, 6, 7
"""Streams of random numbers."""


@final
@dataclass(frozen=True, eq=False)
class BothLabels:
    """The legs that have either label; m of them.

    Attributes
    ----------
    rows : (m,) int64
        Rows of the study's data.
    starts : (m, 2) bool
        Whether the minimum-propellant problem converged from each of two random starts.
    """

    rows: NDArray[np.int64]
    starts: NDArray[np.bool_]


def run(context: Context) -> Result:
    """Label the same legs by convergence too; train on either label, test on both."""
    both = _label(context)
    data = context.data
    flyable = data.y[both.rows]
    outcomes = _train(context, both)
    starts = both.starts
    disagree = float((starts[:, 0] != starts[:, 1]).mean())
    result = Result(
        name="labels",
        title="Both labels: convergence and maximum initial mass",
        about=(
            f"{len(both.rows)} legs are labelled as in the paper, by whether the "
            "minimum-propellant problem converges from a random start (SLSQP), each from two "
            "starts, beside our label m0 <= m*. Models learn from one fold split of these legs "
            "with the first start's outcome or with our label, from balanced sets of equal size, "
            "and are tested on both. Balanced accuracy and AUC on the held-out legs; ± is one "
            f"standard deviation over {_SEEDS} draws."
        ),
        findings=tuple(_findings(flyable, starts, disagree, outcomes)),
        tables=(
            _noise_table(flyable, starts, disagree),
            _margin_table(data.log_margin[both.rows], starts),
            _cross_table(outcomes),
        ),
        figures=("labels",),
    )
    result.write(context.out, [_draw(data.log_margin[both.rows], starts, outcomes)])
    return result


def converged(legs: Legs, seed: int, start: int, first: int) -> list[bool]:
    """Return whether each leg's problem converges from a random start."""
    rng = np.random.default_rng([seed, _START, start, first])
    return [bool(value) for value in converge_from_random_start(legs, rng).converged]


def _label(context: Context) -> BothLabels:
    data = context.data
    rng = np.random.default_rng([0, _CHOICE])
    rows = rng.permutation(data.pool)[: context.preset.label_legs]
    wanted = []
    for start in range(_STARTS):
        for first in range(0, len(rows), _LEGS_PER_CELL):
            part = rows[first : first + _LEGS_PER_CELL]
            key = context.cell_key(kind="convergence", start=start, rows=part.tolist())
            compute = functools.partial(converged, data.legs.take(part), 0, start, first)
            wanted.append((f"convergence-start{start}-leg{first}", key, compute))
    with worker_pool(context.workers) as executor:
        values = context.cells.get_many(wanted, executor)
    flat = np.array([value for part in values for value in part], dtype=np.bool_)
    return BothLabels(rows, flat.reshape(_STARTS, -1).T)


Scores = dict[tuple[str, str, str], list[tuple[float, float]]]
"""Balanced accuracy and AUC over the seeds, by model, label learned and label tested."""


def _train(context: Context, both: BothLabels) -> Scores:
    data = context.data
    fold = dict(zip(data.pool.tolist(), data.folds.tolist(), strict=True))
    held_out = np.array([fold[row] == 0 for row in both.rows.tolist()])
    labels = {"converged": both.starts[:, 0], "margin": data.y[both.rows]}
    smallest = min(
        min(int(label[~held_out].sum()), int((~label[~held_out]).sum()))
        for label in labels.values()
    )
    testable = all(len(np.unique(label[held_out])) == 2 for label in labels.values())
    if smallest < 2 or not testable:
        context.say("labels: too few legs of a class to train on; only the labels are compared")
        return {}
    scores: Scores = {}
    for model in context.preset.label_models:
        for learned, label in labels.items():
            for seed in range(_SEEDS):
                key = context.cell_key(
                    kind="labels",
                    model=model,
                    config=recipe(build_model(context, model, 2 * smallest)),
                    learned=learned,
                    seed=seed,
                    rows=both.rows.tolist(),
                    label=label.astype(int).tolist(),
                    tests=[labels[name].astype(int).tolist() for name in _LABELS],
                )
                compute = functools.partial(
                    _cross, context, both.rows, label, held_out, labels, smallest, model, seed
                )
                name = f"labels-{model}-{learned}-seed{seed}"
                value = context.cells.get(name, key, compute)
                for tested in _LABELS:
                    pair = value[tested]
                    scores.setdefault((model, learned, tested), []).append((pair[0], pair[1]))
    return scores


def _cross(
    context: Context,
    rows: NDArray[np.int64],
    label: NDArray[np.bool_],
    held_out: NDArray[np.bool_],
    labels: dict[str, NDArray[np.bool_]],
    per_class: int,
    model_name: str,
    seed: int,
) -> dict[str, list[float]]:
    """Train on one label and return balanced accuracy and AUC on each."""
    rng = np.random.default_rng([seed, _MODEL])
    candidates = rng.permutation(np.flatnonzero(~held_out))
    train = np.concatenate(
        [candidates[label[candidates] == value][:per_class] for value in (True, False)]
    )
    columns = context.columns(paper_values.SELECTED_FEATURES)
    X = context.data.X[np.ix_(rows, columns)]
    standardiser = Standardiser.fit(X[train])
    model = build_model(context, model_name, 2 * per_class)
    model.fit(standardiser.transform(X[train]), label[train], rng=rng)
    probability = model.predict_probability(standardiser.transform(X[held_out]))
    return {
        tested: [
            Confusion.of(truth[held_out], probability >= 0.5).balanced_accuracy,
            auc(truth[held_out], probability),
        ]
        for tested, truth in labels.items()
    }


def _noise_table(flyable: NDArray[np.bool_], starts: NDArray[np.bool_], disagree: float) -> Table:
    def share(hits: NDArray[np.bool_]) -> float | None:
        return float(hits.mean()) if hits.size else None

    rows: list[tuple[Value, ...]] = [
        ("legs", len(flyable)),
        ("flyable (m0 <= m*)", share(flyable)),
        ("converged from the first start", share(starts[:, 0])),
        ("the paper's share of random pairs", paper_values.FEASIBLE_SHARE),
        ("converged, of those flyable, both starts counted", share(starts[flyable])),
        ("converged, of those not flyable", share(starts[~flyable])),
        ("two starts disagree", disagree),
        ("error of the ideal classifier on the converged label, at least", disagree / 2.0),
        ("the same, at most", disagree),
        ("converged label wrong about flyability", share(starts[:, 0] != flyable)),
        ("the paper's error with its label (DNN1)", 1.0 - paper_values.TABLE_6["dnn1"][0]),
    ]
    return Table(
        "noise", "What the two labels say of the same legs", ("quantity", "value"), tuple(rows)
    )


def _bins(log_margin: NDArray[np.float64]) -> list[tuple[str, NDArray[np.bool_]]]:
    names = [f"{low:g} to {high:g}" for low, high in itertools.pairwise(_EDGES)]
    names = [f"below {_EDGES[1]:g}", *names[1:-1], f"above {_EDGES[-2]:g}"]
    return [
        (name, (log_margin >= low) & (log_margin < high))
        for name, (low, high) in zip(names, itertools.pairwise(_EDGES), strict=True)
    ]


def _margin_table(log_margin: NDArray[np.float64], starts: NDArray[np.bool_]) -> Table:
    return Table(
        name="convergence",
        title="Convergence from a random start by margin log(m*/m0)",
        columns=("log(m*/m0)", "legs", "converged", "two starts disagree"),
        rows=tuple(
            (
                name,
                int(rows.sum()),
                float(starts[rows].mean()) if rows.any() else None,
                float((starts[rows, 0] != starts[rows, 1]).mean()) if rows.any() else None,
            )
            for name, rows in _bins(log_margin)
        ),
    )


def _cross_table(scores: Scores) -> Table:
    rows = []
    for (model, learned, tested), pairs in scores.items():
        accuracy = spread(*mean_and_deviation([pair[0] for pair in pairs]))
        area = spread(*mean_and_deviation([pair[1] for pair in pairs]))
        rows.append((NAMES[model], learned, tested, accuracy, area))
    return Table(
        name="cross",
        title="Learned from one label, tested on both",
        columns=("model", "learned from", "tested on", "balanced accuracy", "AUC"),
        rows=tuple(rows),
    )


def _findings(
    flyable: NDArray[np.bool_],
    starts: NDArray[np.bool_],
    disagree: float,
    scores: Scores,
) -> list[str]:
    missed = int((flyable & ~starts[:, 0]).sum())
    invented = int((~flyable & starts[:, 0]).sum())
    findings = [
        f"{starts[flyable].mean():.0%} of the random starts on flyable legs converge, and two "
        f"starts on the same leg disagree for {disagree:.1%} of all legs. With p the chance that "
        "a leg converges, they disagree with 2 p (1 - p), and even a classifier that knows p errs "
        f"with min(p, 1 - p): between {disagree / 2:.1%} and {disagree:.1%} of error on this "
        "label is luck of the start, whatever the model.",
        f"The label of the first start is wrong about flyability for {missed + invented} of "
        f"{len(flyable)} legs: {missed} flyable ones that the solver did not close, {invented} "
        "the other way round. What of this is not luck can be learned, and a search pruned by "
        "such a model loses those legs however well it is learned.",
    ]
    for model in dict.fromkeys(key[0] for key in scores):
        means = {
            (learned, tested): mean_and_deviation(
                [pair[0] for pair in scores[model, learned, tested]]
            )[0]
            for learned in _LABELS
            for tested in _LABELS
        }
        findings.append(
            f"{NAMES[model]}, balanced accuracy: learned and tested on convergence "
            f"{means['converged', 'converged']:.3f}; learned and tested on the margin "
            f"{means['margin', 'margin']:.3f}; learned on convergence, tested on the margin "
            f"{means['converged', 'margin']:.3f}."
        )
    return findings


def _draw(log_margin: NDArray[np.float64], starts: NDArray[np.bool_], scores: Scores) -> "Figure":
    figure, (left, right) = panels(2, height=3.8)
    bins = [(name, rows) for name, rows in _bins(log_margin) if rows.any()]
    names = [name for name, _ in bins]
    left.plot(names, [starts[rows].mean() for _, rows in bins], "o-", label="converged")
    left.plot(
        names,
        [(starts[rows, 0] != starts[rows, 1]).mean() for _, rows in bins],
        "s--",
        label="two starts disagree",
    )
    left.tick_params(axis="x", labelrotation=45)
    left.set(xlabel="log(m*/m0)", ylabel="share of legs", ylim=(-0.02, 1.02))
    left.legend(fontsize="small")
    for k, ((_, learned, _), pairs) in enumerate(scores.items()):
        mean, deviation = mean_and_deviation([pair[0] for pair in pairs])
        colour = "#0072B2" if learned == "margin" else "#E69F00"
        right.barh(k, mean, xerr=deviation, color=colour)
    cases = [f"{NAMES[model]}: {learned} → {tested}" for model, learned, tested in scores]
    right.set_yticks(range(len(cases)), cases, fontsize=7)
    right.set(xlim=(0.4, 1.0), xlabel="balanced accuracy (learned → tested)")
    return figure
