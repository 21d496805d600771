"""The records that a tour is made of: bodies, legs and impulses, as the tour file has them."""

from typing import Final, final

import msgspec
from msgspec import UNSET, UnsetType

Vector = tuple[float, float, float]
"""Three components, heliocentric J2000 ecliptic."""

State = tuple[float, float, float, float, float, float]
"""Position in m and velocity in m/s, heliocentric J2000 ecliptic."""

LARGEST_M_STAR_KG: Final = 1e7
"""m* in files of legs with a larger one, or with none: they need no thrust at all."""


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
        rest, otherwise that of a launch, of a fly-by, or of an arrival with some speed left. How
        large they may be is for the rules to say.
    m_star_kg : float
        Maximum initial mass, `LARGEST_M_STAR_KG` at most.
    dropped_kg : float
        What is left behind at the arrival.
    dep_body_state, arr_body_state : tuple of float, optional
        Where the bodies are at departure and arrival, if they do not move by their elements.
        The file says nothing where they do.
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
    dep_body_state: State | UnsetType = UNSET
    arr_body_state: State | UnsetType = UNSET

    @property
    def is_fly_by(self) -> bool:
        """Whether the leg ends with a velocity relative to its target, not at rest there."""
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


@final
class KernelFile(Record, frozen=True, kw_only=True):
    """An SPK kernel: the name of the file and the SHA-256 of its content."""

    name: str
    sha256: str
