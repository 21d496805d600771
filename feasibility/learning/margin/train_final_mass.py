"""The net for the mass at arrival: trained after the margins, on legs with minimum propellant."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from feasibility.classifier.artefact import Artefact
from feasibility.classifier.margin.estimator import MarginEstimator
from feasibility.classifier.margin.features import margin_features
from feasibility.classifier.margin.final_mass import (
    FINAL_MASS_INPUTS,
    final_mass_inputs,
    full_thrust_velocity,
)
from feasibility.classifier.margin.network import MarginNet
from feasibility.dataset import Dataset
from feasibility.dataset.splits import pairs_of_bodies, split_pairs
from feasibility.errors import InputError
from feasibility.learning.margin.fit import UNIT, MarginRecipe, OnEpoch, fit_net

FINAL_MASS_RECIPE: Final = MarginRecipe(layers=3, width=96, epochs=40, batch=256)
"""A small net is enough: 35 000 legs give the final mass to a seventh of a percent."""

SHARES: Final = (0.9, 0.1)
"""Shares of training and validation, split by pairs of bodies."""


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
    inputs, targets, kept = [], [], []
    for dataset, pair in zip(datasets, pairs, strict=True):
        flown = np.flatnonzero(np.isfinite(dataset.columns["m_final_kg"]))
        legs = dataset.legs.take(flown)
        X, _ = margin_features(legs)
        log_margin = estimator.estimate(legs)[0]
        rows = np.flatnonzero(np.isfinite(log_margin))
        legs, flown, X, log_margin = legs.take(rows), flown[rows], X[rows], log_margin[rows]
        used = np.log(legs.m0 / dataset.columns["m_final_kg"][flown]) * legs.exhaust_velocity
        inputs.append(final_mass_inputs(legs, X, log_margin))
        targets.append(np.log(used / full_thrust_velocity(legs, np.maximum(log_margin, 0.0))))
        kept.append(pair[flown])
    X, target = np.concatenate(inputs), np.concatenate(targets)
    # A tenth is for validation, and the rest has to fill a batch.
    if len(X) < recipe.batch / SHARES[0] + 1:
        raise InputError(
            f"final mass: {len(X)} legs with minimum propellant, expected more than a batch of "
            f"{recipe.batch}; generate them with propellant = true"
        )
    rng = np.random.default_rng([recipe.seed, 3])
    part = split_pairs(np.concatenate(kept), SHARES, rng)
    learned, validation = np.flatnonzero(part == 0), np.flatnonzero(part == 1)
    net = fit_net(
        X, target, np.ones(len(X)), learned, validation, recipe,
        layers=recipe.layers, width=recipe.width, epochs=recipe.epochs, unit=UNIT,
        checkpoint=checkpoint, on_epoch=on_epoch,
    )  # fmt: skip
    error = MarginNet(net)(X[validation])[0] - target[validation]
    share = X[validation, FINAL_MASS_INPUTS.index("full_thrust_to_exhaust_velocity")]
    mass_error = np.abs(error) * share * np.exp(target[validation])
    measures = {
        "legs": len(learned),
        "median_relative_error": float(np.median(mass_error)),
        "mean_relative_error": float(np.mean(mass_error)),
    }
    others = {k: v for k, v in artefact.arrays.items() if not k.startswith("final_mass/")}
    return replace(
        artefact,
        arrays={**others, **{f"final_mass/{name}": array for name, array in net.items()}},
        metrics={**artefact.metrics, "final_mass": measures},
    )
