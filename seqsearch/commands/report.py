"""``seqsearch report``: a run as one HTML page."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Final

from feasibility.runtime.terminal import Level, say

if TYPE_CHECKING:
    from seqsearch.commands.options import Commands

_DESCRIPTION: Final = """\
Write one HTML page that needs no network: the sequence, legs, trajectory in the ecliptic and in
3-D, thrust and mass, visits and stays, what the beam did at each rank, the audit, settings, seed
and versions. A folder with carrier.json, or with M.TXT and the files of the craft, gives a page of
the carrier and its craft.
"""


def add_parser(commands: "Commands") -> None:
    """Add the command's options."""
    report = commands.add_parser(
        "report", help="write a run as an HTML page", description=_DESCRIPTION
    )
    report.add_argument("path", metavar="RUN", help="run folder, or a sequence.json")
    report.add_argument(
        "--out", metavar="FILE", help="the page (default: report.html in the run folder)"
    )
    report.set_defaults(run=_report)


def _report(options: argparse.Namespace) -> int:
    from seqsearch.report.carrier_page import write_carrier_report
    from seqsearch.report.page import REPORT_PAGE, write_report

    path = Path(options.path)
    folder = path if path.is_dir() else path.parent
    out = folder / REPORT_PAGE if options.out is None else Path(options.out)
    size = (write_carrier_report if _of_carrier(path) else write_report)(path, out)
    say(f"{out}: {size / 1e6:.2f} MB", Level.PROGRESS)
    return 0


def _of_carrier(path: Path) -> bool:
    from seqsearch.runs.carriers import is_carrier_run
    from seqsearch.tours.carrier.reading import is_carrier

    return is_carrier(path) or is_carrier_run(path)
