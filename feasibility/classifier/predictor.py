"""`LegPredictor`: what a search asks about candidate legs before it solves any.

The contract of a predictor of one's own, with `QuickPredictor` for one that has cheap answers
too, and estimates of final masses for one that knows margins alone.
"""

from typing import Final, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from feasibility.legs import Legs
from feasibility.orbits.lambert import lambert_delta_v


@runtime_checkable
class LegPredictor(Protocol):
    """Predicts how far legs are from the boundary of what can be flown, and what they cost.

    A search orders candidates by the answers, finds the shortest flight times with them, and
    drops what is hopeless. `FeasibilityClassifier` is one with a margin model. The contract,
    which `feasibility.check_predictor` tests:

    - one float64 a leg; NaN says that nothing is known about it, which never counts against it;
    - row-wise: the answer for a leg depends on that leg alone, to the last digit, so that a
      search may split and merge batches;
    - pure: the same legs get the same answer, also where several threads ask at once, and the
      legs are not changed;
    - no legs is a legal batch;
    - picklable, so that it can travel to worker processes.

    Nothing relies on more: an exact m* does not depend on the initial mass, so that the margin
    falls as 1/m0, but an estimate need not.

    Examples
    --------
    >>> from feasibility.orbits.mima import mima
    >>> class Mima:
    ...     def margin(self, legs, /):
    ...         states = legs.rv_dep, legs.rv_arr, legs.tof_s
    ...         mass = mima(*states, legs.thrust, legs.exhaust_velocity)
    ...         return np.where(mass > 0.0, mass / legs.m0, np.nan)
    ...     def final_mass(self, legs, /):
    ...         return bounded_final_mass(legs, self.margin(legs))
    >>> isinstance(Mima(), LegPredictor)
    True
    """

    def margin(self, legs: Legs, /) -> NDArray[np.float64]:
        """Return (n,) the estimate of m*/m0: a leg is flyable where it is 1 or more.

        Finite and above 0, or NaN: a search works with its logarithm.
        """
        ...

    def final_mass(self, legs: Legs, /) -> NDArray[np.float64]:
        """Return (n,) kg, the estimate of the mass at arrival with least propellant.

        From 0 to the initial mass, or NaN. It may be below the dry mass: such a leg has not
        enough propellant. Where the margin is below 1, what full thrust all the time would leave.
        """
        ...


@runtime_checkable
class QuickPredictor(LegPredictor, Protocol):
    """A predictor that also has cheap answers, a few percent wrong.

    A search asks for them first, and for the good ones where they decide something. An error
    of more than a tenth may make it drop a leg that can be flown.
    """

    def quick_margin(self, legs: Legs, /) -> NDArray[np.float64]:
        """Return (n,) a cheap estimate of m*/m0; otherwise as `margin`."""
        ...


def lambert_final_mass(legs: Legs) -> NDArray[np.float64]:
    """Estimate the masses at arrival from two-impulse transfers.

    The propellant is that of the zero-revolution Lambert arc by the rocket equation, no
    more than what the engine can burn in the time of flight.

    Parameters
    ----------
    legs : Legs
        n legs.

    Returns
    -------
    (n,) float64, kg
        At least the dry mass.
    """
    delta_v = lambert_delta_v(
        *(legs.rv_dep, legs.rv_arr, legs.tof_s),
        max_revs=0,
        vinf_dep=legs.vinf_dep,
        vinf_arr=legs.vinf_arr,
    )
    burnt = legs.m0 * -np.expm1(-delta_v / legs.exhaust_velocity)
    most = legs.thrust / legs.exhaust_velocity * legs.tof_s
    estimate: NDArray[np.float64] = np.maximum(legs.m0 - np.minimum(burnt, most), legs.m_dry)
    return estimate


_BURN: Final = (4.18, 0.82)
"""Fit to the minimum-propellant solutions of 2400 legs of a GTOC7 search: 2 % off on average."""


def bounded_final_mass(legs: Legs, margin: NDArray[np.float64]) -> NDArray[np.float64]:
    """Estimate the masses at arrival from margins.

    At margin M a spacecraft can fly what the heaviest one flies, with 1/M of its thrust:
    it burns at most 1/M of what the engine can in the time of flight. Far from the
    boundary the propellant comes down to that of impulses, `lambert_final_mass`. Between
    the two, the share of their difference is 1 / (1 + a (M - 1)^b) with a = 4.18 and b = 0.82,
    a fit to solved legs.

    Parameters
    ----------
    legs : Legs
        n legs.
    margin : (n,) float64
        m*/m0; below 1 the answer is that at 1.

    Returns
    -------
    (n,) float64, kg
        Not held at the dry mass. NaN where the margin is.
    """
    full = legs.thrust / legs.exhaust_velocity * legs.tof_s
    least, more = _burn(legs.m0 - lambert_final_mass(legs), full, margin)
    estimate: NDArray[np.float64] = legs.m0 - least - more
    return estimate


def bounded_burn(
    impulsive_kg: NDArray[np.float64],
    full_thrust_kg: NDArray[np.float64],
    margin: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Estimate the propellant of legs as `bounded_final_mass` does, from what else burns it.

    Parameters
    ----------
    impulsive_kg : (n,) float64, kg
        Propellant of a transfer with impulses.
    full_thrust_kg : (n,) float64, kg
        What the engine can burn in the time of flight.
    margin : (n,) float64
        m*/m0; below 1 the answer is that at 1.
    """
    least, more = _burn(impulsive_kg, full_thrust_kg, margin)
    return least + more


def _burn(
    impulsive_kg: NDArray[np.float64],
    full_thrust_kg: NDArray[np.float64],
    margin: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the propellant of impulses, and what comes on top of it."""
    beyond = np.maximum(margin - 1.0, 0.0)
    most = full_thrust_kg / (1.0 + beyond)
    least = np.minimum(impulsive_kg, most)
    a, b = _BURN
    return least, (most - least) / (1.0 + a * beyond**b)
