"""How good a trained model is on a dataset: figures, tables and plots."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.classifier import FeasibilityClassifier
from feasibility.classifier.margin.prediction import LegPrediction
from feasibility.dataset import Dataset
from feasibility.evaluation.metrics import (
    Confusion,
    has_both_classes,
    one_class_summary,
    reliability,
    roc_curve,
    summary,
)
from feasibility.evaluation.peers import Peer, PeerOutcome, ask, near_boundary
from feasibility.evaluation.tables import markdown_table
from feasibility.legs import Legs
from feasibility.runtime.atomic import atomic_path, write_json, write_text
from feasibility.runtime.folders import make_folder
from feasibility.runtime.provenance import provenance

RECALLS: Final = (0.9, 0.95, 0.99, 0.999)
"""Recalls asked of a pruner for which the outcome is reported."""
NEAR_MARGIN: Final = 0.5
"""Legs with abs(log(m*/m0)) up to this count for ``*_log_margin_error_near``."""

SIDE_BY_SIDE: Final = (
    "accuracy",
    "precision",
    "recall",
    "f1",
    "f10",
    "auc",
    "balanced_accuracy",
    "accuracy_within_15_percent",
    "accuracy_within_5_percent",
    "log_loss",
    "calibration_error",
    "us_per_leg",
)
"""Measures of the table that compares a model with its peers."""

BY_FAMILY: Final = (
    "n",
    *SIDE_BY_SIDE[:-1],
    "in_domain",
    "median_log_margin_error_near",
    "median_final_mass_error",
)
"""Measures of the table of several datasets."""


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
        a model that knows margins the errors of log(m*/m0), and of the final mass where the
        dataset has it, relative, with the share of final masses that are as near as the model
        says. ``us_per_leg`` is processor time.
    pruning : tuple of dict
        For each of `RECALLS`, where both classes are there: threshold (the median one, as kinds
        of free ends have their own), recall met, and share of the infeasible legs pruned.
    true_log_margin, log_margin : (n,) float64, optional
        log(m*/m0) by the dataset and by the model, for a model that knows margins.
    peers : tuple of PeerOutcome
        How others did on the same legs.
    """

    y: NDArray[np.bool_]
    probability: NDArray[np.float64]
    metrics: dict[str, float]
    pruning: tuple[dict[str, float], ...]
    true_log_margin: NDArray[np.float64] | None = None
    log_margin: NDArray[np.float64] | None = None
    peers: tuple[PeerOutcome, ...] = ()

    def table(self) -> str:
        """Return the figures as Markdown."""
        tables = [
            markdown_table(
                ["measure", "value"],
                [[name, _number(value)] for name, value in self.metrics.items()],
            ),
        ]
        if self.pruning:
            tables.append(
                markdown_table(
                    ["recall asked", "threshold", "recall met", "infeasible pruned"],
                    [
                        [
                            f"{row['recall_asked']:g}",
                            f"{row['threshold']:.4g}",
                            f"{row['recall']:.4f}",
                            f"{row['infeasible_pruned']:.4f}",
                        ]
                        for row in self.pruning
                    ],
                )
            )
        if self.peers:
            models = [("this model", self.metrics), *((p.name, p.metrics) for p in self.peers)]
            rows = [[name, *_entries(metrics, SIDE_BY_SIDE)] for name, metrics in models]
            tables.append(markdown_table(["side by side", *SIDE_BY_SIDE], rows))
        return "\n\n".join(tables) + "\n"

    def to_dict(self) -> dict[str, Any]:
        """Return all figures as plain data."""
        return {
            "metrics": self.metrics,
            "pruning": list(self.pruning),
            "peers": {peer.name: peer.metrics for peer in self.peers},
        }

    def write(self, folder: Path, title: str) -> list[Path]:
        """Write metrics.json, metrics.md, reliability.png and, of both classes, roc.png.

        Raises
        ------
        InputError
            The folder cannot be written to.
        """
        make_folder(folder)
        names = ["metrics.json", "metrics.md", "reliability.png"]
        paths = [folder / name for name in names]
        content = {"title": title, **self.to_dict(), "provenance": provenance()}
        write_json(paths[0], content)
        write_text(paths[1], f"# {title}\n\n{self.table()}")
        self._plot_reliability(paths[2], title)
        if has_both_classes(self.y):
            paths.append(folder / "roc.png")
            self._plot_roc(paths[-1], title)
        if self.log_margin is not None and self.true_log_margin is not None:
            paths.append(folder / "margin.png")
            _plot_margins(self.true_log_margin, self.log_margin, paths[-1], title)
        return paths

    def _plot_roc(self, path: Path, title: str) -> None:
        figure, axes = _figure(title)
        false_rate, true_rate, _ = roc_curve(self.y, self.probability)
        axes.plot(false_rate, true_rate, label=f"this model, AUC {self.metrics['auc']:.4f}")
        for peer in self.peers:
            peer_false, peer_true, _ = roc_curve(self.y, peer.score)
            label = f"{peer.name}, AUC {peer.metrics['auc']:.4f}"
            axes.plot(peer_false, peer_true, linewidth=0.9, label=label)
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


def evaluate(
    classifier: FeasibilityClassifier, dataset: Dataset, peers: Sequence[Peer] = ()
) -> Evaluation:
    """Ask a model about the labelled legs of a dataset.

    Of a dataset with one class, such as one for final masses, whose legs can all be flown, some
    measures are left out.

    Parameters
    ----------
    classifier : FeasibilityClassifier
        The model.
    dataset : Dataset
        Legs with labels, none of which it was trained on.
    peers : sequence of Peer
        Others to ask about the same legs, where their label is the margin.
    """
    part = dataset.take(np.flatnonzero(dataset.labelled))
    y = part.flyable
    classifier.assess(part.legs.take([0]))  # compiles what there is to compile
    began = time.process_time()
    probability, inside = classifier.assess(part.legs)
    seconds = time.process_time() - began
    both = has_both_classes(y)
    metrics = (summary if both else one_class_summary)(y, probability)
    metrics["in_domain"] = float(inside.mean())
    metrics["us_per_leg"] = 1e6 * seconds / len(y)
    true = part.columns["log_margin"]
    metrics |= near_boundary((probability >= 0.5) == y, true)
    pruning = _pruning(classifier, part.legs, y, probability) if both else ()
    others = tuple(ask(peer, part.legs, y, true) for peer in peers)
    if classifier.artefact.kind != "margin":
        return Evaluation(y, probability, metrics, pruning, peers=others)
    answers = classifier.predict(part.legs)
    estimate = np.log(answers.margin)
    metrics |= _errors(estimate, true, answers, part.columns["m_final_kg"])
    return Evaluation(y, probability, metrics, pruning, true, estimate, others)


def _errors(
    estimate: NDArray[np.float64],
    true: NDArray[np.float64],
    answers: LegPrediction,
    true_final_mass: NDArray[np.float64],
) -> dict[str, float]:
    """Return the errors of log(m*/m0) and of the final mass, where both sides are known."""
    error = np.abs(estimate - true)
    known = np.isfinite(error)
    errors = {
        "margin_known": float(np.isfinite(estimate).mean()),
        "median_log_margin_error": float(np.median(error[known])),
    }
    near = known & (np.abs(true) <= NEAR_MARGIN)
    if near.any():
        errors["median_log_margin_error_near"] = float(np.median(error[near]))
        errors["mean_log_margin_error_near"] = float(np.mean(error[near]))
    miss = np.abs(answers.final_mass / true_final_mass - 1.0)
    # A leg that the model thinks too heavy has no estimate of its least propellant.
    flown = np.isfinite(miss) & (estimate >= 0.0)
    if flown.any():
        errors["median_final_mass_error"] = float(np.median(miss[flown]))
        errors["mean_final_mass_error"] = float(np.mean(miss[flown]))
        within = miss * true_final_mass < answers.final_mass_error
        errors["final_mass_within_error"] = float(np.mean(within[flown]))
    return errors


def by_family(evaluations: Mapping[str, Evaluation]) -> str:
    """Return a table with a line for each dataset, and one of all models, as Markdown.

    Parameters
    ----------
    evaluations : mapping of str to Evaluation
        By the name of the dataset.
    """
    tables = [
        markdown_table(
            ["family", *BY_FAMILY],
            [[name, *_entries(one.metrics, BY_FAMILY)] for name, one in evaluations.items()],
        )
    ]
    peers = [peer.name for peer in next(iter(evaluations.values())).peers]
    if peers:
        rows = []
        for name, one in evaluations.items():
            models = [one.metrics, *(peer.metrics for peer in one.peers)]
            rows.append([name, *(_entry(metrics, "balanced_accuracy") for metrics in models)])
        tables.append(markdown_table(["balanced accuracy", "this model", *peers], rows))
    return "\n\n".join(tables) + "\n"


def _pruning(
    classifier: FeasibilityClassifier,
    legs: Legs,
    y: NDArray[np.bool_],
    probability: NDArray[np.float64],
) -> tuple[dict[str, float], ...]:
    rows = []
    for recall in RECALLS:
        threshold = classifier.thresholds(recall, legs)
        counts = Confusion.of(y, probability >= threshold)
        rows.append(
            {
                "recall_asked": recall,
                # The kinds of ends may have their own.
                "threshold": float(np.median(threshold)),
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


def _entries(metrics: Mapping[str, float], keys: Sequence[str]) -> list[str]:
    return [_entry(metrics, key) for key in keys]


def _entry(metrics: Mapping[str, float], key: str) -> str:
    return _number(metrics[key]) if key in metrics else "–"


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
