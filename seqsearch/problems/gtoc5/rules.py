"""`Gtoc5Rules`: the numbers of the GTOC5 statement that other problems do not have."""

from typing import Annotated, final

import msgspec
from msgspec import Meta

from seqsearch.tours.events import Drop, FlyBy, Launch, TourEvent
from seqsearch.tours.records import TourBody
from seqsearch.tours.scores import Points

_Positive = Annotated[float, Meta(gt=0)]
_NotNegative = Annotated[float, Meta(ge=0)]


@final
class Gtoc5Rules(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Launch, drops, fly-bys and score; the ``[gtoc5]`` table of a problem file.

    Parameters
    ----------
    launch_speed_max_m_s : float
        Largest hyperbolic excess speed at the Earth; its direction is free.
    package_kg : float
        Left at each rendezvous.
    penetrator_kg : float
        Left at each fly-by.
    fly_by_speed_min_m_s : float
        Least relative speed of a fly-by.
    rendezvous_score, fly_by_score : float
        What an asteroid's first rendezvous and its first fly-by after that count.
    bonus_ids : tuple of int
        Asteroids that count more: Beletskij, number 1 of the table.
    bonus_factor : float
        How much more.
    """

    launch_speed_max_m_s: _NotNegative = 5000.0
    package_kg: _NotNegative = 40.0
    penetrator_kg: _NotNegative = 1.0
    fly_by_speed_min_m_s: _Positive = 400.0
    rendezvous_score: _NotNegative = 0.2
    fly_by_score: _NotNegative = 0.8
    bonus_ids: tuple[int, ...] = (1,)
    bonus_factor: _Positive = 1.5

    def events(self, planet: TourBody) -> tuple[TourEvent, ...]:
        """Return what tours that are launched from a planet may and have to do."""
        return (
            Launch(planet=planet, speed_max_m_s=self.launch_speed_max_m_s),
            FlyBy(speed_min_m_s=self.fly_by_speed_min_m_s),
            Drop(rendezvous_kg=self.package_kg, fly_by_kg=self.penetrator_kg),
        )

    def points(self) -> Points:
        """Return what tours are scored by."""
        return Points(
            rendezvous=self.rendezvous_score,
            fly_by=self.fly_by_score,
            bonus_ids=self.bonus_ids,
            bonus_factor=self.bonus_factor,
        )
