"""The mass at arrival of legs with free ends: what the net for it sees.

With the excess velocities of the hint for m*, such a leg is one from rest to rest between moved
ends. The inputs are those of that leg (`final_mass`), and what the features say of the excess. A
lighter spacecraft may do better with other excess velocities; that is left to the net.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.margin.features import FEATURES
from feasibility.classifier.margin.final_mass import (
    FINAL_MASS_INPUTS,
    inputs_and_base,
    lambert_velocity,
)
from feasibility.classifier.margin.free_features import FREE_FEATURES, excess_velocities
from feasibility.legs import Legs
from feasibility.orbits.lambert import lambert_delta_v

_Array = NDArray[np.float64]

_MAX_REVS: Final = 2
_LARGEST: Final = 3.0
_LEAST_CHANGE: Final = 1e-3
"""m/s, so that legs that need no thrust have logarithms."""

FREE_FINAL_MASS_INPUTS: Final = (
    *FINAL_MASS_INPUTS,
    *FREE_FEATURES[len(FEATURES) :],
    "log_lambert_left_to_base",
)
"""Names of the net's inputs, all without unit."""


def free_lambert_velocity(legs: Legs, X: _Array) -> _Array:
    """Return (n,) m/s, Lambert's least sum of impulses beyond the excesses, up to 2 revolutions.

    Parameters
    ----------
    legs : Legs
        n legs with free ends.
    X : (n, k) float64
        `FREE_FEATURES`; where there is no arc, those between the moved ends count.
    """
    left = lambert_delta_v(
        *(legs.rv_dep, legs.rv_arr, legs.tof_s, _MAX_REVS),
        vinf_dep=legs.vinf_dep,
        vinf_arr=legs.vinf_arr,
    )
    return np.where(np.isfinite(left), left, lambert_velocity(legs, X))


def free_mass_inputs(
    legs: Legs,
    X: _Array,
    log_margin: _Array,
    size: int,  # noqa: ARG001 (there is one version so far)
) -> tuple[_Array, _Array]:
    """Return the net's inputs (n, k), and (n,) m/s, the velocity change that it corrects.

    Parameters
    ----------
    legs : Legs
        n legs with free ends.
    X : (n, k) float64
        `FREE_FEATURES`.
    log_margin : (n,) float64
        Estimate of log(m*/m0); below 0 counts as 0.
    size : int
        Inputs of the net.
    """
    n = len(FEATURES)
    more = FREE_FEATURES[n:]
    inputs = np.empty((len(legs), len(FREE_FINAL_MASS_INPUTS)))
    inputs[:, : len(FINAL_MASS_INPUTS)], base = inputs_and_base(
        _moved(legs), np.ascontiguousarray(X[:, :n]), log_margin
    )
    base = np.maximum(base, _LEAST_CHANGE)
    inputs[:, len(FINAL_MASS_INPUTS) : -1] = X[:, n : n + len(more)]
    left = np.maximum(free_lambert_velocity(legs, X), _LEAST_CHANGE)
    inputs[:, -1] = np.clip(np.log(left / base), -_LARGEST, _LARGEST)
    return inputs, base


def _moved(legs: Legs) -> Legs:
    """Return the legs from rest to rest between the ends that the excess velocities lead to."""
    excess = np.nan_to_num(excess_velocities(legs))
    rv_dep, rv_arr = legs.rv_dep.copy(), legs.rv_arr.copy()
    rv_dep[:, 3:] += excess[:, :3]
    rv_arr[:, 3:] += excess[:, 3:]
    columns = (legs.tof_days, legs.m0, legs.thrust, legs.isp, legs.m_dry)
    return Legs(rv_dep, rv_arr, *columns)
