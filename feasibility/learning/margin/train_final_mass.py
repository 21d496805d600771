"""The net for the mass at arrival: trained after the margins, on legs with minimum propellant."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.artefact import Artefact
from feasibility.classifier.margin.estimator import MarginEstimator
from feasibility.classifier.margin.features import margin_features
from feasibility.classifier.margin.final_mass import inputs_and_base, log_expected_error
from feasibility.classifier.margin.network import MarginNet
from feasibility.dataset import Dataset
from feasibility.dataset.splits import pairs_of_bodies, split_pairs
from feasibility.errors import InputError
from feasibility.learning.margin.fit import UNIT, MarginRecipe, OnEpoch, fit_net

_Array = NDArray[np.float64]

FINAL_MASS_RECIPE: Final = MarginRecipe(
    layers=3, width=128, epochs=60, batch=512, learning_rate=4e-3
)
"""A small net is enough: what it corrects is a few percent off."""

SHARES: Final = (0.85, 0.05, 0.1)
"""Shares of training, validation and calibration, split by pairs of bodies."""

_NEWTON_STEPS: Final = 40
_LARGEST_RATIO: Final = 20.0
_LARGEST_LOG: Final = 20.0
_DAMPING: Final = 0.1

_WITHIN: Final = 0.6827
"""Share of legs that the estimated error covers, as one standard deviation of a normal does."""


def train_final_mass(
    artefact: Artefact,
    datasets: Sequence[Dataset],
    recipe: MarginRecipe = FINAL_MASS_RECIPE,
    *,
    checkpoint: Path | None = None,
    on_epoch: OnEpoch = lambda _: None,
) -> Artefact:
    """Return a margin model that knows final masses too; its other nets are kept.

    Parameters
    ----------
    artefact : Artefact
        A margin model: its margins are among the inputs.
    datasets : sequence of Dataset
        Legs with minimum propellant (`propellant = true` in the protocol); of the others only
        those that are flyable play a part.
    recipe : MarginRecipe
        How to train; the quick net plays no part.
    checkpoint, on_epoch
        As for `train_margin`.

    Raises
    ------
    InputError
        Hardly a leg with minimum propellant.
    MissingDependencyError
        The extra ``train`` is not installed.
    """
    estimator = MarginEstimator(artefact)
    pairs = pairs_of_bodies(datasets)
    inputs, targets, spent, margin_errors, kept = [], [], [], [], []
    for dataset, pair in zip(datasets, pairs, strict=True):
        flown = np.flatnonzero(np.isfinite(dataset.columns["m_final_kg"]))
        legs = dataset.legs.take(flown)
        X, _ = margin_features(legs)
        log_margin, margin_error, _ = estimator.estimate(legs)
        rows = np.flatnonzero(np.isfinite(log_margin))
        legs, flown, X, log_margin = legs.take(rows), flown[rows], X[rows], log_margin[rows]
        used = np.log(legs.m0 / dataset.columns["m_final_kg"][flown]) * legs.exhaust_velocity
        some, base = inputs_and_base(legs, X, log_margin)
        inputs.append(some)
        targets.append(np.log(used / base))
        spent.append(base / legs.exhaust_velocity)
        kept.append(pair[flown])
        margin_errors.append(margin_error[rows])
    columns = (inputs, targets, spent, margin_errors)
    X, target, share, margin_error = (np.concatenate(parts) for parts in columns)
    # Some are for validation and calibration, and the rest has to fill a batch.
    if len(X) < recipe.batch / SHARES[0] + 1:
        raise InputError(
            f"final mass: {len(X)} legs with minimum propellant, expected more than a batch of "
            f"{recipe.batch}; generate them with propellant = true"
        )
    rng = np.random.default_rng([recipe.seed, 3])
    part = split_pairs(np.concatenate(kept), SHARES, rng)
    learned, validation, calibration = (np.flatnonzero(part == k) for k in range(3))
    net = fit_net(
        X, target, np.ones(len(X)), learned, validation, recipe,
        layers=recipe.layers, width=recipe.width, epochs=recipe.epochs, unit=UNIT,
        checkpoint=checkpoint, on_epoch=on_epoch,
    )  # fmt: skip
    correction, doubt = MarginNet(net)(X[calibration])
    error = np.abs(correction - target[calibration])
    fit = fit_error(error, doubt, margin_error[calibration])
    within = error < np.exp(log_expected_error(doubt, margin_error[calibration], fit))
    burnt = np.exp(-share[calibration] * np.exp([correction, target[calibration]]))
    mass_error = np.abs(burnt[0] / burnt[1] - 1.0)
    measures = {
        "legs": len(learned),
        "median_relative_error": float(np.median(mass_error)),
        "mean_relative_error": float(np.mean(mass_error)),
        "within_expected_error": float(np.mean(within)),
    }
    others = {k: v for k, v in artefact.arrays.items() if not k.startswith("final_mass/")}
    return replace(
        artefact,
        arrays={
            **others,
            **{f"final_mass/{name}": array for name, array in net.items()},
            "final_mass/error_fit": fit,
        },
        metrics={**artefact.metrics, "final_mass": measures},
    )


def fit_error(error: _Array, doubt: _Array, margin_error: _Array) -> _Array:
    """Return the coefficients of `log_expected_error` that suit n legs not learned from.

    The greatest likelihood under Laplace distributions, by Newton's method, and then a factor
    so that 68 % are within.

    Parameters
    ----------
    error : (n,) float64
        Absolute errors of log(velocity change).
    doubt, margin_error : (n,) float64
        As for `log_expected_error`.
    """
    rows = np.column_stack([np.ones(len(error)), np.log(doubt), np.log(margin_error)])
    fit = np.array([0.0, 1.0, 0.0])
    limited = np.minimum(error, _LARGEST_RATIO * doubt)
    for _ in range(_NEWTON_STEPS):
        ratio = limited * np.exp(-np.clip(rows @ fit, -_LARGEST_LOG, _LARGEST_LOG))
        slope = rows.T @ (1.0 - ratio)
        curvature = rows.T @ (rows * (ratio + _DAMPING)[:, None])
        fit = fit - np.linalg.solve(curvature + 1e-6 * len(error) * np.eye(3), slope)
    sure = np.quantile(np.log(np.maximum(error, 1e-12)) - rows @ fit, _WITHIN)
    fit[0] += sure
    return fit
