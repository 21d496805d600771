"""Models by name, and the paper's optimised networks (its Table 5)."""

import importlib
from collections.abc import Mapping
from typing import Any, Final

from feasibility.errors import InputError
from feasibility.learning.paper.models.base import Model

_HOMES: Final = {
    "dnn": ("feasibility.learning.paper.models.dnn", "Dnn"),
    "ensemble": ("feasibility.learning.paper.models.ensemble", "Ensemble"),
    "knn": ("feasibility.learning.paper.models.knn", "Knn"),
    "svm": ("feasibility.learning.paper.models.svm", "Svm"),
    "tree": ("feasibility.learning.paper.models.tree", "Tree"),
}

KINDS: Final = tuple(_HOMES)
"""Names of the five kinds of model."""

DNN1: Final[Mapping[str, Any]] = {
    "layers": 9,
    "width": 440,
    "activation": "leaky_relu",
    "beta1": 0.9041,
    "beta2": 0.9540,
    "batch": 500,
    "learning_rate": 0.0031,
    "drop_period": 6,
    "drop_factor": 0.1720,
}
"""DNN1 of Table 5, for the best 60 features."""

DNN2: Final[Mapping[str, Any]] = {
    "layers": 6,
    "width": 266,
    "activation": "leaky_relu",
    "beta1": 0.9230,
    "beta2": 0.9711,
    "batch": 123,
    "learning_rate": 0.0031,
    "drop_period": 8,
    "drop_factor": 0.3284,
}
"""DNN2 of Table 5, for all 103 features."""

PRESETS: Final[Mapping[str, tuple[Mapping[str, Any], int]]] = {
    "dnn1": (DNN1, 60),
    "dnn2": (DNN2, 103),
}
"""Hyperparameters and number of features, by the name that ``--preset`` knows."""


def make_model(name: str, **hyperparameters: Any) -> Model:
    """Return an unfitted model.

    Parameters
    ----------
    name : str
        One of `KINDS`, or of `PRESETS` for a network with its hyperparameters.
    **hyperparameters
        Fields of the model's configuration class; those not given have its defaults.

    Raises
    ------
    InputError
        Unknown name or hyperparameter, or a value that cannot be used.
    """
    if name in PRESETS:
        return make_model("dnn", **{**PRESETS[name][0], **hyperparameters})
    if name not in _HOMES:
        known = ", ".join([*KINDS, *PRESETS])
        raise InputError(f"model {name!r}: unknown, expected one of {known}")
    home, cls = _HOMES[name]
    try:
        model: Model = getattr(importlib.import_module(home), cls)(**hyperparameters)
    except TypeError as error:
        # Python's own words, less the name of the class: "got an unexpected keyword argument ...".
        raise InputError(f"model {name!r}: {str(error).partition('() ')[2] or error}") from None
    return model
