"""``seqsearch plot``: draw a tour."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Final

from feasibility import InputError
from seqsearch.commands.options import sequence_path

if TYPE_CHECKING:
    from seqsearch.commands.options import Commands

_FIGURES: Final = (".png", ".svg", ".pdf")


def add_parser(commands: "Commands") -> None:
    """Add the command's options."""
    plot = commands.add_parser(
        "plot",
        help="draw a tour",
        description="Draw a tour: its path in the ecliptic, mass and throttle over time.",
    )
    plot.add_argument("path", metavar="RUN", help="run folder, or a sequence.json")
    plot.add_argument("--out", metavar="FILE", required=True, help="a .png, .svg or .pdf file")
    plot.set_defaults(run=_plot)


def _plot(options: argparse.Namespace) -> int:
    from seqsearch.tours.plots import plot_tour
    from seqsearch.tours.tour_files import read_tour

    out = Path(options.out)
    if out.suffix not in _FIGURES:
        raise InputError(f"--out {out}: expected a name that ends in {', '.join(_FIGURES)}")
    plot_tour(read_tour(sequence_path(options.path)), out)
    return 0
