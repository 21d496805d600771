"""The margin model as one more model of the study: the same legs, their m* in place of a class."""

import time
from dataclasses import asdict
from typing import Final

import numpy as np

from feasibility.classifier.classifier import FeasibilityClassifier
from feasibility.classifier.margin.features import FEATURE_SET
from feasibility.learning.margin.train import SHARES, MarginRecipe, train_margin
from feasibility.study.context import Context
from feasibility.study.fit import Outcome, judge

MARGIN: Final = "margin"
"""Name of the model among the keys of `figures.NAMES`; it is none of the paper's."""

_LEAST_BATCH, _LARGEST_BATCH = 32, 1024
_BATCHES_OF_AN_EPOCH: Final = 16
_STEPS: Final = 8000
_FEWEST_EPOCHS, _MOST_EPOCHS = 12, 60
_SETTINGS: Final = (
    "layers",
    "width",
    "epochs",
    "batch",
    "learning_rate",
    "patience",
    "seed",
)
"""What a cell depends on, and not where it is computed."""


def margin_recipe(context: Context, legs: int, seed: int) -> MarginRecipe:
    """Return how the margin model is trained on a number of legs: the default model's net.

    Large training sets get 8000 steps, small ones 60 epochs; there are at least 12 epochs.
    """
    learned = SHARES[0] * legs
    batch = int(np.clip(learned // _BATCHES_OF_AN_EPOCH, _LEAST_BATCH, _LARGEST_BATCH))
    epochs = int(np.clip(_STEPS * batch // learned, _FEWEST_EPOCHS, _MOST_EPOCHS))
    return MarginRecipe(
        epochs=epochs,
        batch=batch,
        seed=seed,
        device=context.device,
        threads=context.threads,
    )


def run_margin(context: Context, samples: int, seed: int) -> Outcome:
    """Return the outcome of a margin model, from its cell if it was trained before.

    Parameters
    ----------
    context : Context
        The study.
    samples : int
        Training legs, balanced and drawn as for the other models; its validation and calibration
        parts are among them. Cut to what the data can give.
    seed : int
        Seed of the draw and of the training.
    """
    per_class = min(samples // 2, context.data.smaller_class)
    recipe = margin_recipe(context, 2 * per_class, seed)
    settings = {name: getattr(recipe, name) for name in _SETTINGS}
    key = context.cell_key(kind=MARGIN, legs=per_class, recipe=settings, features=FEATURE_SET)
    value = context.cells.get(
        f"{MARGIN}-{per_class}+{per_class}-seed{seed}",
        key,
        lambda: asdict(_compute(context, per_class, recipe)),
    )
    return Outcome(**value)


def _compute(context: Context, per_class: int, recipe: MarginRecipe) -> Outcome:
    data = context.data
    # In the order of the dataset: the rows of a draw come by class.
    rows = np.sort(data.draw(per_class, per_class, recipe.seed))
    began = time.perf_counter()
    classifier = FeasibilityClassifier(train_margin([data.dataset.take(rows)], recipe))
    fitted = time.perf_counter()
    probability = classifier.feasible_probability(data.legs.take(data.test))
    predicted = time.perf_counter()
    return judge(
        data.y[data.test],
        probability,
        data.log_margin[data.test],
        legs=len(rows),
        synthetic=0,
        fit_seconds=fitted - began,
        predict_seconds=predicted - fitted,
        epochs=[],
    )
