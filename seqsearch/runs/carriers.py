"""A carrier's run folder: ``carrier.json``, and a sub-folder with the tour of each craft."""

from pathlib import Path

from feasibility.errors import InputError
from seqsearch.runs.fleet import probe_folder
from seqsearch.runs.flights import flight_of
from seqsearch.tours.carrier.carrier_files import CARRIER, read_carrier
from seqsearch.tours.carrier.path import fly_carrier
from seqsearch.tours.carrier.reading import CarrierFiles, LogRow, is_carrier, read_carrier_files
from seqsearch.tours.carrier.records import Carrier, CraftRelease
from seqsearch.tours.carrier.rows import docked_carrier, event_label, named_at_carrier
from seqsearch.tours.trajectory import Trajectory


def is_carrier_run(folder: Path) -> bool:
    """Tell whether a folder holds a carrier's run."""
    return (folder / CARRIER).is_file()


def carrier_run(folder: Path) -> tuple[Carrier, dict[int, Trajectory]]:
    """Return the flight of a carrier's run, and the rows of each craft that it releases.

    Raises
    ------
    InputError
        A file cannot be read, or the tour of a craft was not refined to continuous thrust.
    """
    carrier = read_carrier(folder / CARRIER)
    craft = {}
    for event in carrier.events:
        if isinstance(event, CraftRelease):
            own = folder / probe_folder(event.craft)
            craft[event.craft] = flight_of(own).trajectory
            if not craft[event.craft].continuous:
                raise InputError(
                    f"{own}: impulses, expected continuous thrust; refine it first "
                    f"(seqsearch refine {own})"
                )
    return carrier, craft


def carrier_flight(folder: Path) -> CarrierFiles:
    """Return what the files of a carrier say, or would say of a carrier's run.

    Parameters
    ----------
    folder : Path
        With ``M.TXT`` and the files of the craft, or the folder of a run.

    Raises
    ------
    InputError
        As `carrier_run`, or a file to hand in cannot be read.
    """
    if is_carrier(folder):
        return read_carrier_files(folder)
    carrier, craft = carrier_run(folder)
    carrier = docked_carrier(carrier, craft)
    path = fly_carrier(carrier)
    log = []
    for event, state, mass in zip(carrier.events, path.after, path.mass_kg, strict=True):
        kind, _, number = event_label(event).partition(" P")
        log.append(LogRow(event.t_mjd2000, state, float(mass), kind, int(number or 0)))
    phases = {number: named_at_carrier(rows).phases for number, rows in craft.items()}
    return CarrierFiles(tuple(log), phases)
