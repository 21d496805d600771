"""``csv``: one table of all rows, stays included, with units in the names of the columns."""

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import Final, final

import numpy as np

from feasibility.constants import MJD2000_MJD
from feasibility.runtime.atomic import atomic_path
from seqsearch.tours.export.arcs import Arc, mission_arcs
from seqsearch.tours.export.epochs import calendar
from seqsearch.tours.export.protocol import Flight

COLUMNS: Final = (
    "model", "kind", "leg", "from", "to", "t_mjd_tdb", "date_tdb",
    "x_km", "y_km", "z_km", "vx_km_s", "vy_km_s", "vz_km_s",
    "m_kg", "thrust_x_n", "thrust_y_n", "thrust_z_n",
)  # fmt: skip
"""Names of the columns, in order."""


@final
class CsvExporter:
    """Writes heliocentric ecliptic J2000 states, mass and thrust, one row an epoch.

    There is no comment, as most readers of CSV know none; the column ``model`` says whether the
    thrust is continuous. At an impulse there are two rows of one epoch.
    """

    name = "csv"

    def write(self, flight: Flight, path: Path, /) -> None:
        """Write the table.

        Raises
        ------
        InputError
            The file cannot be written.
        """
        arcs = mission_arcs(flight)
        with (
            atomic_path(path) as temporary,
            temporary.open("w", encoding="utf-8", newline="") as file,
        ):
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(COLUMNS)
            for arc in arcs:
                writer.writerows(_rows(flight, arc))


def _rows(flight: Flight, arc: Arc) -> Iterator[list[object]]:
    phase = flight.trajectory.phases[arc.number - 1]
    head = [
        "continuous" if flight.trajectory.continuous else "impulsive",
        "stay" if arc.stay else "flight",
        arc.number,
        phase.end if arc.stay else phase.start,
        phase.end,
    ]
    numbers = np.column_stack([arc.states / 1e3, arc.mass_kg, arc.thrust_n]).tolist()
    epochs = (arc.t_mjd2000 + MJD2000_MJD).tolist()
    for epoch, date, row in zip(epochs, calendar(arc.t_mjd2000), numbers, strict=True):
        yield [*head, repr(epoch), date, *map(repr, row)]
