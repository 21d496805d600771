"""The net for the mass at arrival: trained after the margins, on legs with minimum propellant."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.artefact import Artefact
from feasibility.classifier.margin.estimator import MarginEstimator
from feasibility.classifier.margin.final_mass import log_expected_error
from feasibility.classifier.margin.network import MarginNet
from feasibility.classifier.margin.views import FREE_ENDS, RENDEZVOUS, LegView
from feasibility.dataset import Dataset
from feasibility.dataset.splits import pairs_of_bodies, split_pairs
from feasibility.errors import InputError
from feasibility.learning.margin.examples import legs_of
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

_LEAST_BURNT: Final = 1e-9
"""Share of the initial mass."""

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

    Legs from rest to rest and legs with free ends get a net each, whichever are there.

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
    for view in (RENDEZVOUS, FREE_ENDS):
        legs = legs_of(datasets, view)
        if legs:
            aside = checkpoint
            if aside is not None and view.prefix:
                aside = aside.with_name(f"{aside.name}-free")
            artefact = _train_view(artefact, view, legs, recipe, aside, on_epoch)
            if aside is not None and aside is not checkpoint:
                aside.unlink(missing_ok=True)
    return artefact


def _train_view(
    artefact: Artefact,
    view: LegView,
    datasets: Sequence[Dataset],
    recipe: MarginRecipe,
    checkpoint: Path | None,
    on_epoch: OnEpoch,
) -> Artefact:
    """Return the model with a net for the final mass of one sort of legs."""
    flown = _Flown.of(artefact, view, datasets)
    X, target = flown.X, flown.target
    # Some are for validation and calibration, and the rest has to fill a batch.
    if len(X) < recipe.batch / SHARES[0] + 1:
        raise InputError(
            f"final mass: {len(X)} legs with minimum propellant, expected more than a batch of "
            f"{recipe.batch}; generate them with propellant = true"
        )
    rng = np.random.default_rng([recipe.seed, 3])
    part = split_pairs(flown.pairs, SHARES, rng)
    learned, validation, calibration = (np.flatnonzero(part == k) for k in range(3))
    net = fit_net(
        X, target, np.ones(len(X)), learned, validation, recipe,
        layers=recipe.layers, width=recipe.width, epochs=recipe.epochs, unit=UNIT,
        checkpoint=checkpoint, on_epoch=on_epoch,
    )  # fmt: skip
    correction, doubt = MarginNet(net)(X[calibration])
    error = np.abs(correction - target[calibration])
    margin_error = flown.margin_error[calibration]
    fit = fit_error(error, doubt, margin_error)
    within = error < np.exp(log_expected_error(doubt, margin_error, fit))
    burnt = np.exp(-flown.share[calibration] * np.exp([correction, target[calibration]]))
    mass_error = np.abs(burnt[0] / burnt[1] - 1.0)
    measures = {
        "legs": len(learned),
        "median_relative_error": float(np.median(mass_error)),
        "mean_relative_error": float(np.mean(mass_error)),
        "within_expected_error": float(np.mean(within)),
    }
    section = view.section("final_mass")
    others = {k: v for k, v in artefact.arrays.items() if not k.startswith(f"{section}/")}
    metrics = {**artefact.metrics, "final_mass": measures}
    if view.prefix:
        free = {**artefact.metrics.get("free_ends", {}), "final_mass": measures}
        metrics = {**artefact.metrics, "free_ends": free}
    return replace(
        artefact,
        arrays={
            **others,
            **{f"{section}/{name}": array for name, array in net.items()},
            f"{section}/error_fit": fit,
        },
        metrics=metrics,
    )


@final
@dataclass(frozen=True, eq=False)
class _Flown:
    """Legs with minimum propellant as the net sees them; n of them.

    Attributes
    ----------
    X : (n, k) float64
        Inputs.
    target : (n,) float64
        log(velocity change / what the net corrects).
    share : (n,) float64
        What the net corrects over the exhaust velocity.
    margin_error : (n,) float64
        Expected error of the estimated log(m*/m0).
    pairs : (n,) int64
        Number of the pair of bodies.
    """

    X: _Array
    target: _Array
    share: _Array
    margin_error: _Array
    pairs: NDArray[np.int64]

    @classmethod
    def of(cls, artefact: Artefact, view: LegView, datasets: Sequence[Dataset]) -> "_Flown":
        """Ask the model about the legs that were flown.

        Raises
        ------
        InputError
            The model has no nets for such legs.
        """
        estimator = MarginEstimator(artefact)
        if view.prefix and not estimator.knows_free_ends:
            raise InputError(
                "final mass: the model to start from has no nets for free ends, but legs have "
                "them; expected one made with --model free-margin or margin"
            )
        parts: list[tuple[NDArray[Any], ...]] = []
        for dataset, pairs in zip(datasets, pairs_of_bodies(datasets), strict=True):
            # Where nothing is burnt there is nothing to learn.
            m_final = dataset.columns["m_final_kg"]
            flown = np.flatnonzero(m_final < (1.0 - _LEAST_BURNT) * dataset.columns["m0_kg"])
            legs = dataset.legs.take(flown)
            X, _, more = view.features_and_more(legs)
            log_margin, margin_error, _ = estimator.estimate(legs)
            rows = np.flatnonzero(np.isfinite(log_margin))
            legs, flown, X, log_margin = legs.take(rows), flown[rows], X[rows], log_margin[rows]
            used = np.log(legs.m0 / m_final[flown]) * legs.exhaust_velocity
            inputs, base = view.mass_inputs(legs, X, more[rows], log_margin, view.mass_sizes[-1])
            share = base / legs.exhaust_velocity
            parts.append((inputs, np.log(used / base), share, margin_error[rows], pairs[flown]))
        return cls(*(np.concatenate(column) for column in zip(*parts, strict=True)))


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
