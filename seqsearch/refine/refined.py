"""`RefinedTour`: the rows of a tour with continuous thrust, and what changed by it."""

from dataclasses import asdict, dataclass
from typing import Any, Final, final

from seqsearch.tours.trajectory import Trajectory

_LATE_DAYS: Final = 1e-6


@final
@dataclass(frozen=True)
class RefinedLeg:
    """One leg beside the one of impulses.

    Attributes
    ----------
    start, end : str
        The bodies, as rows name them.
    t_dep_mjd2000, t_arr_mjd2000 : float
        Departure and arrival.
    departure_delay_days, arrival_delay_days : float
        How much later than in the tour of impulses.
    m0_kg, m_final_kg : float
        Masses at both, before anything is left behind.
    propellant_kg, impulsive_propellant_kg : float
        What the leg uses, and what it used with impulses.
    miss_km, miss_m_s : float
        Distance from the target at the arrival, and relative velocity that should not be.
    iterations : int
        Of the solver.
    """

    start: str
    end: str
    t_dep_mjd2000: float
    t_arr_mjd2000: float
    departure_delay_days: float
    arrival_delay_days: float
    m0_kg: float
    m_final_kg: float
    propellant_kg: float
    impulsive_propellant_kg: float
    miss_km: float
    miss_m_s: float
    iterations: int

    @property
    def difference_percent(self) -> float:
        """Propellant beyond that of the impulses."""
        return _percent(self.propellant_kg, self.impulsive_propellant_kg)


@final
@dataclass(frozen=True)
class RefinedTour:
    """All legs.

    Attributes
    ----------
    trajectory : Trajectory
        One phase for each leg.
    legs : tuple of RefinedLeg
        What changed.
    m_final_kg : float
        Mass at the end, without what was left behind.
    duration_days : float
        From the first departure to the last arrival.
    time_price : float
        With which the legs were refined.
    """

    trajectory: Trajectory
    legs: tuple[RefinedLeg, ...]
    m_final_kg: float
    duration_days: float
    time_price: float

    @property
    def propellant_kg(self) -> float:
        """What all legs use."""
        return sum(leg.propellant_kg for leg in self.legs)

    @property
    def impulsive_propellant_kg(self) -> float:
        """What all legs used with impulses."""
        return sum(leg.impulsive_propellant_kg for leg in self.legs)

    @property
    def difference_percent(self) -> float:
        """Propellant beyond that of the impulses."""
        return _percent(self.propellant_kg, self.impulsive_propellant_kg)

    def one_line(self) -> str:
        """Return propellant, times and accuracy in a line."""
        late = self.legs[-1].arrival_delay_days
        miss_m = 1e3 * max(leg.miss_km for leg in self.legs)
        when = f"{late:.2f} days late" if late > _LATE_DAYS else "on time"
        return (
            f"{len(self.legs)} legs with continuous thrust: propellant "
            f"{self.propellant_kg:.2f} kg ({self.difference_percent:+.2f} % of the impulses' "
            f"{self.impulsive_propellant_kg:.2f} kg), final mass {self.m_final_kg:.2f} kg, "
            f"{when}, closed to {miss_m:.1f} m"
        )

    def summary(self) -> dict[str, Any]:
        """Return the figures as plain data."""
        return {
            "propellant_kg": self.propellant_kg,
            "impulsive_propellant_kg": self.impulsive_propellant_kg,
            "difference_percent": self.difference_percent,
            "m_final_kg": self.m_final_kg,
            "duration_days": self.duration_days,
            "time_price": self.time_price,
            "legs": [
                asdict(leg) | {"difference_percent": leg.difference_percent} for leg in self.legs
            ],
        }


def _percent(value: float, reference: float) -> float:
    return 100.0 * (value / reference - 1.0) if reference else 0.0
