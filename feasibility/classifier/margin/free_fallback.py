"""A rough hint where the paths of legs with free ends lead nowhere.

About one leg in a hundred needs so much thrust, or such excess velocities, that no path stays
among ellipses. Lambert's arcs say enough of these: nearly all of them are far beyond any engine.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.margin.free_features import (
    FREE_FEATURES,
    features_and_excess,
    log_no_thrust,
)
from feasibility.constants import MU_SUN
from feasibility.legs import Legs
from feasibility.orbits.lambert import lambert_delta_v

_Array = NDArray[np.float64]

_UNLIKE_OTHERS: Final = 3.0
"""Value by which a net tells such legs: that of the first round of a path that leads nowhere."""


def known_features(legs: Legs) -> tuple[_Array, _Array]:
    """Return `free_features` (n, k), and hints (n,), rough ones where there are no others."""
    X, hint, _ = known_features_and_excess(legs)
    return X, hint


def known_features_and_excess(legs: Legs) -> tuple[_Array, _Array, _Array]:
    """Return the same, and (n, 6) m/s, the excess velocities of the hint; 0 of rough ones."""
    X, hint, excess = features_and_excess(legs)
    rows = np.flatnonzero(np.isnan(hint))
    if len(rows):
        X[rows], hint[rows] = _by_lambert(legs.take(rows))
        excess[rows] = 0.0
    return X, hint, excess


def _by_lambert(legs: Legs) -> tuple[_Array, _Array]:
    """Return features (n, k) and hints (n,) from what the bounds leave of Lambert's impulses.

    NaN where there is no arc, and from or to unbound orbits.
    """
    left = lambert_delta_v(
        *(legs.rv_dep, legs.rv_arr, legs.tof_s),
        vinf_dep=legs.vinf_dep,
        vinf_arr=legs.vinf_arr,
    )
    r_dep, a_dep = _radius_and_axis(legs.rv_dep)
    r_arr, a_arr = _radius_and_axis(legs.rv_arr)
    known = np.isfinite(left) & (a_dep > 0.0) & ((a_arr > 0.0) | np.isinf(legs.vinf_arr))
    rows = np.flatnonzero(known)
    speed = np.sqrt(MU_SUN / r_dep[rows])
    cosine = np.einsum("ij,ij->i", legs.rv_dep[:, :3], legs.rv_arr[:, :3]) / (r_dep * r_arr)
    X = np.full((len(legs), len(FREE_FEATURES)), np.nan)
    X[rows] = 0.0
    values = {
        "log_tof": np.log(legs.tof_s[rows] * speed / r_dep[rows]),
        "log_exhaust_velocity": np.log(legs.exhaust_velocity[rows] / speed),
        "log_motion_ratio": -1.5 * np.log(r_arr[rows] / r_dep[rows]),
        "cos_longitude_arr": cosine[rows],
        "log_impulse": np.log(np.maximum(left[rows] / speed, 1e-4)),
        "log_round_0": np.full(len(rows), _UNLIKE_OTHERS),
    }
    for end, bound in (("dep", legs.vinf_dep[rows]), ("arr", legs.vinf_arr[rows])):
        open_end = np.isinf(bound)
        share = np.where(open_end, 0.0, bound) / speed
        values[f"bound_{end}"] = np.where(open_end, 1.0, share / (1.0 + share))
        values[f"open_{end}"] = open_end.astype(np.float64)
    for name, value in values.items():
        X[rows, FREE_FEATURES.index(name)] = value
    hint = np.full(len(legs), np.nan)
    least = np.exp(log_no_thrust())
    hint[rows] = np.log(np.maximum(left[rows] / legs.tof_s[rows], least))
    return X, hint


def _radius_and_axis(states: _Array) -> tuple[_Array, _Array]:
    """Return distances and semi-major axes (n,), m; the latter negative of unbound orbits."""
    radius = np.sqrt(np.einsum("ij,ij->i", states[:, :3], states[:, :3]))
    speed2 = np.einsum("ij,ij->i", states[:, 3:], states[:, 3:])
    return radius, 1.0 / (2.0 / radius - speed2 / MU_SUN)
