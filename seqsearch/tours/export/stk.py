"""``stk``: an ephemeris file (``.e``) of the Systems Tool Kit, version 11."""

from collections.abc import Iterator
from datetime import datetime, timedelta
from pathlib import Path
from typing import Final, final

import numpy as np

from feasibility.constants import DAY_S
from feasibility.runtime.atomic import atomic_path
from seqsearch.tours.export.arcs import FRAME, Arc, equatorial, mission_arcs, plain, words
from seqsearch.tours.export.epochs import TDB_UTC_S
from seqsearch.tours.export.protocol import Flight

_MONTHS: Final = (
    *("Jan", "Feb", "Mar", "Apr", "May", "Jun"),
    *("Jul", "Aug", "Sep", "Oct", "Nov", "Dec"),
)


@final
class StkExporter:
    """Writes all arcs as one table; where the velocity jumps there are two rows of one epoch.

    The format's epochs are UTC; those of flights are TDB and are turned with the leap seconds
    known today.
    """

    name = "stk"

    def write(self, flight: Flight, path: Path, /) -> None:
        """Write the file.

        Raises
        ------
        InputError
            The file cannot be written.
        """
        arcs = mission_arcs(flight)
        with atomic_path(path) as temporary, temporary.open("w", encoding="ascii") as file:
            file.writelines(_lines(flight, arcs))


def _lines(flight: Flight, arcs: list[Arc]) -> Iterator[str]:
    day = float(np.floor(arcs[0].t_mjd2000[0]))
    seconds = [(arc.t_mjd2000 - day) * DAY_S - TDB_UTC_S for arc in arcs]
    yield "stk.v.11.0\n\n"
    for line in words(flight):
        yield f"# {line}\n"
    yield f"# turned from the ecliptic J2000 to the {FRAME}\n"
    yield f"# epochs: UTC = TDB - {TDB_UTC_S} s\n\n"
    yield "BEGIN Ephemeris\n\n"
    yield f"NumberOfEphemerisPoints {sum(map(len, arcs))}\n"
    yield f"ScenarioEpoch {_midnight(day)}\n"
    yield "InterpolationMethod Hermite\nInterpolationSamplesM1 1\n"
    yield "CentralBody Sun\nCoordinateSystem J2000\nDistanceUnit Kilometers\n\n"
    yield "BEGIN SegmentBoundaryTimes\n"
    for times in seconds[1:]:
        yield f"{times[0]:.17g}\n"
    yield "END SegmentBoundaryTimes\n\n"
    yield "EphemerisTimePosVel\n\n"
    for arc, times in zip(arcs, seconds, strict=True):
        yield f"# {plain(arc.label)}\n"
        for t, row in zip(times.tolist(), (equatorial(arc.states) / 1e3).tolist(), strict=True):
            yield f"{t:.17g} {' '.join(f'{number:.16e}' for number in row)}\n"
    yield "\nEND Ephemeris\n"


def _midnight(day: float) -> str:
    date = datetime(2000, 1, 1) + timedelta(days=day)
    return f"{date.day} {_MONTHS[date.month - 1]} {date.year} 00:00:00.000000"
