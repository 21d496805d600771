"""`LegView`: what nets see of legs, and in which unit they estimate the acceleration at m*.

Legs from rest to rest and legs with free ends have a view each, and nets of their own in the same
model: what one kind learns changes nothing for the other.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from feasibility.classifier.margin.ends import KINDS, kinds_of_ends
from feasibility.classifier.margin.features import (
    DOMAIN_QUANTITIES,
    FEATURE_SET,
    FEATURES,
    QUICK_FEATURES,
    domain_quantities,
    log_acceleration,
    margin_features,
    quick_features,
)
from feasibility.classifier.margin.final_mass import (
    BOUND_INPUTS,
    FINAL_MASS_INPUTS,
    MassInputs,
    lambert_velocity,
    rendezvous_mass_inputs,
)
from feasibility.classifier.margin.free_fallback import (
    known_features,
    known_features_and_excess,
)
from feasibility.classifier.margin.free_features import (
    FREE_DOMAIN_QUANTITIES,
    FREE_FEATURE_SET,
    FREE_FEATURES,
    FREE_QUICK_FEATURES,
    free_domain_quantities,
    log_free_acceleration,
    log_no_thrust,
    quick_free_features,
)
from feasibility.classifier.margin.free_final_mass import (
    FREE_FINAL_MASS_INPUTS,
    free_inputs_and_base,
)
from feasibility.legs import Legs
from feasibility.orbits.lambert import lambert_delta_v

_Array = NDArray[np.float64]


@final
@dataclass(frozen=True, eq=False)
class LegView:
    """What the nets for one sort of legs see, with n the number of legs.

    Attributes
    ----------
    prefix : str
        Of the sections in a model's file.
    feature_set : str
        Name of the features.
    names, quick_names : tuple of str
        The features of the large and of the quick net.
    has_middle : bool
        Whether a net between the two is worth its training: where the features cost much.
    features, quick_features : callable
        Legs to features (n, k) and the hint (n,), NaN where there is none.
    features_and_more : callable
        Legs to the same, and what `mass_inputs` wants besides, (n, e).
    log_acceleration : callable
        Legs and masses (n,) in kg to log(thrust / mass) (n,), in the unit of the hints.
    least : callable
        Returns the least logarithm of an acceleration, that of legs that need no thrust.
    domain_names : tuple of str
        What the domain is a range of, d quantities.
    domain_quantities : callable
        Features (n, k), of all or of the quick ones, to these quantities (n, d).
    kinds : tuple of str
        Kinds of legs with calibrations of their own; none where all are one kind.
    mass_inputs : callable
        Inputs of the net for the final mass and what it corrects; see `MassInputs`.
    mass_sizes : tuple of int
        Numbers of inputs that such a net may have.
    lambert_velocity : callable
        Legs and features to (n,) m/s, the velocity change of the best Lambert arc.
    """

    prefix: str
    feature_set: str
    names: tuple[str, ...]
    quick_names: tuple[str, ...]
    has_middle: bool
    features: Callable[[Legs], tuple[_Array, _Array]]
    quick_features: Callable[[Legs], tuple[_Array, _Array]]
    features_and_more: Callable[[Legs], tuple[_Array, _Array, _Array]]
    log_acceleration: Callable[[Legs, _Array], _Array]
    least: Callable[[], float]
    domain_names: tuple[str, ...]
    domain_quantities: Callable[[_Array], _Array]
    kinds: tuple[str, ...]
    mass_inputs: MassInputs
    mass_sizes: tuple[int, ...]
    lambert_velocity: Callable[[Legs, _Array], _Array]

    def section(self, name: str) -> str:
        """Return the name of a section in a model's file."""
        return f"{self.prefix}{name}"

    def kinds_of(self, legs: Legs) -> NDArray[np.intp]:
        """Return (n,) the number of each leg's kind; all 0 where there is but one."""
        return kinds_of_ends(legs) if self.kinds else np.zeros(len(legs), dtype=np.intp)

    def rows_of(self, legs: Legs) -> NDArray[np.intp]:
        """Return the rows of the legs that are of this sort."""
        return np.flatnonzero(legs.free_ends == bool(self.kinds))


def _any() -> float:
    return -np.inf


def _features_alone(legs: Legs) -> tuple[_Array, _Array, _Array]:
    return *margin_features(legs), np.empty((len(legs), 0))


def _free_mass_inputs(
    legs: Legs,
    X: _Array,
    more: _Array,
    log_margin: _Array,
    size: int,  # noqa: ARG001 (there is one version so far)
) -> tuple[_Array, _Array]:
    return free_inputs_and_base(legs, X, more, log_margin)


def _free_lambert_velocity(legs: Legs, X: _Array) -> _Array:
    """Return (n,) m/s, Lambert's least sum of impulses beyond the excesses, up to 2 revolutions.

    Where there is no arc, those between the ends of the hint count.
    """
    left = lambert_delta_v(
        *(legs.rv_dep, legs.rv_arr, legs.tof_s),
        vinf_dep=legs.vinf_dep,
        vinf_arr=legs.vinf_arr,
    )
    between = lambert_velocity(legs, X[:, : len(FEATURES)])
    return np.where(np.isfinite(left), left, between)


RENDEZVOUS: Final = LegView(
    prefix="",
    feature_set=FEATURE_SET,
    names=FEATURES,
    quick_names=QUICK_FEATURES,
    has_middle=False,
    features=margin_features,
    quick_features=quick_features,
    features_and_more=_features_alone,
    log_acceleration=log_acceleration,
    least=_any,
    domain_names=DOMAIN_QUANTITIES,
    domain_quantities=domain_quantities,
    kinds=(),
    mass_inputs=rendezvous_mass_inputs,
    mass_sizes=(len(BOUND_INPUTS), len(FINAL_MASS_INPUTS)),
    lambert_velocity=lambert_velocity,
)
"""Legs from rest to rest, relative to the bodies."""

FREE_ENDS: Final = LegView(
    prefix="free_",
    feature_set=FREE_FEATURE_SET,
    names=FREE_FEATURES,
    quick_names=FREE_QUICK_FEATURES,
    has_middle=True,
    features=known_features,
    quick_features=quick_free_features,
    features_and_more=known_features_and_excess,
    log_acceleration=log_free_acceleration,
    least=log_no_thrust,
    domain_names=FREE_DOMAIN_QUANTITIES,
    domain_quantities=free_domain_quantities,
    kinds=KINDS,
    mass_inputs=_free_mass_inputs,
    mass_sizes=(len(FREE_FINAL_MASS_INPUTS),),
    lambert_velocity=_free_lambert_velocity,
)
"""Legs whose velocity may differ from the body's at one end or both."""
