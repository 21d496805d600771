"""``seqsearch plot``: draw a tour."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Final

from feasibility import InputError
from feasibility.runtime.terminal import Level, say
from seqsearch.commands.options import sequence_path

if TYPE_CHECKING:
    from seqsearch.commands.options import Commands

_FIGURES: Final = (".png", ".svg", ".pdf")


def add_parser(commands: "Commands") -> None:
    """Add the command's options."""
    plot = commands.add_parser(
        "plot",
        help="draw a tour",
        description=(
            "Draw a tour: its path in the ecliptic with the bodies' orbits, visits and stays "
            "with names and dates, thrust and mass over time."
        ),
    )
    plot.add_argument("path", metavar="RUN", help="run folder, or a sequence.json")
    plot.add_argument("--to", metavar="FORMAT", help="png, svg or pdf (default: png)")
    plot.add_argument(
        "--out",
        metavar="FILE",
        help="a .png, .svg or .pdf file (default: tour.png, or as --to says, in the run folder)",
    )
    plot.set_defaults(run=_plot)


def _plot(options: argparse.Namespace) -> int:
    from seqsearch.tours.pictures.plots import plot_tour
    from seqsearch.tours.tour_files import read_tour

    source = sequence_path(options.path)
    if options.to is not None and f".{options.to}" not in _FIGURES:
        raise InputError(f"--to {options.to}: expected png, svg or pdf")
    if options.out is None:
        out = source.parent / f"tour.{options.to or 'png'}"
    else:
        out = Path(options.out)
    if out.suffix not in _FIGURES:
        raise InputError(f"--out {out}: expected a name that ends in {', '.join(_FIGURES)}")
    if options.to is not None and out.suffix != f".{options.to}":
        raise InputError(f"--out {out}: expected a name that ends in .{options.to}, as --to says")
    plot_tour(read_tour(source), out)
    say(str(out), Level.PROGRESS)
    return 0
