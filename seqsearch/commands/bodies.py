"""``seqsearch bodies``: what is in an asteroid table, and what was left out."""

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from feasibility import InputError
from feasibility.runtime.terminal import say, say_json
from seqsearch.commands.options import add_output

if TYPE_CHECKING:
    from feasibility.orbits.readers.bodies import BodyTable
    from seqsearch.commands.options import Commands

_DESCRIPTION: Final = """\
Show what is read from asteroid tables: how many bodies, their ids, names, epochs and elements,
and what is left out and why.

The format is recognised by content, also of gzipped files: MPCORB.DAT, NEA.txt and the extended
JSON of the Minor Planet Center, CSV and JSON of JPL's small-body database, elements and vectors
of Horizons, JPL's ELEMENTS.NUMBR, .UNNUM and .COMET, AstDyS, and any table with a header.
"""

_ROWS: Final = 10
_HEAD: Final = ("id", "name", "epoch MJD", "a AU", "e", "i deg", "node deg", "argp deg", "M deg")
_FORMATS: Final = ("", "", ".10g", ".7f", ".7f", ".5f", ".5f", ".5f", ".5f")
_KEYS: Final = ("epoch_mjd", "a_au", "e", "i_deg", "node_deg", "argp_deg", "m_deg")


def add_parser(commands: "Commands") -> None:
    """Add the command's options."""
    bodies = commands.add_parser(
        "bodies",
        help="show what is in an asteroid table",
        description=_DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    bodies.add_argument("files", nargs="+", metavar="FILE", help="asteroid table")
    bodies.add_argument("--all", action="store_true", help=f"all bodies, not the first {_ROWS}")
    bodies.add_argument(
        "--select", metavar="EXPR", help="these alone, such as 'a > 2.2 and e < 0.2 and H < 16'"
    )
    bodies.add_argument(
        "--units",
        metavar="COLUMN=UNIT,...",
        default="",
        help="units that the header does not tell, such as i=rad,epoch=JD",
    )
    add_output(bodies)
    bodies.set_defaults(run=_bodies)


def _bodies(options: argparse.Namespace) -> int:
    from feasibility.orbits.selection import selected_bodies
    from feasibility.orbits.tables import read_bodies

    units = _units(options.units)
    records = []
    for name in options.files:
        whole = table = read_bodies(Path(name), units=units)
        if options.select is not None:
            table = selected_bodies(whole, options.select, name)
        if options.json:
            records.append(_record(name, table, whole))
        else:
            _print(name, table, whole, every=options.all)
    if options.json:
        say_json(records[0] if len(records) == 1 else records)
    return 0


def _units(texts: str) -> dict[str, str]:
    units = {}
    for text in filter(None, texts.split(",")):
        column, sign, unit = text.partition("=")
        if not (column and sign and unit):
            raise InputError(f"--units {text!r}: expected COLUMN=UNIT, such as i=rad")
        units[column.strip()] = unit.strip()
    return units


def _print(name: str, table: "BodyTable", whole: "BodyTable", *, every: bool) -> None:
    from tabulate import tabulate

    selected = f"{len(table)} of " if table is not whole else ""
    say(f"{name}: {selected}{len(whole)} bodies, {table.label}")
    for note in table.notes:
        say(f"note: {note.lstrip(':, ')}")
    shown = range(len(table) if every else min(_ROWS, len(table)))
    rows = [(int(table.ids[k]), table.names[k], *table.orbits[k].tolist()) for k in shown]
    say(tabulate(rows, _HEAD, floatfmt=_FORMATS, disable_numparse=[0, 1]))
    if len(shown) < len(table):
        say(f"... and {len(table) - len(shown)} more; --all shows them")
    if table.extra:
        say(f"also known, for --select: {', '.join(table.extra)}")
    say(whole.left_out_line() or "nothing was left out")


def _record(name: str, table: "BodyTable", whole: "BodyTable") -> dict[str, Any]:
    """Return a table as plain data; null is what is not known."""
    return {
        "source": name,
        "format": table.label,
        "count": len(table),
        "ids": table.ids.tolist(),
        "names": list(table.names),
        **{key: table.orbits[:, k].tolist() for k, key in enumerate(_KEYS)},
        "extra": {
            key: [None if math.isnan(value) else value for value in column.tolist()]
            for key, column in table.extra.items()
        },
        "left_out": {
            "count": whole.total - len(whole),
            "of": whole.total,
            "reasons": [
                {"reason": part.reason, "count": part.count, "names": list(part.names)}
                for part in table.left_out
            ],
        },
        "notes": [note.lstrip(":, ") for note in table.notes],
    }
