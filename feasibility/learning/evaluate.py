"""How good a trained model is on a dataset: figures, tables and plots."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.atomic import atomic_path, write_text
from feasibility.classifier import FeasibilityClassifier
from feasibility.dataset import Dataset
from feasibility.learning.metrics import Confusion, reliability, roc_curve, summary
from feasibility.learning.train import labels

RECALLS: Final = (0.9, 0.95, 0.99, 0.999)
"""Recalls asked of a pruner for which the outcome is reported."""

NEAR_BOUNDARY: Final = (0.15, 0.05)
"""Legs within these shares of the boundary, by abs(m*/m0 - 1), are judged on their own."""


NEAR_MARGIN: Final = 0.5
"""Legs with abs(log(m*/m0)) up to this count for ``*_log_margin_error_near``."""


@final
@dataclass(frozen=True, eq=False)
class Evaluation:
    """The outcome; n legs.

    Attributes
    ----------
    y : (n,) bool
        Labels.
    probability : (n,) float64
        The model's answers.
    metrics : dict of str to float
        `metrics.summary` at threshold 0.5, ``in_domain``, the share of legs within the
        model's domain, and ``accuracy_within_15_percent`` and so on where margins are known; for
        a model that knows margins the errors of log(m*/m0).
    pruning : tuple of dict
        For each of `RECALLS`: threshold, recall met, and share of the infeasible legs pruned.
    true_log_margin, log_margin : (n,) float64, optional
        log(m*/m0) by the dataset and by the model, for a model that knows margins.
    """

    y: NDArray[np.bool_]
    probability: NDArray[np.float64]
    metrics: dict[str, float]
    pruning: tuple[dict[str, float], ...]
    true_log_margin: NDArray[np.float64] | None = None
    log_margin: NDArray[np.float64] | None = None

    def table(self) -> str:
        """Return the figures as Markdown."""
        lines = ["| measure | value |", "|---|---|"]
        lines += [f"| {name} | {_number(value)} |" for name, value in self.metrics.items()]
        lines += ["", "| recall asked | threshold | recall met | infeasible pruned |"]
        lines += ["|---|---|---|---|"]
        lines += [
            f"| {row['recall_asked']:g} | {row['threshold']:.4g} | {row['recall']:.4f} | "
            f"{row['infeasible_pruned']:.4f} |"
            for row in self.pruning
        ]
        return "\n".join(lines) + "\n"

    def write(self, folder: Path, title: str) -> list[Path]:
        """Write metrics.json, metrics.md, roc.png and reliability.png.

        Raises
        ------
        InputError
            The folder cannot be written to.
        """
        folder.mkdir(parents=True, exist_ok=True)
        paths = [
            folder / name for name in ("metrics.json", "metrics.md", "roc.png", "reliability.png")
        ]
        content = {"title": title, "metrics": self.metrics, "pruning": list(self.pruning)}
        write_text(paths[0], json.dumps(content, indent=1) + "\n")
        write_text(paths[1], f"# {title}\n\n{self.table()}")
        self._plot_roc(paths[2], title)
        self._plot_reliability(paths[3], title)
        if self.log_margin is not None and self.true_log_margin is not None:
            paths.append(folder / "margin.png")
            _plot_margins(self.true_log_margin, self.log_margin, paths[-1], title)
        return paths

    def _plot_roc(self, path: Path, title: str) -> None:
        figure, axes = _figure(title)
        false_rate, true_rate, _ = roc_curve(self.y, self.probability)
        axes.plot(false_rate, true_rate, label=f"AUC {self.metrics['auc']:.4f}")
        axes.plot([0, 1], [0, 1], ":", color="grey", label="guessing")
        axes.set(xlabel="false positive rate", ylabel="true positive rate (recall)")
        _save(figure, axes, path)

    def _plot_reliability(self, path: Path, title: str) -> None:
        figure, axes = _figure(title)
        mean, share, count = reliability(self.y, self.probability)
        error = self.metrics["calibration_error"]
        axes.plot(mean, share, "o-", label=f"model, calibration error {error:.4f}")
        axes.plot([0, 1], [0, 1], ":", color="grey", label="calibrated")
        for x, y, n in zip(mean, share, count, strict=True):
            axes.annotate(
                f"{n}", (x, y), xytext=(3, -9), textcoords="offset points", fontsize="x-small"
            )
        axes.set(xlabel="probability by the model", ylabel="share of feasible legs")
        _save(figure, axes, path)


def evaluate(classifier: FeasibilityClassifier, dataset: Dataset) -> Evaluation:
    """Ask a model about the labelled legs of a dataset.

    Parameters
    ----------
    classifier : FeasibilityClassifier
        The model.
    dataset : Dataset
        Legs with labels, none of which it was trained on.

    Raises
    ------
    InputError
        The dataset has only one class.
    """
    part = dataset.take(np.flatnonzero(dataset.labelled))
    y = labels(part)
    probability, inside = classifier.assess(part.legs)
    metrics = summary(y, probability)
    metrics["in_domain"] = float(inside.mean())
    log_margin = part.columns["log_margin"]
    for width in NEAR_BOUNDARY:
        near = np.abs(np.expm1(log_margin)) <= width
        if near.any():
            right = (probability[near] >= 0.5) == y[near]
            metrics[f"accuracy_within_{100 * width:.0f}_percent"] = float(right.mean())
    pruning = _pruning(classifier, y, probability, RECALLS)
    if classifier.artefact.kind != "margin":
        return Evaluation(y, probability, metrics, pruning)
    estimate = np.log(classifier.margin(part.legs))
    error = np.abs(estimate - log_margin)[np.isfinite(estimate) & np.isfinite(log_margin)]
    metrics["margin_known"] = float(np.isfinite(estimate).mean())
    metrics["median_log_margin_error"] = float(np.median(error))
    near = np.abs(log_margin) <= NEAR_MARGIN
    error = np.abs(estimate - log_margin)[near & np.isfinite(estimate)]
    if len(error):
        metrics["median_log_margin_error_near"] = float(np.median(error))
        metrics["mean_log_margin_error_near"] = float(np.mean(error))
    return Evaluation(y, probability, metrics, pruning, log_margin, estimate)


def _pruning(
    classifier: FeasibilityClassifier,
    y: NDArray[np.bool_],
    probability: NDArray[np.float64],
    recalls: Sequence[float],
) -> tuple[dict[str, float], ...]:
    rows = []
    for recall in recalls:
        threshold = classifier.threshold(recall)
        counts = Confusion.of(y, probability >= threshold)
        rows.append(
            {
                "recall_asked": recall,
                "threshold": threshold,
                "recall": counts.recall,
                "infeasible_pruned": counts.specificity,
            }
        )
    return tuple(rows)


def _plot_margins(
    true: NDArray[np.float64], estimate: NDArray[np.float64], path: Path, title: str
) -> None:
    figure, axes = _figure(title)
    axes.plot(true, estimate, ",", rasterized=True, label=f"{len(true)} legs")
    axes.plot([-1, 1], [-1, 1], ":", color="grey", label="exact")
    axes.set(
        xlim=(-1, 1), ylim=(-1, 1), xlabel="log(m*/m0), solved", ylabel="log(m*/m0) by the model"
    )
    _save(figure, axes, path)


def _number(value: float) -> str:
    if value == round(value) and abs(value) > 1:
        return f"{value:.0f}"
    return f"{value:.4f}" if abs(value) >= 0.05 else f"{value:.5f}"


def _figure(title: str) -> tuple[Any, Any]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5, 4.5), layout="constrained")
    axes = figure.subplots()
    axes.set_title(title, fontsize="medium")
    axes.grid(alpha=0.3)
    return figure, axes


def _save(figure: Any, axes: Any, path: Path) -> None:
    axes.legend(loc="lower right")
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=150, format=path.suffix[1:])
