"""`Launch`: the tour begins at a planet, with some excess speed for free."""

from typing import Self, final

import msgspec
import numpy as np

from seqsearch.tours.checks import SPEED_TOLERANCE_M_S, Check, FlownTour
from seqsearch.tours.records import TourBody

_ELEMENT_TOLERANCE = 1e-12


@final
class Launch(
    msgspec.Struct,
    frozen=True,
    kw_only=True,
    forbid_unknown_fields=True,
    tag_field="kind",
    tag="launch",
):
    """The rule of a launch.

    Parameters
    ----------
    planet : TourBody or None
        Where tours start, with the elements of the problem statement, as asteroid tables
        rarely hold planets; it counts as no visit. None where tours begin at rest at a body
        of the table.
    speed_max_m_s : float
        Largest speed relative to it at the departure, in any direction.
    """

    planet: TourBody | None
    speed_max_m_s: float

    @classmethod
    def forbidden(cls) -> Self:
        """Return the rule of a tour that begins at rest."""
        return cls(planet=None, speed_max_m_s=0.0)

    def checks(self, flown: FlownTour, /) -> list[Check]:
        """Return the check of the launch speed and, where there is a planet, of the start."""
        speed = float(np.linalg.norm(flown.legs[0].dep_velocity_m_s)) if flown.legs else 0.0
        checks = [
            Check(
                "launch speed",
                speed <= self.speed_max_m_s + SPEED_TOLERANCE_M_S,
                f"{speed:.6f} m/s",
                f"{self.speed_max_m_s:g} m/s",
            )
        ]
        if self.planet is not None:
            start = flown.bodies[0]
            checks.append(
                Check(
                    "launch from the planet of the problem statement",
                    _same_orbit(start, self.planet),
                    f"{start.id} {start.name}",
                    f"{self.planet.id} {self.planet.name}",
                )
            )
        return checks


def _same_orbit(one: TourBody, other: TourBody) -> bool:
    numbers = [
        np.array(
            [
                float(body.id),
                body.epoch_mjd2000,
                body.a_m / other.a_m,
                body.e,
                body.i_rad,
                body.node_rad,
                body.argp_rad,
                body.mean_anomaly_rad,
            ]
        )
        for body in (one, other)
    ]
    return bool(np.abs(numbers[0] - numbers[1]).max() <= _ELEMENT_TOLERANCE)
