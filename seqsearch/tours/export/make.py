"""Exporters by the names of their formats."""

from functools import cache
from importlib import metadata
from typing import Final

from feasibility.errors import InputError
from seqsearch.tours.export.csv_file import CsvExporter
from seqsearch.tours.export.json_file import JsonExporter
from seqsearch.tours.export.oem import OemExporter
from seqsearch.tours.export.protocol import Exporter
from seqsearch.tours.export.rows import RowsExporter
from seqsearch.tours.export.spk import Spk13Exporter, SpkExporter
from seqsearch.tours.export.stk import StkExporter

ENTRY_POINTS: Final = "seqsearch.exports"
"""Group of entry points by which other packages bring formats, named as their exporters."""

_OURS: Final[tuple[type[Exporter], ...]] = (
    RowsExporter,
    OemExporter,
    SpkExporter,
    Spk13Exporter,
    StkExporter,
    CsvExporter,
    JsonExporter,
)


@cache
def exporters() -> dict[str, Exporter]:
    """Return the exporters of this package and of all others, by name.

    Raises
    ------
    InputError
        One cannot be loaded, is no exporter, or brings a format that there is already.
    """
    known = {exporter.name: exporter for exporter in (kind() for kind in _OURS)}
    for entry in metadata.entry_points(group=ENTRY_POINTS):
        label = f"format {entry.name!r} of {ENTRY_POINTS}"
        if entry.name in known:
            raise InputError(f"{label}: {entry.value} brings a format that there is already")
        try:
            exporter = entry.load()()
        except Exception as error:
            raise InputError(
                f"{label}: {entry.value} cannot be loaded ({type(error).__name__}: {error})"
            ) from error
        if not isinstance(exporter, Exporter) or exporter.name != entry.name:
            raise InputError(f"{label}: {entry.value} is no exporter of that name")
        known[entry.name] = exporter
    return known


def make_exporter(name: str) -> Exporter:
    """Return the exporter of a format.

    Raises
    ------
    InputError
        There is none of that name.
    """
    if name not in exporters():
        raise InputError(f"format {name!r}, known are {', '.join(sorted(exporters()))}")
    return exporters()[name]
