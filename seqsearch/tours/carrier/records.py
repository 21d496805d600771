"""The flight of a carrier as data: rules, and the events launch, impulse, release and capture."""

import math
from itertools import pairwise
from typing import Final, final

import msgspec

from feasibility.constants import G0, MU_SUN
from feasibility.errors import InputError
from seqsearch.tours.records import Record, TourBody, Vector

FORMAT: Final = "seqsearch-carrier-1"
"""Name and version of the layout of ``carrier.json``."""


@final
class CraftRules(Record, frozen=True, kw_only=True):
    """What each craft of a carrier has to respect.

    Attributes
    ----------
    m0_kg, m_dry_kg : float
        Mass at the release, and the least at the capture.
    thrust_n, isp_s : float
        Its engine, which thrusts continuously.
    max_duration_days : float
        From release to capture.
    min_stay_days : float
        At each body that counts.
    """

    m0_kg: float
    m_dry_kg: float
    thrust_n: float
    isp_s: float
    max_duration_days: float
    min_stay_days: float


@final
class CarrierRules(Record, frozen=True, kw_only=True):
    """What a carrier has to respect: the problem in numbers.

    Attributes
    ----------
    planet : TourBody
        Where it is launched.
    launch_mjd2000 : tuple of float
        Earliest and latest launch.
    v_inf_max_m_s : float
        Largest speed relative to the planet at launch.
    m0_kg : float
        Mass at launch, with all craft.
    m_dry_kg : float
        Least mass of the carrier alone.
    isp_s : float
        Specific impulse of its impulses.
    max_impulses : int
        How many.
    max_duration_days : float
        From launch to the last capture.
    craft_count : int
        How many craft it has at launch; they are numbered from 1.
    craft : CraftRules
        What each has to respect.
    position_km, velocity_m_s : float
        How exactly bodies and the carrier are met.
    """

    name: str
    planet: TourBody
    launch_mjd2000: tuple[float, float]
    v_inf_max_m_s: float
    m0_kg: float
    m_dry_kg: float
    isp_s: float
    max_impulses: int
    max_duration_days: float
    craft_count: int
    craft: CraftRules
    position_km: float = 1000.0
    velocity_m_s: float = 1.0
    mu_m3_s2: float = MU_SUN
    g0_m_s2: float = G0


@final
class CarrierLaunch(Record, frozen=True, kw_only=True, tag_field="kind", tag="launch"):
    """The carrier leaves the planet with a velocity relative to it."""

    t_mjd2000: float
    v_inf_m_s: Vector


@final
class CarrierImpulse(Record, frozen=True, kw_only=True, tag_field="kind", tag="impulse"):
    """The carrier changes its velocity at once."""

    t_mjd2000: float
    dv_m_s: Vector


@final
class CraftRelease(Record, frozen=True, kw_only=True, tag_field="kind", tag="release"):
    """A craft leaves the carrier with the carrier's position and velocity.

    Attributes
    ----------
    craft : int
        Number of the craft, from 1.
    """

    t_mjd2000: float
    craft: int


@final
class CraftCapture(Record, frozen=True, kw_only=True, tag_field="kind", tag="capture"):
    """A craft comes back: it has the carrier's position and velocity.

    Attributes
    ----------
    craft : int
        Number of the craft, from 1.
    mass_kg : float
        The craft's mass, which the carrier gains.
    """

    t_mjd2000: float
    craft: int
    mass_kg: float


CarrierEvent = CarrierLaunch | CarrierImpulse | CraftRelease | CraftCapture
"""What happens to a carrier; between two events it coasts."""


@final
class Carrier(Record, frozen=True, kw_only=True):
    """A carrier's flight: everything that happens to it, in order of time.

    Two events may have the same epoch; the order then says which comes first, for instance an
    impulse after a capture.

    Attributes
    ----------
    format : str
        `FORMAT`.
    rules : CarrierRules
        The problem in numbers.
    events : tuple of CarrierEvent
        The launch first.

    Raises
    ------
    InputError
        The first event is no launch, there is another one, time goes back, a number is not
        finite, or a craft is released or captured twice, or captured and not released.
    """

    format: str = FORMAT
    rules: CarrierRules
    events: tuple[CarrierEvent, ...]

    def __post_init__(self) -> None:
        """Refuse flights that make no sense."""
        if self.format != FORMAT:
            raise InputError(f"format {self.format!r}, expected {FORMAT!r}")
        launches = [isinstance(event, CarrierLaunch) for event in self.events]
        if not self.events or not launches[0] or sum(launches) > 1:
            raise InputError("carrier: expected one launch, as the first event")
        out: set[int] = set()
        back: set[int] = set()
        for number, event in enumerate(self.events, 1):
            label = f"carrier, event {number}"
            if not all(map(math.isfinite, _numbers(event))):
                raise InputError(f"{label}: a number that is not finite")
            match event:
                case CraftRelease(craft=craft):
                    if craft in out or not 1 <= craft <= self.rules.craft_count:
                        raise InputError(
                            f"{label}: release of craft {craft}, expected one of 1 to "
                            f"{self.rules.craft_count} that is still aboard"
                        )
                    out.add(craft)
                case CraftCapture(craft=craft):
                    if craft not in out - back:
                        raise InputError(
                            f"{label}: capture of craft {craft}, expected one that is out"
                        )
                    back.add(craft)
        for before, after in pairwise(self.events):
            if after.t_mjd2000 < before.t_mjd2000:
                raise InputError(
                    f"carrier: an event at {after.t_mjd2000:.9g} MJD2000 after one at "
                    f"{before.t_mjd2000:.9g}, expected them in order of time"
                )

    @property
    def launch(self) -> CarrierLaunch:
        """The first event."""
        event = self.events[0]
        assert isinstance(event, CarrierLaunch)
        return event

    @property
    def impulses(self) -> tuple[CarrierImpulse, ...]:
        """All impulses."""
        return tuple(event for event in self.events if isinstance(event, CarrierImpulse))

    def release(self, craft: int) -> CraftRelease | None:
        """Return the release of a craft; None where it stays aboard."""
        for event in self.events:
            if isinstance(event, CraftRelease) and event.craft == craft:
                return event
        return None

    def capture(self, craft: int) -> CraftCapture | None:
        """Return the capture of a craft; None where it does not come back."""
        for event in self.events:
            if isinstance(event, CraftCapture) and event.craft == craft:
                return event
        return None

    def with_events(self, *events: CarrierEvent) -> "Carrier":
        """Return a flight with further events, each after those of the same epoch.

        Raises
        ------
        InputError
            As the class.
        """
        ordered = sorted([*self.events, *events], key=lambda event: event.t_mjd2000)
        return msgspec.structs.replace(self, events=tuple(ordered))


def _numbers(event: CarrierEvent) -> tuple[float, ...]:
    match event:
        case CarrierLaunch(v_inf_m_s=vector) | CarrierImpulse(dv_m_s=vector):
            return (event.t_mjd2000, *vector)
        case CraftCapture(mass_kg=mass):
            return (event.t_mjd2000, mass)
    return (event.t_mjd2000,)
