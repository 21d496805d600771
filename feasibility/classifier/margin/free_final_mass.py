"""The mass at arrival of legs with free ends: a hint of the least propellant, for a net.

`final_mass` has the same for a rendezvous. Here the excess velocities are chosen anew, as the best
ones depend on the initial mass (`free_propellant_kernels`).
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.margin.features import FEATURES
from feasibility.classifier.margin.final_mass import full_thrust_velocity
from feasibility.classifier.margin.free_features import FREE_FEATURES
from feasibility.classifier.margin.path_kernels import N_NODES
from feasibility.constants import MU_SUN
from feasibility.legs import Legs

_Array = NDArray[np.float64]

FREE_FINAL_MASS_INPUTS: Final = (
    *FREE_FEATURES,
    "inverse_margin",
    "log_margin",
    "log_lambert_to_full_thrust",
    "full_thrust_to_exhaust_velocity",
    *(f"log_hint_{which}" for which in ("first", "before_last_two", "before_last", "last")),
    "log_hint_dual",
    "full_thrust_share",
    *(f"impulse_share_{group}" for group in range(5)),
    "hint_known",
    "log_path_of_margin",
    "log_path_of_lambert",
    "moved_dep",
    "moved_arr",
)
"""Names of the net's inputs, all without unit."""

_BESIDE: Final = FEATURES.index("chosen_beside_nearest")
_LARGEST: Final = 3.0
_LEAST_HINT: Final = 0.02
"""Hints of less than this share of the change at m* count as unknown."""

_MOST_LOG_MARGIN: Final = 8.0
"""Larger margins count as this one: of an infinite one nothing could be said."""


def free_inputs_and_base(
    legs: Legs, X: _Array, excess: _Array, log_margin: _Array
) -> tuple[_Array, _Array]:
    """Return the net's inputs (n, k), and (n,) m/s, the velocity change that it corrects.

    Parameters
    ----------
    legs : Legs
        n legs with free ends and a hint.
    X : (n, m) float64
        `FREE_FEATURES`.
    excess : (n, 6) float64, m/s
        Excess velocities of the hint, see `features_and_excess`.
    log_margin : (n,) float64
        Estimate of log(m*/m0); below 0 counts as 0, inf is allowed.
    """
    margin = np.clip(log_margin, 0.0, _MOST_LOG_MARGIN)
    full = full_thrust_velocity(legs, margin)
    hint, sums, moved = _hint(legs, X, excess)
    known = hint[:, 3] > _LEAST_HINT * full
    n = X.shape[1]
    inputs = np.empty((len(legs), len(FREE_FINAL_MASS_INPUTS)))
    inputs[:, :n] = X
    inputs[:, n] = np.exp(-margin)
    inputs[:, n + 1] = np.minimum(margin, _LARGEST)
    inputs[:, n + 2] = _log_ratio(sums[:, 2], full)
    inputs[:, n + 3] = np.minimum(full / legs.exhaust_velocity, _LARGEST)
    sizes = np.where(known[:, None], hint[:, :5], full[:, None])
    inputs[:, n + 4 : n + 9] = np.minimum(_log_ratio(sizes, full[:, None]), 1.0)
    inputs[:, n + 9 : n + 15] = hint[:, 5:]
    inputs[:, n + 15] = known
    inputs[:, n + 16 : n + 18] = _log_ratio(sums[:, :2], full[:, None])
    for end in range(2):
        change = np.linalg.norm((moved - excess)[:, 3 * end : 3 * end + 3], axis=1)
        inputs[:, n + 18 + end] = change / (change + full)
    return inputs, np.where(known, np.minimum(hint[:, 3], full), full)


def _log_ratio(value: _Array, full: _Array) -> _Array:
    ratio: _Array = np.log(np.maximum(value, 1e-12 * full) / full)
    return np.clip(ratio, -_LARGEST, _LARGEST)


def _hint(legs: Legs, X: _Array, excess: _Array) -> tuple[_Array, _Array, _Array]:
    """Return what the kernels say: the hint, the sums with free ends, the excess velocities."""
    from feasibility.classifier.margin import free_propellant_kernels, propellant_kernels

    hint = np.empty((len(legs), propellant_kernels.N_HINTS))
    sums = np.empty((len(legs), 3))
    moved, beside = excess.copy(), np.rint(X[:, _BESIDE])
    push = legs.thrust * legs.tof_s / legs.m0
    states = legs.rv_dep.copy(), legs.rv_arr.copy()
    free_propellant_kernels.free_propellant_batch(
        *states,
        legs.tof_s,
        legs.exhaust_velocity,
        push,
        np.column_stack([legs.vinf_dep, legs.vinf_arr]),
        beside,
        MU_SUN,
        moved,
        sums,
    )
    for end in range(2):
        states[end][:, 3:] += moved[:, 3 * end : 3 * end + 3]
    propellant_kernels.propellant_batch(
        *states, legs.tof_s, legs.exhaust_velocity, push / N_NODES, beside, MU_SUN, hint
    )
    return hint, sums, moved
