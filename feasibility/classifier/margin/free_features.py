"""Features of legs with free ends: names, and their computation for a batch of legs."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.margin.features import (
    DOMAIN_QUANTITIES,
    FEATURES,
    QUICK_FEATURES,
    domain_quantities,
)
from feasibility.constants import MU_SUN
from feasibility.legs import Legs

_Array = NDArray[np.float64]

FREE_FEATURE_SET: Final = "free-1"
"""Name of this set of features in trained models."""

_ENDS: Final = tuple(
    f"{name}_{end}"
    for end in ("dep", "arr")
    for name in (
        "bound",
        "bound_to_need",
        "open",
        "excess_to_bound",
        "excess_to_need",
        *(f"excess_{axis}" for axis in "rtn"),
    )
)
_DUALS: Final = tuple(
    f"{name}_{end}" for end in ("dep", "arr") for name in ("dual", "excess_share", "cosine")
)
_KINDS: Final = ("lambert", "body", "cut")

FREE_QUICK_FEATURES: Final = (
    *QUICK_FEATURES[:34],
    *_ENDS,
    "linear_excess_dep",
    "linear_excess_arr",
    "log_first_round",
    "log_lambert_left",
    "log_mima_left",
)
"""Names of the features that cost little, all without unit; the leg's own 34 come first."""

FREE_FEATURES: Final = (
    *FEATURES,
    *_ENDS,
    *_DUALS,
    *(f"log_free_round_{k}" for k in range(7)),
    *(f"log_free_{kind}" for kind in _KINDS),
    *(f"log_lambert_left_{revs}_rev" for revs in range(3)),
    "log_free_second",
    "from_lambert",
    "moved_known",
)
"""Names of all features, all without unit. `FEATURES` are those between the moved ends."""

FREE_DOMAIN_QUANTITIES: Final = (*DOMAIN_QUANTITIES, "bound_dep", "bound_arr")
"""What the domain of a model is a range of; see `free_domain_quantities`."""


def free_features(legs: Legs) -> tuple[_Array, _Array]:
    """Return the features and the physical hint of legs with free ends.

    Parameters
    ----------
    legs : Legs
        n legs; their masses and thrust play no part.

    Returns
    -------
    X : (n, k) float64
        `FREE_FEATURES`; NaN where an orbit is no ellipse or no hint exists.
    hint : (n,) float64
        Estimate of `log_free_acceleration` at the maximum initial mass, and exactly
        `log_no_thrust` for legs that need no thrust, whose maximum initial mass is inf. NaN where
        `X` is.
    """
    X, hint, _ = features_and_excess(legs)
    return X, hint


def features_and_excess(legs: Legs) -> tuple[_Array, _Array, _Array]:
    """Return `free_features`, and (n, 6) m/s, the excess velocities that the hint is for.

    Those at departure come first. NaN where no path was found.
    """
    from feasibility.classifier.margin import free_feature_kernels

    X = np.empty((len(legs), free_feature_kernels.N_FREE))
    hint, excess = np.empty(len(legs)), np.empty((len(legs), 6))
    free_feature_kernels.free_feature_batch(*_arguments(legs), X, hint, excess)
    return X, hint, excess


def quick_free_features(legs: Legs) -> tuple[_Array, _Array]:
    """Return `FREE_QUICK_FEATURES` (n, k) and a rough hint (n,); otherwise as `free_features`."""
    from feasibility.classifier.margin.lanes import free_kernels

    X = np.empty((len(legs), len(FREE_QUICK_FEATURES)))
    hint = np.empty(len(legs))
    free_kernels.free_quick_lane_batch(*_arguments(legs), X, hint)
    return X, hint


def log_no_thrust() -> float:
    """Return the hint of legs that need no thrust: they count as needing 1e-9 m/s2."""
    from feasibility.classifier.margin.free_feature_kernels import LEAST_ACCELERATION

    return float(np.log(LEAST_ACCELERATION))


def log_free_acceleration(legs: Legs, mass: _Array) -> _Array:
    """Return log(thrust / mass), (n,), of accelerations in m/s2.

    Parameters
    ----------
    legs : Legs
        n legs.
    mass : (n,) float64, kg
    """
    acceleration: _Array = np.log(legs.thrust / mass)
    return acceleration


def free_domain_quantities(X: _Array) -> _Array:
    """Return `FREE_DOMAIN_QUANTITIES` (n, 10) of features (n, k): of all or of the quick ones."""
    names = FREE_FEATURES if X.shape[1] == len(FREE_FEATURES) else FREE_QUICK_FEATURES
    bounds = X[:, [names.index("bound_dep"), names.index("bound_arr")]]
    return np.vstack([domain_quantities(X).T, bounds.T]).T


def _arguments(legs: Legs) -> tuple[_Array, _Array, _Array, _Array, _Array, float]:
    # Copies are writable, as the one compiled signature wants them.
    return (
        legs.rv_dep.copy(),
        legs.rv_arr.copy(),
        legs.tof_s,
        legs.exhaust_velocity,
        np.column_stack([legs.vinf_dep, legs.vinf_arr]),
        MU_SUN,
    )
