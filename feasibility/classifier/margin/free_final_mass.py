"""The mass at arrival of legs with free ends: what bounds it, and what the net sees."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.margin.final_mass import full_thrust_velocity
from feasibility.classifier.margin.free_features import FREE_FEATURES
from feasibility.legs import Legs
from feasibility.orbits.lambert import lambert_delta_v

_Array = NDArray[np.float64]

FREE_FINAL_MASS_INPUTS: Final = (
    *FREE_FEATURES,
    "inverse_margin",
    "log_margin",
    "log_lambert_to_full_thrust",
    "full_thrust_to_exhaust_velocity",
)
"""Names of the net's inputs, all without unit."""

_LARGEST: Final = 3.0
_LEAST_CHANGE: Final = 1e-3
"""m/s, so that legs that need no thrust have logarithms."""

_MAX_REVS: Final = 2


def free_lambert_velocity(legs: Legs, X: _Array) -> _Array:  # noqa: ARG001 (as for rendezvous)
    """Return (n,) m/s, Lambert's least sum of impulses beyond the excesses; inf without arcs."""
    return lambert_delta_v(
        legs.rv_dep, legs.rv_arr, legs.tof_s, _MAX_REVS,
        vinf_dep=legs.vinf_dep, vinf_arr=legs.vinf_arr,
    )  # fmt: skip


def free_mass_inputs(
    legs: Legs,
    X: _Array,
    log_margin: _Array,
    size: int,  # noqa: ARG001 (one version so far)
) -> tuple[_Array, _Array]:
    """Return the net's inputs (n, k), and (n,) m/s, the velocity change that it corrects.

    Parameters
    ----------
    legs, X, log_margin
        As for `final_mass_inputs`.
    size : int
        Inputs of the net.
    """
    margin = np.maximum(log_margin, 0.0)
    full = np.maximum(full_thrust_velocity(legs, margin), _LEAST_CHANGE)
    lambert = np.maximum(free_lambert_velocity(legs, X), _LEAST_CHANGE)
    n = X.shape[1]
    inputs = np.empty((len(legs), len(FREE_FINAL_MASS_INPUTS)))
    inputs[:, :n] = X
    inputs[:, n] = np.exp(-margin)
    inputs[:, n + 1] = np.minimum(margin, _LARGEST)
    inputs[:, n + 2] = np.clip(np.log(lambert / full), -_LARGEST, _LARGEST)
    inputs[:, n + 3] = np.minimum(full / legs.exhaust_velocity, _LARGEST)
    return inputs, full
