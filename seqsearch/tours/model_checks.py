"""Checks of masses and thrust: the Sims-Flanagan model as the impulses of a tour state it."""

from collections.abc import Iterator
from typing import Final

import numpy as np

from feasibility.constants import DAY_S
from seqsearch.tours.checks import (
    MASS_TOLERANCE_KG,
    TIME_TOLERANCE_DAYS,
    Check,
    largest,
    smallest,
)
from seqsearch.tours.records import TourLeg
from seqsearch.tours.tour import Tour

_THROTTLE_TOLERANCE: Final = 1e-6
_IMPULSE_TOLERANCE_M_S: Final = 1e-3
_MARGIN_TOLERANCE: Final = 1e-6


def check_masses(tour: Tour) -> list[Check]:
    """Check that mass is lost to thrust and drops alone, and enough is left."""
    rules = tour.rules
    exhaust = rules.isp_s * rules.g0_m_s2
    masses = [rules.m0_kg, *(leg.m_final_kg - leg.dropped_kg for leg in tour.legs)]
    between = (abs(before - leg.m0_kg) for before, leg in zip(masses[:-1], tour.legs, strict=True))
    gap = largest([*between, *(gap for leg in tour.legs for gap in _gaps(leg))])
    rocket = largest(
        abs(
            impulse.mass_before_kg * float(np.exp(-np.linalg.norm(impulse.dv_m_s) / exhaust))
            - impulse.mass_after_kg
        )
        for leg in tour.legs
        for impulse in leg.impulses
    )
    least = smallest(masses)
    margin = smallest(leg.margin for leg in tour.legs)
    return [
        Check(
            "mass continuous along the tour",
            gap <= MASS_TOLERANCE_KG,
            f"largest jump {gap:.2e} kg",
            f"{MASS_TOLERANCE_KG} kg",
        ),
        Check(
            "rocket equation at each impulse",
            rocket <= MASS_TOLERANCE_KG,
            f"largest error {rocket:.2e} kg",
            f"{MASS_TOLERANCE_KG} kg",
        ),
        Check(
            "final mass",
            least >= rules.m_dry_kg - MASS_TOLERANCE_KG,
            f"{least:.3f} kg",
            f"at least {rules.m_dry_kg:.3f} kg",
        ),
        Check(
            "no leg heavier than its maximum initial mass",
            margin >= 1.0 - _MARGIN_TOLERANCE,
            f"least margin {margin:.6f}",
            "at least 1",
        ),
    ]


def check_thrust(tour: Tour) -> list[Check]:
    """Check that every impulse is what the engine can give within its segment."""
    impulses = [impulse for leg in tour.legs for impulse in leg.impulses]
    throttle = largest(float(np.linalg.norm(impulse.throttle)) for impulse in impulses)
    error = largest(e for leg in tour.legs for e in _impulse_errors(leg, tour.rules.thrust_n))
    offset = largest(
        abs(impulse.t_mjd2000 - leg.t_dep_mjd2000 - (k + 0.5) * leg.tof_days / len(leg.impulses))
        for leg in tour.legs
        for k, impulse in enumerate(leg.impulses)
    )
    return [
        Check(
            "throttles",
            throttle <= 1 + _THROTTLE_TOLERANCE,
            f"largest {throttle:.9f}",
            f"1 + {_THROTTLE_TOLERANCE:g}",
        ),
        Check(
            "impulses are thrust x time x throttle / mass",
            error <= _IMPULSE_TOLERANCE_M_S,
            f"largest error {error:.2e} m/s",
            f"{_IMPULSE_TOLERANCE_M_S:g} m/s",
        ),
        Check(
            "impulses at segment centres",
            offset <= TIME_TOLERANCE_DAYS,
            f"largest offset {offset:.2e} days",
            f"{TIME_TOLERANCE_DAYS:g} days",
        ),
    ]


def _gaps(leg: TourLeg) -> Iterator[float]:
    """Yield the jumps of mass within a leg: from its start, across each impulse, to its end."""
    befores = [impulse.mass_before_kg for impulse in leg.impulses] + [leg.m_final_kg]
    afters = [leg.m0_kg] + [impulse.mass_after_kg for impulse in leg.impulses]
    for before, after in zip(befores, afters, strict=True):
        yield abs(before - after)


def _impulse_errors(leg: TourLeg, thrust_n: float) -> Iterator[float]:
    """Yield the differences in m/s between impulses and those of the model.

    Its impulse has the mass before it in the first half of the leg, after it in the second.
    """
    n = len(leg.impulses)
    segment_s = leg.tof_days * DAY_S / n
    for k, impulse in enumerate(leg.impulses):
        mass = impulse.mass_before_kg if k < n // 2 else impulse.mass_after_kg
        dv = np.asarray(impulse.throttle) * (thrust_n * segment_s / max(mass, 1e-9))
        yield float(np.linalg.norm(dv - np.asarray(impulse.dv_m_s)))
