"""Feasibility of low-thrust legs: the leg model, its solvers and the pruners.

The names below are the public face; they are loaded on first use, so that
``import feasibility`` stays cheap.
"""

import importlib
from typing import TYPE_CHECKING

from feasibility.errors import InputError, MissingDependencyError
from feasibility.legs import Legs, Spacecraft

if TYPE_CHECKING:
    from feasibility.classifier.check import check_predictor
    from feasibility.classifier.classifier import FeasibilityClassifier
    from feasibility.pruners import (
        AllOf,
        ClassifierPruner,
        KeepAll,
        LambertPruner,
        Mima2Pruner,
        MimaPruner,
        Pruner,
        check_pruner,
    )
    from feasibility.sims_flanagan import LegSolutions, impulses, max_initial_mass, optimise

__version__ = "0.1.0"

_HOMES = {
    "AllOf": "feasibility.pruners",
    "ClassifierPruner": "feasibility.pruners",
    "FeasibilityClassifier": "feasibility.classifier.classifier",
    "KeepAll": "feasibility.pruners",
    "LambertPruner": "feasibility.pruners",
    "Mima2Pruner": "feasibility.pruners",
    "MimaPruner": "feasibility.pruners",
    "Pruner": "feasibility.pruners",
    "check_predictor": "feasibility.classifier.check",
    "check_pruner": "feasibility.pruners",
    "LegSolutions": "feasibility.sims_flanagan",
    "impulses": "feasibility.sims_flanagan",
    "max_initial_mass": "feasibility.sims_flanagan",
    "optimise": "feasibility.sims_flanagan",
}

__all__ = [
    "AllOf",
    "ClassifierPruner",
    "FeasibilityClassifier",
    "InputError",
    "KeepAll",
    "LambertPruner",
    "LegSolutions",
    "Legs",
    "Mima2Pruner",
    "MimaPruner",
    "MissingDependencyError",
    "Pruner",
    "Spacecraft",
    "check_predictor",
    "check_pruner",
    "impulses",
    "max_initial_mass",
    "optimise",
]


def __getattr__(name: str) -> object:
    if name in _HOMES:
        return getattr(importlib.import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'feasibility' has no attribute {name!r}")


def __dir__() -> list[str]:
    """Also name what is not loaded yet, for completion in a console."""
    return sorted({*globals(), *__all__})
