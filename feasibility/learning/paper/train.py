"""From a dataset to an artefact: one program, to be read from top to bottom."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.artefact import Artefact
from feasibility.classifier.paper.features import FEATURE_SET, FEATURES, paper_features
from feasibility.classifier.paper.standardise import Standardiser
from feasibility.dataset import Dataset
from feasibility.dataset.splits import pair_ids, split_pairs
from feasibility.errors import InputError
from feasibility.evaluation.metrics import summary
from feasibility.learning.paper.balance import adasyn
from feasibility.learning.paper.feature_ranking import rank_features
from feasibility.learning.paper.models import Epoch, make_model
from feasibility.learning.paper.models.base import OnEpoch
from feasibility.learning.paper.models.dnn import Dnn
from feasibility.runtime.provenance import provenance

SHARES: Final = (0.8, 0.1, 0.1)
"""Shares of training, validation and calibration, split by pairs of bodies."""

BALANCES: Final = ("none", "adasyn")

_DOMAIN_MARGIN: Final = 0.05
"""The domain reaches beyond the training range of an input by this share of it."""

_MAX_SCORES: Final = 20_000


@final
@dataclass(frozen=True)
class Recipe:
    """How to train.

    Parameters
    ----------
    model : str
        A name for `make_model`.
    hyperparameters : mapping
        Its hyperparameters, where they are not the defaults.
    n_features : int
        How many of the 103 features, the most important first.
    balance : str
        "none" or "adasyn".
    seed : int
        Seed of split, ranking, balance and training.
    """

    model: str
    hyperparameters: Mapping[str, Any] = field(default_factory=dict)
    n_features: int = 60
    balance: str = "none"
    seed: int = 0

    def __post_init__(self) -> None:
        if not 1 <= self.n_features <= len(FEATURES):
            raise InputError(f"features: {self.n_features}, expected 1 to {len(FEATURES)}")
        if self.balance not in BALANCES:
            raise InputError(f"balance: {self.balance!r}, expected {' or '.join(BALANCES)}")


@final
@dataclass(frozen=True, eq=False)
class Examples:
    """Labelled legs as a model sees them; n of them.

    Attributes
    ----------
    X : (n, 103) float64
        `paper_features`, not standardised.
    y : (n,) bool
        Whether the leg is flyable.
    pairs : (n,) int64
        Number of the unordered pair of bodies.
    rows : (n,) int64
        Rows of the dataset that have a label.
    """

    X: NDArray[np.float64]
    y: NDArray[np.bool_]
    pairs: NDArray[np.int64]
    rows: NDArray[np.int64]

    @classmethod
    def of(cls, dataset: Dataset) -> "Examples":
        """Compute features and labels (`Dataset.flyable`) of the rows whose label is known."""
        rows = np.flatnonzero(dataset.labelled)
        part = dataset.take(rows)
        columns = part.columns
        X = paper_features(
            part.legs,
            dt_imp_days=columns["dt_imp_days"],
            lambert_dv=columns["lambert_dv_m_s"],
        )
        return cls(
            X, part.flyable, pair_ids(columns["dep_id"], columns["arr_id"]), rows.astype(np.int64)
        )


@final
@dataclass(frozen=True, eq=False)
class Parts:
    """Legs split and made ready for a model; n of them with a label, k features.

    Attributes
    ----------
    examples : Examples
        The n legs.
    columns : (k,) intp
        Which features, the most important first.
    inputs : (n, k) float64
        Those features, not standardised.
    learned, validation, calibration : arrays of intp
        Rows of the three parts.
    scaler : Standardiser
        Of the training part.
    X, y : arrays
        Standardised inputs (m, k) and labels (m,) of the training part, filled up if asked for.
    """

    examples: Examples
    columns: NDArray[np.intp]
    inputs: NDArray[np.float64]
    learned: NDArray[np.intp]
    validation: NDArray[np.intp]
    calibration: NDArray[np.intp]
    scaler: Standardiser
    X: NDArray[np.float64]
    y: NDArray[np.bool_]


def prepare(dataset: Dataset, recipe: Recipe) -> Parts:
    """Split, rank features, standardise and balance as a recipe says.

    Raises
    ------
    InputError
        Too few legs or pairs, or only one class.
    """
    split, ranking, balance = (np.random.default_rng([recipe.seed, stream]) for stream in range(3))
    examples = Examples.of(dataset)
    part = split_pairs(examples.pairs, SHARES, split)
    learned, validation, calibration = (np.flatnonzero(part == k) for k in range(3))
    _check_classes(examples.y, training=learned, validation=validation, calibration=calibration)
    columns = np.arange(len(FEATURES))
    if recipe.n_features < len(FEATURES):
        order, _ = rank_features(examples.X[learned], examples.y[learned], ranking)
        columns = order[: recipe.n_features]
    inputs = examples.X[:, columns]
    scaler = Standardiser.fit(inputs[learned])
    X, y = scaler.transform(inputs[learned]), examples.y[learned]
    if recipe.balance == "adasyn":
        X, y = adasyn(X, y, balance)
    return Parts(examples, columns, inputs, learned, validation, calibration, scaler, X, y)


def train(
    dataset: Dataset,
    recipe: Recipe,
    *,
    checkpoint: Path | None = None,
    on_epoch: OnEpoch | None = None,
) -> Artefact:
    """Train a model.

    Parameters
    ----------
    dataset : Dataset
        Labelled legs.
    recipe : Recipe
        How to train.
    checkpoint : Path, optional
        For networks: file from which an interrupted training goes on.
    on_epoch : callable, optional
        Called after each epoch of a network.

    Returns
    -------
    Artefact
        Its metrics are those of the validation and calibration parts.

    Raises
    ------
    InputError
        Too few legs or pairs, only one class, or a recipe that cannot be followed.
    MissingDependencyError
        The extra ``train`` is not installed.
    """
    model = make_model(recipe.model, **recipe.hyperparameters)
    parts = prepare(dataset, recipe)
    examples, inputs, scaler, X, y = parts.examples, parts.inputs, parts.scaler, parts.X, parts.y
    learned, validation, calibration = parts.learned, parts.validation, parts.calibration
    options: dict[str, Any] = {"checkpoint": checkpoint} if isinstance(model, Dnn) else {}
    model.fit(
        X,
        y,
        rng=np.random.default_rng([recipe.seed, 3]),
        X_val=scaler.transform(inputs[validation]),
        y_val=examples.y[validation],
        on_epoch=on_epoch,
        **options,
    )

    score = {
        name: model.predict_probability(scaler.transform(inputs[rows]))
        for name, rows in (("validation", validation), ("calibration", calibration))
    }
    legs = dataset.legs.take(examples.rows[learned])
    return Artefact(
        kind=model.kind,
        feature_set=FEATURE_SET,
        features=tuple(FEATURES[column].name for column in parts.columns),
        units=tuple(FEATURES[column].unit for column in parts.columns),
        arrays={
            **{f"model/{name}": array for name, array in model.to_arrays().items()},
            "scaler/mean": scaler.mean,
            "scaler/std": scaler.std,
            **_domain(inputs[learned], legs.isp, legs.thrust),
            "calibration/positive_scores": _spread(score["calibration"][examples.y[calibration]]),
        },
        config={
            "recipe": {**asdict(recipe), "hyperparameters": model.config},
            "legs": {
                "training": len(learned),
                "synthetic": len(y) - len(learned),
                "validation": len(validation),
                "calibration": len(calibration),
            },
            "epochs": [_plain(epoch) for epoch in model.history] if isinstance(model, Dnn) else [],
        },
        metrics={
            "validation": summary(examples.y[validation], score["validation"]),
            "calibration": summary(examples.y[calibration], score["calibration"]),
        },
        provenance={**provenance(), "dataset": dict(dataset.metadata)},
    )


def _check_classes(y: NDArray[np.bool_], **parts: NDArray[np.intp]) -> None:
    """Raise InputError where a part, by its name, lacks a class."""
    for name, rows in parts.items():
        feasible = int(y[rows].sum())
        if feasible in (0, len(rows)):
            raise InputError(
                f"{name} part: {feasible} of {len(rows)} legs are feasible, expected both "
                "classes; generate more legs"
            )


def _domain(
    inputs: NDArray[np.float64], isp: NDArray[np.float64], thrust: NDArray[np.float64]
) -> dict[str, NDArray[np.float64]]:
    """Return the ranges seen in training; thrust and isp must be those of one engine.

    Raises
    ------
    InputError
        The legs have several engines, which the paper's features cannot tell apart.
    """
    for name, values in (("thrust", thrust), ("isp", isp)):
        if np.ptp(values) > 1e-6 * values[0]:
            raise InputError(
                f"training legs: {name} from {values.min():g} to {values.max():g}, expected one "
                f"engine: features {FEATURE_SET} do not contain it"
            )
    low, high = inputs.min(axis=0), inputs.max(axis=0)
    # The second part is for inputs that are constant but for rounding.
    margin = _DOMAIN_MARGIN * (high - low) + 1e-9 * np.abs(high)
    return {
        "domain/low": low - margin,
        "domain/high": high + margin,
        # Specific impulse matters little: a per cent of it is far less than a per cent of m*.
        "domain/isp": np.array([0.99, 1.01]) * isp[0],
        "domain/thrust": np.array([thrust[0], thrust[0]]),
    }


def _spread(scores: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the scores in rising order, evenly thinned out where there are very many."""
    ordered = np.sort(scores)
    if len(ordered) <= _MAX_SCORES:
        return ordered
    return ordered[np.linspace(0, len(ordered) - 1, _MAX_SCORES).astype(np.int64)]


def _plain(epoch: Epoch) -> dict[str, float | None]:
    """Return an epoch as JSON has it, which knows no NaN (it differs from itself)."""
    return {name: None if value != value else value for name, value in asdict(epoch).items()}
