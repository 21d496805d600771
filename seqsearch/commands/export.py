"""``seqsearch export``: write a tour or the search tree in a format of other programs."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Final

from feasibility import InputError
from feasibility.runtime.terminal import Level, say
from seqsearch.commands.options import add_catalogue

if TYPE_CHECKING:
    from seqsearch.commands.options import Commands

_DESCRIPTION: Final = """\
Write the tour of a run in a format that other programs read. A tour that was refined is written
with its continuous thrust, any other with its impulses, and the file says which.

  rows      what most competitions ask for; a refined tour only
  oem       CCSDS Orbit Ephemeris Message 2.0
  spk       SPICE kernel of type 9, read by jplephem, skyfield and astropy too
  spk13     SPICE kernel of type 13, smaller and smoother, for SPICE itself
  stk       ephemeris file of the Systems Tool Kit (.e)
  csv       table of all rows
  json      bodies, legs and rows, by a published JSON schema
  graphml   the search tree; a run folder only
  carrier   M.TXT, P1.TXT and so on into the folder PATH: a carrier and its refined craft
"""

_CARRIER: Final = "carrier"


def add_parser(commands: "Commands") -> None:
    """Add the command's options."""
    export = commands.add_parser(
        "export",
        help="write a tour for other programs",
        description=_DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    export.add_argument("path", metavar="RUN", help="run folder, or a sequence.json")
    export.add_argument("--to", metavar="FORMAT", required=True, help="one of those above")
    export.add_argument("--out", metavar="PATH", required=True, help="the file; replaced if there")
    add_catalogue(export)
    export.set_defaults(run=_export)


def _export(options: argparse.Namespace) -> int:
    from seqsearch.runs.flights import flight_of
    from seqsearch.runs.tree_graph import GRAPHML, write_graphml
    from seqsearch.tours.export import exporters

    path, out = Path(options.path), Path(options.out)
    if options.to == GRAPHML:
        nodes = write_graphml(path, out, options.catalogue)
        say(f"{out}: {nodes} nodes", Level.PROGRESS)
        return 0
    if options.to == _CARRIER:
        return _carrier(path, out)
    if options.to not in exporters():
        known = ", ".join([*exporters(), GRAPHML, _CARRIER])
        raise InputError(f"--to {options.to}: no such format, expected one of {known}")
    flight = flight_of(path)
    exporters()[options.to].write(flight, out)
    model = "continuous thrust" if flight.trajectory.continuous else "impulses, not refined"
    say(f"{out}: {len(flight.tour.legs)} legs, {model}", Level.PROGRESS)
    return 0


def _carrier(path: Path, out: Path) -> int:
    """Write the files of a carrier's run."""
    from seqsearch.runs.carriers import carrier_run
    from seqsearch.tours.carrier.rows import write_carrier_rows

    carrier, craft = carrier_run(path)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{out}: no folder to write to ({error.strerror})") from None
    write_carrier_rows(out, carrier, craft)
    say(f"{out}: {len(carrier.events)} events, {len(craft)} craft", Level.PROGRESS)
    return 0
