"""Features of the margin model: names, and their computation for a batch of legs."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from feasibility.constants import MU_SUN
from feasibility.legs import Legs

_Array = NDArray[np.float64]

FEATURE_SET: Final = "margin-2"
"""Name of this set of features in trained models."""

_GEOMETRY: Final = (
    "log_tof",
    "log_exhaust_velocity",
    "log_motion_ratio",
    "ex_dep",
    "ey_dep",
    "ex_arr",
    "ey_arr",
    "h_arr",
    "k_arr",
    "phase",
    "phase_rate",
    "sin_longitude_arr",
    "cos_longitude_arr",
    "turns",
    *(f"coasted_{kind}_{axis}" for kind in ("dr", "dv") for axis in "rtn"),
)
_NEED: Final = (
    *(f"need_{kind}_{axis}" for kind in ("dr", "dv") for axis in "rtn"),
    "log_impulse",
    "impulse_ratio",
    *(f"cost_share_{element}" for element in ("n", "ex", "ey", "h", "k", "l")),
)
_LAMBERT: Final = tuple(
    f"{name}_{revs}_rev" for revs in range(3) for name in ("log_mima", "log_lambert_dv")
)

QUICK_FEATURES: Final = (*_GEOMETRY, *_NEED, *_LAMBERT)
"""Names of the features that cost little, all without unit."""

FEATURES: Final = (
    *_GEOMETRY,
    *_NEED,
    "chosen_phase_rate",
    "chosen_turns",
    "chosen_beside_nearest",
    *(f"log_round_{k}" for k in range(3)),
    *(f"log_second_round_{k}" for k in range(4)),
    *(f"log_first_{beside}" for beside in ("nearest", "plus_1", "minus_1", "plus_2", "minus_2")),
    *_LAMBERT,
    *(f"log_lambert_path_{revs}_rev" for revs in range(3)),
    "least_dual",
    "log_largest_impulse",
    *(f"thrust_{node}_{axis}" for node in (0, 5, 10, 14, 19) for axis in ("r", "t", "n", "size")),
)
"""Names of all features, all without unit; docs/guide/classifier.md has the formulas."""

DOMAIN_QUANTITIES: Final = (
    "log_tof",
    "log_exhaust_velocity",
    "log_motion_ratio",
    "e_dep",
    "e_arr",
    "tan_half_inclination",
    "turns",
    "log_impulse",
)
"""What the domain of a model is a range of; see `domain_quantities`."""


def margin_features(legs: Legs) -> tuple[_Array, _Array]:
    """Return the features and the physical hint of each leg.

    Parameters
    ----------
    legs : Legs
        n legs; their masses and thrust play no part.

    Returns
    -------
    X : (n, 80) float64
        `FEATURES`; NaN where an orbit is no ellipse or no hint exists.
    hint : (n,) float64
        Estimate of `log_acceleration` at the maximum initial mass; NaN also for legs with free
        ends.
    """
    from feasibility.classifier.margin import feature_kernels

    X = np.empty((len(legs), feature_kernels.N_FEATURES))
    hint = np.empty(len(legs))
    feature_kernels.feature_batch(*_arguments(legs), X, hint)
    return X, _of_rendezvous(legs, hint)


def quick_features(legs: Legs) -> tuple[_Array, _Array]:
    """Return `QUICK_FEATURES` (n, 40) and a rough hint (n,); otherwise as `margin_features`."""
    from feasibility.classifier.margin.lanes import rendezvous_kernels

    X = np.empty((len(legs), len(QUICK_FEATURES)))
    hint = np.empty(len(legs))
    rendezvous_kernels.quick_lane_batch(*_arguments(legs), X, hint)
    return X, _of_rendezvous(legs, hint)


def _of_rendezvous(legs: Legs, hint: _Array) -> _Array:
    """Return the hints, NaN for legs with free ends: the features know nothing of these."""
    free = legs.free_ends
    return np.where(free, np.nan, hint) if free.any() else hint


def log_acceleration(legs: Legs, mass: _Array) -> _Array:
    """Return log(thrust / mass), (n,), with the unit mu / a^2 of the departure orbit.

    Parameters
    ----------
    legs : Legs
        n legs.
    mass : (n,) float64, kg

    Returns
    -------
    (n,) float64
        NaN where the departure orbit is no ellipse.
    """
    states = legs.rv_dep
    radius = np.sqrt(np.einsum("ij,ij->i", states[:, :3], states[:, :3]))
    inverse = 2.0 / radius - np.einsum("ij,ij->i", states[:, 3:], states[:, 3:]) / MU_SUN
    inverse[inverse <= 0.0] = np.nan
    acceleration: _Array = np.log(legs.thrust / mass / (MU_SUN * inverse * inverse))
    return acceleration


def domain_quantities(X: _Array) -> _Array:
    """Return `DOMAIN_QUANTITIES` (n, 8) of features (n, k): of all or of the quick ones."""
    column = {name: X[:, i] for i, name in enumerate(QUICK_FEATURES[: len(_GEOMETRY)])}
    return np.stack(
        [
            column["log_tof"],
            column["log_exhaust_velocity"],
            column["log_motion_ratio"],
            _length(column["ex_dep"], column["ey_dep"]),
            _length(column["ex_arr"], column["ey_arr"]),
            _length(column["h_arr"], column["k_arr"]),
            column["turns"],
            X[:, QUICK_FEATURES.index("log_impulse")],
        ]
    ).T


def _length(x: _Array, y: _Array) -> _Array:
    # Three times as fast as np.hypot, which guards against overflow.
    length: _Array = np.sqrt(x * x + y * y)
    return length


def _arguments(legs: Legs) -> tuple[_Array, _Array, _Array, _Array, float]:
    # Copies are writable, as the one compiled signature wants them.
    return legs.rv_dep.copy(), legs.rv_arr.copy(), legs.tof_s, legs.exhaust_velocity, MU_SUN
