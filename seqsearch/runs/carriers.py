"""A carrier's run folder: ``carrier.json``, and a sub-folder with the tour of each craft."""

from pathlib import Path

from feasibility.errors import InputError
from seqsearch.runs.fleet import probe_folder
from seqsearch.runs.flights import flight_of
from seqsearch.tours.carrier.carrier_files import CARRIER, read_carrier
from seqsearch.tours.carrier.records import Carrier, CraftRelease
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
