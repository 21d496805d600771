"""The mass at arrival with least propellant: what bounds it, a hint, and what the net adds.

At m* the engine burns all the time; a lighter spacecraft coasts, and the lighter it is the
nearer it comes to a few impulses. So the velocity change is at most that at m*. The hint is the
least sum of impulses along a path in element space (`propellant_kernels`); the net corrects it.
"""

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.margin.features import FEATURES
from feasibility.classifier.margin.network import MarginNet
from feasibility.classifier.margin.path_kernels import N_NODES
from feasibility.constants import MU_SUN
from feasibility.legs import Legs

_Array = NDArray[np.float64]

MassInputs = Callable[[Legs, _Array, _Array, _Array, int], tuple[_Array, _Array]]
"""Legs, features, what else their computation gave (n, e), log(m*/m0) (n,) and the number of a
net's inputs to those inputs (n, k), and (n,) m/s, the velocity change that it corrects."""

BOUND_INPUTS: Final = (
    *FEATURES,
    "inverse_margin",
    "log_margin",
    "log_lambert_to_full_thrust",
    "full_thrust_to_exhaust_velocity",
)
"""Names of the inputs of nets without the hint, as models before it have them; without unit."""

FINAL_MASS_INPUTS: Final = (
    *BOUND_INPUTS,
    *(f"log_hint_{which}" for which in ("first", "before_last_two", "before_last", "last")),
    "log_hint_dual",
    "full_thrust_share",
    *(f"impulse_share_{group}" for group in range(5)),
    "hint_known",
)
"""Names of the net's inputs, all without unit."""

_LAMBERT: Final = [FEATURES.index(f"log_lambert_dv_{revs}_rev") for revs in range(3)]
_LOG_IMPULSE: Final = FEATURES.index("log_impulse")
_BESIDE: Final = FEATURES.index("chosen_beside_nearest")
_LARGEST_SHARE: Final = 0.999
"""Share of m* that may be burnt at m*: a leg with more is beyond all use."""

_LARGEST: Final = 3.0
_LEAST_HINT: Final = 0.05
"""Hints of less than this share of the change at m* are no arcs."""

_NEARLY_FLYABLE: Final = -0.05
"""log(m*/m0) above which the mass at arrival has an estimated error: m* itself has one."""


def full_thrust_velocity(legs: Legs, log_margin: _Array) -> _Array:
    """Return (n,) m/s, the velocity change at m* of legs with the given log(m*/m0) (n,)."""
    heaviest = legs.m0 * np.exp(log_margin)
    burnt = legs.thrust * legs.tof_s / (legs.exhaust_velocity * heaviest)
    change: _Array = -legs.exhaust_velocity * np.log1p(-np.minimum(burnt, _LARGEST_SHARE))
    return change


def lambert_velocity(legs: Legs, X: _Array) -> _Array:
    """Return (n,) m/s, Lambert's least sum of impulses up to 2 revolutions, by `FEATURES`."""
    states = legs.rv_dep
    radius = np.sqrt(np.einsum("ij,ij->i", states[:, :3], states[:, :3]))
    inverse = 2.0 / radius - np.einsum("ij,ij->i", states[:, 3:], states[:, 3:]) / MU_SUN
    total = np.exp(X[:, _LAMBERT].min(axis=1) + X[:, _LOG_IMPULSE])
    change: _Array = total * np.sqrt(MU_SUN * inverse)
    return change


def final_mass_inputs(legs: Legs, X: _Array, log_margin: _Array) -> _Array:
    """Return `FINAL_MASS_INPUTS` (n, 96) of n legs on elliptic orbits.

    Parameters
    ----------
    legs : Legs
        n legs.
    X : (n, 80) float64
        `FEATURES`.
    log_margin : (n,) float64
        Estimate of log(m*/m0); below 0 counts as 0.
    """
    return inputs_and_base(legs, X, log_margin)[0]


def inputs_and_base(legs: Legs, X: _Array, log_margin: _Array) -> tuple[_Array, _Array]:
    """Return the net's inputs (n, 96), and (n,) m/s, the velocity change that it corrects.

    Parameters
    ----------
    legs, X, log_margin
        As for `final_mass_inputs`.
    """
    margin = np.maximum(log_margin, 0.0)
    full = full_thrust_velocity(legs, margin)
    inputs = np.empty((len(legs), len(FINAL_MASS_INPUTS)))
    inputs[:, : len(BOUND_INPUTS)] = _bound_inputs(legs, X, margin, full)
    hint = _propellant_hint(legs, X)
    known = hint[:, 3] > _LEAST_HINT * full
    logs = np.log(np.where(known[:, None], hint[:, :5], full[:, None]) / full[:, None])
    more = inputs[:, len(BOUND_INPUTS) :]
    np.clip(logs, -_LARGEST, 1.0, out=more[:, :5])
    more[:, 5:11] = hint[:, 5:]
    more[:, 11] = known
    return inputs, np.where(known, np.minimum(hint[:, 3], full), full)


def rendezvous_mass_inputs(
    legs: Legs,
    X: _Array,
    more: _Array,  # noqa: ARG001 (there is no more)
    log_margin: _Array,
    size: int,
) -> tuple[_Array, _Array]:
    """Return the net's inputs (n, size), and (n,) m/s, the velocity change that it corrects.

    Parameters
    ----------
    legs, X, log_margin
        As for `final_mass_inputs`.
    more : (n, 0) float64
        Nothing.
    size : int
        Inputs of the net: those of `BOUND_INPUTS` where it is from before the hint.
    """
    if size != len(BOUND_INPUTS):
        return inputs_and_base(legs, X, log_margin)
    margin = np.maximum(log_margin, 0.0)
    base = full_thrust_velocity(legs, margin)
    return _bound_inputs(legs, X, margin, base), base


def _bound_inputs(legs: Legs, X: _Array, margin: _Array, full: _Array) -> _Array:
    inputs = np.empty((len(legs), len(BOUND_INPUTS)))
    ratio = np.log(lambert_velocity(legs, X) / full)
    n = X.shape[1]
    inputs[:, :n] = X
    inputs[:, n] = np.exp(-margin)
    inputs[:, n + 1] = np.minimum(margin, _LARGEST)
    inputs[:, n + 2] = np.clip(ratio, -_LARGEST, _LARGEST)
    inputs[:, n + 3] = np.minimum(full / legs.exhaust_velocity, _LARGEST)
    return inputs


def _propellant_hint(legs: Legs, X: _Array) -> _Array:
    from feasibility.classifier.margin import propellant_kernels

    hint = np.empty((len(legs), propellant_kernels.N_HINTS))
    propellant_kernels.propellant_batch(
        # Copies are writable, as the one compiled signature wants them.
        legs.rv_dep.copy(),
        legs.rv_arr.copy(),
        legs.tof_s,
        legs.exhaust_velocity,
        legs.thrust * legs.tof_s / N_NODES / legs.m0,
        np.rint(X[:, _BESIDE]),
        MU_SUN,
        hint,
    )
    return hint


def log_expected_error(doubt: _Array, margin_error: _Array, fit: _Array) -> _Array:
    """Return (n,) the logarithm of the error of log(velocity change) that 68 % of legs are within.

    A net is sure of itself where it has learned by heart; legs that it has not seen tell how
    sure it should be.

    Parameters
    ----------
    doubt : (n,) float64
        Expected error of log(velocity change), by the net.
    margin_error : (n,) float64
        That of log(m*/m0).
    fit : (3,) float64
        Coefficients of 1 and of the logarithms of both.
    """
    logs: _Array = fit[0] + fit[1] * np.log(doubt) + fit[2] * np.log(margin_error)
    return logs


AS_IT_SAYS: Final = np.array([0.0, 1.0, 0.0])
"""The fit for nets without one."""


def final_mass(
    legs: Legs,
    X: _Array,
    log_margin: _Array,
    margin_error: _Array,
    net: MarginNet | None,
    error_fit: _Array = AS_IT_SAYS,
    mass_inputs: MassInputs = rendezvous_mass_inputs,
    lambert: Callable[[Legs, _Array], _Array] = lambert_velocity,
    more: _Array | None = None,
) -> tuple[_Array, _Array]:
    """Return the mass at arrival with least propellant and the error to expect.

    Parameters
    ----------
    legs, X, log_margin
        As for `final_mass_inputs`. Where the margin is negative the leg cannot be flown, and the
        answer is what full thrust all the time would leave.
    margin_error : (n,) float64
        Expected error of `log_margin`.
    net : MarginNet, optional
        Estimates log(velocity change / the base's); without it, the smaller bound is the answer.
    error_fit : (3,) float64
        As for `log_expected_error`.
    mass_inputs : callable
        What the net sees and corrects.
    lambert : callable
        Legs and features to the bound by Lambert's arcs, (n,) m/s.
    more : (n, e) float64, optional
        What `mass_inputs` wants besides.

    Returns
    -------
    mass, error : (n,) float64, kg
        The error is NaN without a net, and where the leg is evidently too heavy.
    """
    most = np.maximum(legs.m0 - legs.thrust * legs.tof_s / legs.exhaust_velocity, 0.0)
    mass, error = most, np.full(len(legs), np.nan)
    more = np.empty((len(legs), 0)) if more is None else more
    rows = np.flatnonzero(log_margin >= _NEARLY_FLYABLE)
    if not len(rows):
        return mass, error
    if len(rows) < len(legs):
        legs, X, log_margin, most = legs.take(rows), X[rows], log_margin[rows], most[rows]
        margin_error, more = margin_error[rows], more[rows]
    if net is None:
        full = full_thrust_velocity(legs, np.maximum(log_margin, 0.0))
        change, doubt = np.minimum(full, lambert(legs, X)), np.full(len(rows), np.nan)
    else:
        inputs, base = mass_inputs(legs, X, more, log_margin, net.inputs)
        correction, doubt = net(inputs)
        change = base * np.exp(correction)
        doubt = np.exp(log_expected_error(doubt, margin_error, error_fit))
    # More than full thrust all the time cannot be burnt.
    left = np.maximum(legs.m0 * np.exp(-change / legs.exhaust_velocity), most)
    mass[rows] = np.where(log_margin < 0.0, most, left)
    share = np.minimum(doubt * change / legs.exhaust_velocity, 1.0)
    error[rows] = legs.m0 * np.exp(-change / legs.exhaust_velocity) * share
    return mass, error
