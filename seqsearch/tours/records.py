"""The records that a tour is made of: bodies, legs and impulses, as the tour file has them."""

from typing import final

import msgspec

Vector = tuple[float, float, float]
"""Three components, heliocentric J2000 ecliptic."""


class Record(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A JSON object in which every key is known; abstract."""


@final
class Impulse(Record, frozen=True, kw_only=True):
    """One impulse of a Sims-Flanagan leg, at the centre of its segment."""

    t_mjd2000: float
    dv_m_s: Vector
    throttle: Vector
    mass_before_kg: float
    mass_after_kg: float


@final
class TourLeg(Record, frozen=True, kw_only=True):
    """One leg: from departure at a body to arrival at the next.

    Attributes
    ----------
    dep_velocity_m_s, arr_velocity_m_s : tuple of float
        Velocities at departure and arrival, relative to the bodies: zero at
        rest, otherwise that of a launch or of a fly-by.
    dropped_kg : float
        What is left behind at the arrival.
    """

    from_id: int
    to_id: int
    t_dep_mjd2000: float
    tof_days: float
    m0_kg: float
    m_final_kg: float
    m_star_kg: float
    impulses: tuple[Impulse, ...]
    dep_velocity_m_s: Vector = (0.0, 0.0, 0.0)
    arr_velocity_m_s: Vector = (0.0, 0.0, 0.0)
    dropped_kg: float = 0.0

    @property
    def is_fly_by(self) -> bool:
        """Whether the leg passes its target, rather than ending at rest there."""
        return any(self.arr_velocity_m_s)

    @property
    def t_arr_mjd2000(self) -> float:
        """Arrival epoch."""
        return self.t_dep_mjd2000 + self.tof_days

    @property
    def margin(self) -> float:
        """Maximum over actual initial mass: 1 is the boundary of what can be flown."""
        return self.m_star_kg / self.m0_kg


@final
class TourBody(Record, frozen=True, kw_only=True):
    """A visited body with its osculating elements as read from the catalogue."""

    id: int
    name: str
    epoch_mjd2000: float
    a_m: float
    e: float
    i_rad: float
    node_rad: float
    argp_rad: float
    mean_anomaly_rad: float
