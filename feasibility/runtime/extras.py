"""Packages of the extra ``train``, imported where they are used."""

import importlib
from typing import Any, Final

from feasibility.errors import MissingDependencyError

_DISTRIBUTIONS: Final = {
    "torch": "torch",
    "sklearn": "scikit-learn",
    "imblearn": "imbalanced-learn",
    "optuna": "optuna",
    "threadpoolctl": "threadpoolctl",
}


def load_extra(module: str) -> Any:
    """Import a module of the extra ``train``.

    Parameters
    ----------
    module : str
        Full name, such as ``"sklearn.tree"``.

    Raises
    ------
    MissingDependencyError
        The package is not installed.
    """
    package = module.partition(".")[0]
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        raise MissingDependencyError(
            f"{_DISTRIBUTIONS[package]} is not installed, and training needs it; install the "
            "extra with: pip install 'seqsearch[train]'"
        ) from error
