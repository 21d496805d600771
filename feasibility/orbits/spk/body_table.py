"""The bodies of kernels as a table, in the units in which tables give them."""

from pathlib import Path

import numpy as np

from feasibility.constants import AU, MJD2000_MJD
from feasibility.orbits.readers.bodies import BodyTable, LeftOut
from feasibility.orbits.spk.kepler_error import motion_line
from feasibility.orbits.spk.reading import kernel_reading

_NAMED = 5


def kernel_bodies(path: Path) -> BodyTable:
    """Return all small bodies and spacecraft of kernels, osculating in the middle of the coverage.

    Raises
    ------
    InputError
        As `feasibility.orbits.spk.reading.read_kernels`.
    """
    reading = kernel_reading(path)
    catalogue, away = reading.catalogue, reading.away
    elements = catalogue.elements
    left_out = (LeftOut("on no ellipse about the Sun", len(away), away[:_NAMED]),) if away else ()
    notes = [*reading.notes, motion_line(catalogue) or ""]
    return BodyTable(
        "SPK kernel",
        catalogue.ids,
        catalogue.names,
        np.column_stack(
            [
                catalogue.epoch_mjd2000 + MJD2000_MJD,
                elements[:, 0] / AU,
                elements[:, 1],
                np.degrees(elements[:, 2:]),
            ]
        ),
        catalogue.extra,
        left_out,
        tuple(f": {note}" for note in notes if note),
    )
