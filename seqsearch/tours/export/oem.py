"""``oem``: CCSDS Orbit Ephemeris Message, version 2.0 (CCSDS 502.0-B-2), keyword = value."""

from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Final, final

from feasibility.runtime.atomic import atomic_path
from seqsearch.tours.export.arcs import FRAME, Arc, equatorial, mission_arcs, plain, words
from seqsearch.tours.export.epochs import calendar
from seqsearch.tours.export.protocol import Flight

_OBJECT_ID: Final = "SEQSEARCH"


@final
class OemExporter:
    """Writes a segment for each smooth arc, stays included.

    Positions and velocities are turned to EME2000, which every reader of the format knows;
    epochs are TDB. Interpolation is cubic (Hermite, degree 3): it never looks across a row, where
    the thrust changes.
    """

    name = "oem"

    def write(self, flight: Flight, path: Path, /) -> None:
        """Write the message.

        Raises
        ------
        InputError
            The file cannot be written.
        """
        arcs = mission_arcs(flight)
        with atomic_path(path) as temporary, temporary.open("w", encoding="ascii") as file:
            file.writelines(_header(flight))
            for arc in arcs:
                file.writelines(_segment(arc, plain(flight.tour.rules.name)))


def _header(flight: Flight) -> Iterator[str]:
    yield "CCSDS_OEM_VERS = 2.0\n"
    for line in words(flight):
        yield f"COMMENT {line}\n"
    yield f"COMMENT turned from the ecliptic J2000 to the {FRAME}\n"
    yield f"CREATION_DATE = {datetime.now(UTC):%Y-%m-%dT%H:%M:%S}\n"
    yield "ORIGINATOR = SEQSEARCH\n"


def _segment(arc: Arc, problem: str) -> Iterator[str]:
    epochs = calendar(arc.t_mjd2000)
    # Rows that fall into one microsecond would be one epoch twice, which the format forbids.
    rows = [k for k in range(len(arc)) if k == 0 or epochs[k] != epochs[k - 1]]
    if len(rows) < 2:
        return
    yield "\nMETA_START\n"
    yield f"COMMENT {plain(arc.label)[:200]}\n"
    yield f"OBJECT_NAME = {problem[:200] or 'SPACECRAFT'}\n"
    yield f"OBJECT_ID = {_OBJECT_ID}\n"
    yield "CENTER_NAME = SUN\nREF_FRAME = EME2000\nTIME_SYSTEM = TDB\n"
    yield f"START_TIME = {epochs[0]}\nSTOP_TIME = {epochs[-1]}\n"
    yield "INTERPOLATION = HERMITE\nINTERPOLATION_DEGREE = 3\n"
    yield "META_STOP\n"
    for row, epoch in zip(
        (equatorial(arc.states)[rows] / 1e3).tolist(), (epochs[k] for k in rows), strict=True
    ):
        yield f"{epoch} {' '.join(f'{number:.15e}' for number in row)}\n"
