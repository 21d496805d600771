"""`tuned`: a recipe whose hyperparameters were found by Bayesian optimisation."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from feasibility.dataset import Dataset
from feasibility.errors import InputError
from feasibility.learning.paper.models import make_model
from feasibility.learning.paper.train import Recipe, prepare
from feasibility.learning.paper.tune import SPACES, Task, Trial, tune


def tuned(
    dataset: Dataset,
    recipe: Recipe,
    storage: Path | str,
    *,
    n_trials: int,
    on_trial: Callable[[Trial], None] | None = None,
) -> Recipe:
    """Return a recipe with the hyperparameters that are best on the validation part.

    Parameters
    ----------
    dataset : Dataset
        Labelled legs.
    recipe : Recipe
        How to train; hyperparameters that it gives are not varied.
    storage : Path or str
        Where trials are kept; see `feasibility.learning.paper.tune.tune`.
    n_trials : int
        Trials in all, with those already there.
    on_trial : callable, optional
        Called with each trial that this process ends.

    Raises
    ------
    InputError
        A model without a space of hyperparameters, a dataset or a storage that cannot be used.
    MissingDependencyError
        The extra ``train`` is not installed.
    """
    if recipe.model not in SPACES:
        raise InputError(f"--tune: is for {', '.join(SPACES)}, not for {recipe.model}")
    # What is wrong with them is said before an hour is spent.
    make_model(recipe.model, **recipe.hyperparameters)
    parts = prepare(dataset, recipe)
    task = Task(
        model=recipe.model,
        X=parts.X,
        y=parts.y,
        X_val=parts.scaler.transform(parts.inputs[parts.validation]),
        y_val=parts.examples.y[parts.validation],
        fixed=recipe.hyperparameters,
        seed=recipe.seed,
    )
    tuning = tune(task, storage, n_trials=n_trials, on_trial=on_trial)
    return replace(recipe, hyperparameters=tuning.best.hyperparameters)
