"""What the domain of the nets for free ends is a range of."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.margin.free_features import FREE_FEATURES, FREE_QUICK_FEATURES

_Array = NDArray[np.float64]

_PLAIN: Final = (
    "log_tof",
    "log_exhaust_velocity",
    "log_motion_ratio",
    "turns",
    "excess_dep",
    "excess_arr",
)
_LENGTHS: Final = (("ex_dep", "ey_dep"), ("ex_arr", "ey_arr"), ("h_arr", "k_arr"))

FREE_DOMAIN_QUANTITIES: Final = (*_PLAIN, "e_dep", "e_arr", "tan_half_inclination")
"""What the domain is a range of; see `free_domain_quantities`."""


def free_domain_quantities(X: _Array) -> _Array:
    """Return `FREE_DOMAIN_QUANTITIES` (n, 9) of features (n, k): all or the quick ones."""
    names = FREE_FEATURES if X.shape[1] == len(FREE_FEATURES) else FREE_QUICK_FEATURES
    column = {name: X[:, i] for i, name in enumerate(names)}
    lengths = [np.sqrt(column[x] ** 2 + column[y] ** 2) for x, y in _LENGTHS]
    return np.column_stack([*(column[name] for name in _PLAIN), *lengths])
