"""What a verification consists of: checks, and the flown tour that they look at."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from numpy.typing import NDArray

from seqsearch.tours.records import TourBody, TourLeg

SPEED_TOLERANCE_M_S: Final = 1e-6
MASS_TOLERANCE_KG: Final = 0.01
TIME_TOLERANCE_DAYS: Final = 1e-6
"""By how much numbers of a tour file may differ that should be equal."""


def largest(values: Iterable[float], default: float = 0.0) -> float:
    """Return the largest value, NaN if one is, so that a comparison with a limit fails."""
    return float(np.max([*values] or [default]))


def smallest(values: Iterable[float], default: float = np.inf) -> float:
    """Return the smallest value, NaN if one is, so that a comparison with a limit fails."""
    return float(np.min([*values] or [default]))


def visited_ids(legs: Iterable[TourLeg]) -> list[int]:
    """Return the ids of the bodies that legs visit, in order; the start is none of them.

    A leg that passes a body which the tour has reached before is no visit: such are fly-bys of
    asteroids that were met at rest. Whether a body may be passed is for the rules.
    """
    visits: list[int] = []
    for leg in legs:
        if not leg.is_fly_by or leg.to_id not in visits:
            visits.append(leg.to_id)
    return visits


@final
@dataclass(frozen=True)
class Check:
    """One rule and how well the tour keeps it.

    Attributes
    ----------
    name : str
        What was checked.
    passed : bool
        Whether it holds.
    found, limit : str
        The worst value and what is allowed, with units.
    """

    name: str
    passed: bool
    found: str
    limit: str


@final
@dataclass(frozen=True)
class Verification:
    """The outcome of all checks; `passed` if every one holds."""

    checks: tuple[Check, ...]

    @property
    def passed(self) -> bool:
        """Whether every check holds."""
        return all(check.passed for check in self.checks)

    def table(self) -> str:
        """Return the checks as a text table."""
        width = max(len(check.name) for check in self.checks)
        return "\n".join(
            f"{'ok  ' if check.passed else 'FAIL'}  {check.name:<{width}}  "
            f"{check.found}  (limit: {check.limit})"
            for check in self.checks
        )


@final
@dataclass(frozen=True)
class Arrival:
    """Where an integrated leg ends, and where its target is then: (6,) float64, m and m/s."""

    reached: NDArray[np.float64]
    target: NDArray[np.float64]


@final
@dataclass(frozen=True)
class FlownTour:
    """A tour's bodies and legs, and where the legs led when they were integrated anew.

    Attributes
    ----------
    bodies : tuple of TourBody
        The bodies in order of rendezvous, the start body first.
    legs : tuple of TourLeg
        The legs in order of flight.
    arrivals : tuple of Arrival or None
        One for each leg; None for a leg whose bodies are not among `bodies`.
    """

    bodies: tuple[TourBody, ...]
    legs: tuple[TourLeg, ...]
    arrivals: tuple[Arrival | None, ...]
