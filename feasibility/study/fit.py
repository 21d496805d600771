"""`Fit`: one model, one training set, one test: the cell that most experiments are made of."""

import hashlib
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.paper.standardise import Standardiser
from feasibility.evaluation.metrics import roc_curve, summary
from feasibility.learning.paper.balance import adasyn
from feasibility.learning.paper.models import PRESETS, Epoch, Model, make_model
from feasibility.study.context import Context
from feasibility.study.paper_values import SELECTED_FEATURES

_ROC_POINTS: Final = 201
_TRAIN: Final = 4
"""Stream of random numbers of the training itself."""

_WHERE: Final = ("threads", "device")

MARGIN_EDGES: Final = (0.0, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
"""Edges of the bins of abs(log(m*/m0)) in which right answers are counted; the last is open."""


@final
@dataclass(frozen=True)
class Fit:
    """What is trained and on what.

    Attributes
    ----------
    model : str
        A name of `presets.MODELS`.
    feasible, infeasible : int
        Training legs of either class.
    seed : int
        Seed of the draw and of the training.
    n_features : int
        How many features of the ranking are used.
    adasyn : bool
        Whether the smaller class is filled up by ADASYN.
    fold : int, optional
        Learn from the other folds and test on this one, instead of learning
        from the whole pool and testing on the test set.
    """

    model: str
    feasible: int
    infeasible: int
    seed: int
    n_features: int = SELECTED_FEATURES
    adasyn: bool = False
    fold: int | None = None

    @property
    def label(self) -> str:
        """Short name, for file names and progress."""
        parts = [self.model, f"{self.feasible}+{self.infeasible}", f"f{self.n_features}"]
        parts += ["adasyn"] if self.adasyn else []
        parts += [] if self.fold is None else [f"fold{self.fold}"]
        return "-".join([*parts, f"seed{self.seed}"])


@final
@dataclass(frozen=True)
class Outcome:
    """What came of a fit.

    Attributes
    ----------
    metrics : dict of str to float
        `metrics.summary` at threshold 0.5.
    roc : list of float
        True positive rates at `roc_grid()`.
    margin_count, margin_right : list of int
        Test legs and right answers in the bins of `MARGIN_EDGES`.
    legs, synthetic : int
        Training legs, and rows that ADASYN added.
    fit_seconds, predict_seconds : float
        Wall-clock times.
    epochs : list of dict
        The model's `Epoch` records, where the test rows were followed through them.
    """

    metrics: dict[str, float]
    roc: list[float]
    margin_count: list[int]
    margin_right: list[int]
    legs: int
    synthetic: int
    fit_seconds: float
    predict_seconds: float
    epochs: list[dict[str, Any]]


def roc_grid() -> NDArray[np.float64]:
    """Return the false positive rates at which ROC curves are kept."""
    return np.linspace(0.0, 1.0, _ROC_POINTS) ** 2


def build_model(context: Context, name: str, legs: int) -> Model:
    """Return a model of the study, not fitted: networks as in Table 5, baselines by default.

    Where the preset's epochs would give a network fewer than its least number of
    steps, epochs are added and the drops of the learning rate spread in proportion:
    a small training set is then judged by its legs, not by a training cut short.

    Parameters
    ----------
    context : Context
        The study.
    name : str
        A name of `presets.MODELS`.
    legs : int
        Training legs.
    """
    if name not in PRESETS:
        return make_model(name)
    preset, hyperparameters = context.preset, PRESETS[name][0]
    steps_of_an_epoch = max(1, round(legs / hyperparameters["batch"]))
    epochs = max(preset.epochs, -(-preset.least_steps // steps_of_an_epoch))
    return make_model(
        name,
        drop_period=round(hyperparameters["drop_period"] * epochs / preset.epochs),
        epochs=epochs,
        keep_best=False,
        threads=context.threads,
        device=context.device,
        precision=context.precision,
    )


def recipe(model: Model) -> dict[str, Any]:
    """Return the model's hyperparameters without those that only say where it is computed."""
    return {name: value for name, value in model.config.items() if name not in _WHERE}


def run_fit(context: Context, fit: Fit, *, validate: bool = False) -> Outcome:
    """Return the outcome of a fit, from its cell if it was done before.

    Parameters
    ----------
    context : Context
        The study.
    fit : Fit
        What to train.
    validate : bool
        Follow the test rows through the epochs (the training never sees them).
    """
    model = build_model(context, fit.model, fit.feasible + fit.infeasible)
    columns = context.columns(fit.n_features)
    key = context.cell_key(
        kind="fit",
        fit=asdict(fit),
        config=recipe(model),
        columns=hashlib.sha256(columns.tobytes()).hexdigest()[:16],
        validate=validate,
    )
    value = context.cells.get(
        fit.label, key, lambda: asdict(_compute(context, fit, model, columns, validate=validate))
    )
    return Outcome(**value)


def _compute(
    context: Context, fit: Fit, model: Model, columns: NDArray[np.int64], *, validate: bool
) -> Outcome:
    data = context.data
    train = data.draw(fit.feasible, fit.infeasible, fit.seed, without_fold=fit.fold)
    test = data.test if fit.fold is None else data.fold_rows(fit.fold, fit.seed)
    X, y = data.X[np.ix_(train, columns)], data.y[train]
    standardiser = Standardiser.fit(X)
    X = standardiser.transform(X)
    rng = np.random.default_rng([fit.seed, _TRAIN])
    if fit.adasyn:
        X, y = adasyn(X, y, rng)
    X_test = standardiser.transform(data.X[np.ix_(test, columns)])
    epochs: list[Epoch] = []
    began = time.perf_counter()
    model.fit(
        X,
        y,
        rng=rng,
        X_val=X_test if validate else None,
        y_val=data.y[test] if validate else None,
        on_epoch=epochs.append,
    )
    fitted = time.perf_counter()
    probability = model.predict_probability(X_test)
    predicted = time.perf_counter()
    return judge(
        data.y[test],
        probability,
        data.log_margin[test],
        legs=len(train),
        synthetic=len(y) - len(train),
        fit_seconds=fitted - began,
        predict_seconds=predicted - fitted,
        epochs=[asdict(epoch) for epoch in epochs] if validate else [],
    )


def judge(
    y: NDArray[np.bool_],
    probability: NDArray[np.float64],
    log_margin: NDArray[np.float64],
    **others: Any,
) -> Outcome:
    """Return the outcome of predictions: metrics, ROC and right answers by distance."""
    false_rate, true_rate, _ = roc_curve(y, probability)
    right = (probability >= 0.5) == y
    bins = np.digitize(np.abs(log_margin), MARGIN_EDGES) - 1
    n_bins = len(MARGIN_EDGES)
    return Outcome(
        metrics=summary(y, probability),
        roc=[float(value) for value in np.interp(roc_grid(), false_rate, true_rate)],
        margin_count=np.bincount(bins, minlength=n_bins).tolist(),
        margin_right=np.bincount(bins, weights=right, minlength=n_bins).astype(int).tolist(),
        **others,
    )


def mean_and_deviation(values: Sequence[float]) -> tuple[float, float]:
    """Return mean and standard deviation over seeds (0 for a single one)."""
    array = np.asarray(values, dtype=np.float64)
    return float(array.mean()), float(array.std(ddof=1)) if len(array) > 1 else 0.0


def over_seeds(outcomes: Sequence[Outcome], metric: str) -> tuple[float, float]:
    """Return mean and standard deviation of a metric over the outcomes of several seeds."""
    return mean_and_deviation([outcome.metrics[metric] for outcome in outcomes])
